"""Fitting a garment to the canonical body: by its binding to hm08 at rest, then carried by joints.

As MakeHuman does it, a vertex follows the joints of the three vertices that it is bound to. Where neighbours
are bound to different limbs (armpits, between legs) that tears cloth, so the weights are smoothed along it.
"""

import numpy as np
from jaxtyping import Float, Float64, Int64
from scipy.sparse import csr_matrix, diags, identity

from avatargen.body.skinning import skin
from avatargen.wardrobe.makehuman.hm08 import Hm08
from avatargen.wardrobe.makehuman.read import Binding

DECIMETRE = 0.1
SMOOTHING = 12  # rounds of averaging weights with neighbours


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


def fit(hm08: Hm08, binding: Binding, faces: Int64[np.ndarray, "F 3"]) -> Float[np.ndarray, "V 3"]:
    """The garment's vertices on the canonical body, metres."""
    weights = carried_weights(hm08, binding, faces)
    return skin(at_rest(hm08, binding), weights, hm08.T_canonical_rest)
