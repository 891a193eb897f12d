"""Fitting a garment to the canonical body: by its binding to hm08 at rest, then carried by joints.

As MakeHuman does it, a vertex follows the joints of the three vertices that it is bound to. Where neighbours
are bound to different limbs (armpits, between legs) that tears cloth, so the weights are smoothed along it.
Cloth that hangs between the legs, as a skirt does, follows both, by how far it is from the middle. It is
carried to straight legs first, so that it hangs there as its artist made it, and from these to the canonical
pose, so that an asset's legs that close again bring it back.
"""

from functools import cache

import numpy as np
from jaxtyping import Float, Float64, Int64
from scipy.sparse import csr_matrix, diags, identity

from avatargen.body.load import load_body
from avatargen.body.model import pose_canonically
from avatargen.body.skinning import skin
from avatargen.shipped import shipped
from avatargen.wardrobe.makehuman.hm08 import Hm08
from avatargen.wardrobe.makehuman.read import Binding

DECIMETRE = 0.1
SMOOTHING = 12  # rounds of averaging weights with neighbours
LEGS = ((1, 2), (4, 5), (7, 8), (10, 11))  # joints, left and right
MIDDLE = 0.008  # m from the middle that a body's vertex may be to say where its legs part
BETWEEN = 0.12  # m from the middle within which hanging cloth follows both legs
HANGS = 0.08  # m below where the legs part, from which cloth hangs


def at_rest(hm08: Hm08, binding: Binding) -> Float64[np.ndarray, "V 3"]:
    """The garment's vertices on hm08 at rest, metres."""
    scale = np.full(3, DECIMETRE)
    for axis, entry in enumerate(binding.scales):
        if entry is not None and entry[2] > 0:
            first, second, length = entry
            scale[axis] = abs(hm08.rest[first, axis] - hm08.rest[second, axis]) / length
    anchors = np.einsum("vk,vka->va", binding.weights, hm08.rest[binding.indices])
    return anchors + binding.offsets * scale


def smoother(faces: Int64[np.ndarray, "F 3"], count: int) -> csr_matrix:
    """One round of averaging with neighbours along the edges of a mesh, half of it the vertex's own."""
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    both = np.concatenate([edges, edges[:, ::-1]])
    near = csr_matrix((np.ones(len(both)), (both[:, 0], both[:, 1])), shape=(count, count))
    near.data[:] = 1.0
    degree = np.asarray(near.sum(axis=1)).ravel()
    mean = diags(1 / np.maximum(degree, 1)) @ near
    alone = diags((degree == 0).astype(float))
    return csr_matrix(0.5 * (identity(count) + mean + alone))


def carried_weights(
    hm08: Hm08, binding: Binding, faces: Int64[np.ndarray, "F 3"]
) -> Float64[np.ndarray, "V J"]:
    """Weights of the garment's vertices on the joints, smooth along the garment."""
    share = np.maximum(binding.weights, 0)
    share /= np.maximum(share.sum(axis=1, keepdims=True), 1e-9)
    weights = np.einsum("vk,vkj->vj", share, hm08.dense_weights[binding.indices])
    average = smoother(faces, len(weights))
    for _ in range(SMOOTHING):
        weights = average @ weights
    return weights / weights.sum(axis=1, keepdims=True)


def hanging(
    hm08: Hm08, rest: Float64[np.ndarray, "V 3"], faces: Int64[np.ndarray, "F 3"]
) -> Float64[np.ndarray, " V"]:
    """How far each vertex hangs between the legs: 0 where they part and above, 1 from HANGS on; 0 everywhere
    for a garment without a face that crosses the middle there."""
    body = hm08.body_at_rest
    parting = np.nanmin(np.where(np.abs(body[:, 0]) < MIDDLE, body[:, 1], np.nan))
    share = np.clip((parting - rest[:, 1]) / HANGS, 0, 1)
    corners = rest[faces]
    crosses = (corners[..., 0].min(axis=1) < 0) & (corners[..., 0].max(axis=1) > 0)
    return share if (crosses & (share[faces].min(axis=1) == 1)).any() else np.zeros(len(rest))


def on_both_legs(
    weights: Float64[np.ndarray, "V J"], x: Float64[np.ndarray, " V"], hangs: Float64[np.ndarray, " V"]
) -> Float64[np.ndarray, "V J"]:
    """Weights with those of the legs shared by the place across them (m), as far as the cloth hangs."""
    shared = weights.copy()
    left = np.clip(0.5 + 0.5 * x / BETWEEN, 0, 1)
    for pair in LEGS:
        both = weights[:, pair].sum(axis=1)
        shared[:, pair] = both[:, None] * np.stack([left, 1 - left], axis=1)
    return weights + hangs[:, None] * (shared - weights)


def fit(hm08: Hm08, binding: Binding, faces: Int64[np.ndarray, "F 3"]) -> Float[np.ndarray, "V 3"]:
    """The garment's vertices on the canonical body, metres."""
    rest = at_rest(hm08, binding)
    hangs = hanging(hm08, rest, faces)
    weights = on_both_legs(carried_weights(hm08, binding, faces), rest[:, 0], hangs)
    carried = skin(rest, weights, hm08.T_canonical_rest)
    if not hangs.any():
        return carried
    T_canonical_straight = straight_legs()
    straight = skin(rest, weights, np.linalg.inv(T_canonical_straight) @ hm08.T_canonical_rest)
    return carried + hangs[:, None] * (skin(straight, weights, T_canonical_straight) - carried)


@cache
def straight_legs() -> Float64[np.ndarray, "J 4 4"]:
    """From the default body's T-pose to the canonical one, by joint."""
    return pose_canonically(load_body(shipped("body.npz"))).T_posed_rest.astype(np.float64)
