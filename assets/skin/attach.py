"""Where each vertex of a surface sits on the canonical body, and how values given on the body are carried
over.

A match with the closest body point is trusted within a distance and an angle between the normals, and only
where its neighbours agree; between toes, fingers and thighs, under hair and skirts it is not. There values
are filled in by a harmonic solve on the mesh, after Robust Skin Weights Transfer via Weight Inpainting
(Abdrashitov et al. 2023). With positive edge weights a filled value never leaves the range of the trusted
ones around it.

Letters: V vertices of the surface, B vertices of the body, C channels.
"""

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Bool, Float, Float64, Int64
from scipy.sparse import coo_array, csc_array, csr_array, diags_array
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import splu

from assets.mesh.surface import Surface, directed_edges, edge_lengths, vertex_normals
from avatargen.body.model import CanonicalBody


@dataclass(frozen=True, kw_only=True)
class AttachConfig:
    """When a closest point is trusted."""

    largest_distance: float = 0.1  # metres: what loose cloth stands off
    largest_angle: float = 40.0  # degrees between the normals
    largest_jump: float = 0.25  # share of the weight that may change joints along a short edge
    jump_length: float = 0.2  # metres of edge along which it may change joints altogether on top of that
    shortest_bone: float = 0.045  # metres: a joint nearer to its parent counts as one with it, as in a finger


@runtime_checkable
class Carrier(Protocol):
    """What brings values given on the body to the vertices of a surface."""

    def carry(self, values: np.ndarray) -> np.ndarray: ...


@dataclass(frozen=True, kw_only=True)
class Attachment:
    """The closest body point of each vertex, and the edges along which values are filled where it is not
    trusted."""

    corners: Int64[np.ndarray, "V 3"]  # body vertices of the closest face
    barycentric: Float64[np.ndarray, "V 3"]
    trusted: Bool[np.ndarray, " V"]
    graph: csr_array  # V V, symmetric, positive where two vertices share an edge

    def closest(self, values: Float[np.ndarray, "B C"]) -> Float64[np.ndarray, "V C"]:
        """Values at the closest body points."""
        return np.einsum("vk,vkc->vc", self.barycentric, np.asarray(values, dtype=np.float64)[self.corners])

    def carry(self, values: Float[np.ndarray, "B C"]) -> Float64[np.ndarray, "V C"]:
        """Values at the closest body points where those are trusted, filled in smoothly elsewhere."""
        return fill(self.graph, self.closest(values), self.trusted)

    def averaged(self, values: Float64[np.ndarray, "V C"]) -> Float64[np.ndarray, "V C"]:
        """The mean of each vertex's neighbours, the nearer the heavier."""
        return (self.graph @ values) / np.maximum(self.graph.sum(axis=1), 1e-12)[:, None]


def attach(surface: Surface, body: CanonicalBody, config: AttachConfig | None = None) -> Attachment:
    """Find each vertex's closest point on the canonical body and whether to trust it."""
    config = config or AttachConfig()
    hit = body.distance.query(surface.vertices)
    corners = body.faces[hit.face]
    barycentric = hit.barycentric.astype(np.float64)
    body_normals = vertex_normals(Surface(vertices=body.vertices.astype(np.float64), faces=body.faces))
    normals = np.einsum("vk,vkd->vd", barycentric, body_normals[corners])
    facing = np.einsum("vd,vd->v", normals, vertex_normals(surface))
    aligned = facing >= np.cos(np.radians(config.largest_angle)) * np.linalg.norm(normals, axis=1)
    near = np.abs(hit.distance) <= config.largest_distance
    weights = np.einsum("vk,vkj->vj", barycentric, body.weights.astype(np.float64)[corners])
    steady = ~jumps(surface, weights @ limbs(body, config.shortest_bone), config)
    graph = edge_graph(surface)
    return Attachment(corners=corners, barycentric=barycentric, trusted=near & aligned & steady, graph=graph)


def limbs(body: CanonicalBody, shortest: float) -> Float64[np.ndarray, "J L"]:
    """Which joints count as one: times this matrix, weights are those of chains of short bones."""
    limb = np.arange(len(body.parents))
    for joint, parent in enumerate(body.parents):
        if parent >= 0 and np.linalg.norm(body.joints[joint] - body.joints[parent]) < shortest:
            limb[joint] = limb[parent]
    return np.eye(len(limb))[:, np.unique(limb)][limb]


def jumps(
    surface: Surface, weights: Float64[np.ndarray, "V L"], config: AttachConfig
) -> Bool[np.ndarray, " V"]:
    """Vertices at an edge along which more of the weight moves to other limbs than its length explains."""
    edges = directed_edges(surface.faces)
    moved = 0.5 * np.abs(weights[edges[:, 0]] - weights[edges[:, 1]]).sum(axis=1)
    allowed = config.largest_jump + edge_lengths(surface, edges) / config.jump_length
    jumping = np.zeros(len(surface.vertices), dtype=bool)
    jumping[edges[moved > allowed].reshape(-1)] = True
    return jumping


def edge_graph(surface: Surface) -> csr_array:
    """Symmetric matrix of one over the length of each edge."""
    edges = directed_edges(surface.faces)
    value = 0.5 / np.maximum(edge_lengths(surface, edges), 1e-6)
    rows, columns = np.concatenate([edges, edges[:, ::-1]]).T
    size = len(surface.vertices)
    return csr_array(coo_array((np.concatenate([value, value]), (rows, columns)), shape=(size, size)))


def fill(
    graph: csr_array, values: Float64[np.ndarray, "V C"], known: Bool[np.ndarray, " V"]
) -> Float64[np.ndarray, "V C"]:
    """Harmonic values where they are not known; a component with nothing known keeps what it had."""
    known = known | ~reaches(graph, known)
    if known.all():
        return values
    unknown = np.flatnonzero(~known)
    rows = graph[unknown]
    laplacian = diags_array(rows.sum(axis=1)) - rows[:, unknown]
    filled = values.copy()
    filled[unknown] = splu(csc_array(laplacian)).solve(rows[:, np.flatnonzero(known)] @ values[known])
    return filled


def reaches(graph: csr_array, known: Bool[np.ndarray, " V"]) -> Bool[np.ndarray, " V"]:
    """Vertices in a component with at least one known vertex."""
    count, label = connected_components(graph, directed=False)
    anchored = np.zeros(count, dtype=bool)
    anchored[label[known]] = True
    return anchored[label]
