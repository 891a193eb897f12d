"""Skinning weights for a surface around the canonical body: four joints a vertex, heaviest first.

Letters: V vertices, J joints of the body, F faces.
"""

from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Bool, Float, Float32, Float64, Int64
from scipy.sparse import coo_array, csr_array, diags_array
from scipy.sparse.csgraph import connected_components

from assets.errors import GeometryError
from assets.mesh.surface import Surface, opposite_edges
from assets.skin.attach import AttachConfig, Attachment, limbs
from avatargen.body.model import CanonicalBody

INFLUENCES = 4
NEGLIGIBLE = 1e-3  # a weight under this is dropped
MERGINGS = 24  # rounds of joining small parts: two may take each other's place for ever


@dataclass(frozen=True, kw_only=True)
class SkinConfig:
    """How weights are found and how much those near filled places are smoothed."""

    attach: AttachConfig = field(default_factory=AttachConfig)
    smoothing_rounds: int = 8
    smoothing: float = 0.5  # share of the neighbours' mean, each round


@dataclass(frozen=True, kw_only=True)
class Skin:
    """Four joint influences per vertex, heaviest first; each row of weights sums to 1, unused slots name
    joint 0."""

    joints: Int64[np.ndarray, "V 4"]
    weights: Float32[np.ndarray, "V 4"]

    def __post_init__(self) -> None:
        error = np.abs(self.weights.sum(axis=1, dtype=np.float64) - 1).max(initial=0)
        if not error < 1e-5:  # also catches NaN
            raise GeometryError(f"skin: weight sums are off 1 by {error:.1e}, limit 1e-5")
        if self.weights.min(initial=0) < 0 or (self.joints[self.weights == 0] != 0).any():
            raise GeometryError(
                "skin: weights must be 0 or more, and a slot without weight must name joint 0"
            )

    def dense(self, joint_count: int) -> Float64[np.ndarray, "V J"]:
        """The weights as one column a joint."""
        full = np.zeros((len(self.joints), joint_count))
        np.add.at(full, (np.arange(len(full))[:, None], self.joints), self.weights)
        return full


def skin_attached(attachment: Attachment, body: CanonicalBody, config: SkinConfig) -> Skin:
    """Weights of the closest body points where those can be trusted, filled in smoothly elsewhere.

    Raises:
        GeometryError: a vertex ends without weight on any joint.
    """
    weights = np.maximum(attachment.carry(body.weights), 0)
    # four rings of edges are longer than a finger's bone: there only what was filled is smoothed
    slender = weights @ on_short_bones(body, config.attach.shortest_bone) > 0.5
    near = near_filled(attachment, config.smoothing_rounds) & ~(attachment.trusted & slender)
    return limit_influences(smooth(attachment.graph, weights, near, config))


def on_short_bones(body: CanonicalBody, shortest: float) -> Float64[np.ndarray, " J"]:
    """1 for each joint of a chain of short bones, 0 for others."""
    chains = limbs(body, shortest)
    return chains @ (chains.sum(axis=0) > 1)


def near_filled(attachment: Attachment, rings: int) -> Bool[np.ndarray, " V"]:
    """Filled vertices and those within `rings` edges of one."""
    near = ~attachment.trusted
    for _ in range(rings):
        near = near | (attachment.graph @ near.astype(np.float64) > 0)
    return near


def smooth(
    graph: csr_array, weights: Float64[np.ndarray, "V J"], where: Bool[np.ndarray, " V"], config: SkinConfig
) -> Float64[np.ndarray, "V J"]:
    """Blend chosen vertices with the mean of their neighbours, a few rounds."""
    if not where.any():
        return weights
    rows = graph[np.flatnonzero(where)]
    mean = diags_array(1 / rows.sum(axis=1)) @ rows
    weights = weights.copy()
    for _ in range(config.smoothing_rounds):
        weights[where] = (1 - config.smoothing) * weights[where] + config.smoothing * (mean @ weights)
    return weights


def limit_influences(weights: Float[np.ndarray, "V J"]) -> Skin:
    """Keep the four heaviest joints of each vertex and rescale them to sum to 1.

    Raises:
        GeometryError: a vertex has no weight on any joint.
    """
    joints = np.argsort(-weights, axis=1, kind="stable")[:, :INFLUENCES]
    kept = np.take_along_axis(weights, joints, axis=1).astype(np.float64)
    total = kept.sum(axis=1, keepdims=True)
    if not (total > 0).all():
        raise GeometryError(f"skin: {int((~(total > 0)).sum())} vertices have no weight; widen the search")
    kept = np.where(kept > NEGLIGIBLE * total, kept, 0)
    missing = INFLUENCES - kept.shape[1]  # of a body with fewer than four joints
    joints, kept = np.pad(joints, ((0, 0), (0, missing))), np.pad(kept, ((0, 0), (0, missing)))
    kept = (kept / kept.sum(axis=1, keepdims=True)).astype(np.float32)
    return Skin(joints=np.where(kept > 0, joints, 0).astype(np.int64), weights=kept)


def parts_of_faces(
    surface: Surface, skin: Skin, part_of_joint: Int64[np.ndarray, " J"] | None = None, smallest: int = 40
) -> Int64[np.ndarray, " F"]:
    """The part that dominates each face, by default a joint; regions of fewer than `smallest` faces join the
    neighbour they share most edges with."""
    joint_count = int(skin.joints.max()) + 1 if part_of_joint is None else len(part_of_joint)
    weights = skin.dense(joint_count)
    if part_of_joint is not None:
        weights = weights @ np.eye(joint_count)[part_of_joint]
    part = weights[surface.faces].sum(axis=1).argmax(axis=1)
    return merge_small(part, opposite_edges(surface.faces, len(surface.vertices)), smallest)


def merge_small(
    part: Int64[np.ndarray, " F"], twin: Int64[np.ndarray, " E"], smallest: int
) -> Int64[np.ndarray, " F"]:
    """Parts, where regions of fewer than `smallest` faces join the neighbour they share most edges with."""
    edge = np.flatnonzero(twin >= 0)
    here, there = edge // 3, twin[edge] // 3
    count = int(part.max()) + 1
    for _ in range(MERGINGS):
        region = connected_regions(part, here, there)
        small = np.bincount(region)[region] < smallest
        border = small[here] & (part[here] != part[there])
        if not border.any():
            break
        pair, votes = np.unique(region[here[border]] * count + part[there[border]], return_counts=True)
        order = np.lexsort((-pair, votes, pair // count))  # of equal ones the lowest part last
        of_region = pair[order] // count
        last = np.append(of_region[1:] != of_region[:-1], True)
        chosen = np.full(region.max() + 1, -1)
        chosen[of_region[last]] = pair[order][last] % count
        part = np.where(small & (chosen >= 0)[region], chosen[region], part)
    return part.astype(np.int64)


def connected_regions(
    part: Int64[np.ndarray, " F"], here: Int64[np.ndarray, " E"], there: Int64[np.ndarray, " E"]
) -> Int64[np.ndarray, " F"]:
    """Number of the connected region of equal part that each face lies in; faces here[i] and there[i] share
    an edge."""
    same = part[here] == part[there]
    ones = np.ones(int(same.sum()), dtype=bool)
    graph = coo_array((ones, (here[same], there[same])), shape=(len(part), len(part)))
    return connected_components(graph, directed=False)[1].astype(np.int64)
