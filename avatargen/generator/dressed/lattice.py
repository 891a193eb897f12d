"""Nodes on a part of a body's surface: every face cut into n x n smaller ones, their corners shared.

A closest point on the body is a face and three weights, so the small face it lies on, and its place in that,
follow by arithmetic: no mesh is subdivided and nothing is searched. Node 0 stands for all that is not
covered and for the border of what is, so features that are zero there fade out without a jump.

Letters: F faces, M = (n + 1)(n + 2) / 2 nodes of a face, node (i, j) lying i / n of the way to the second
corner and j / n to the third.
"""

from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor


@dataclass(frozen=True, kw_only=True, eq=False)
class Lattice:
    """Which node stands at each place of each face."""

    segments: int
    face_nodes: Int[np.ndarray, "F M"]
    count: int  # of nodes, with node 0


def place(i: Int[np.ndarray, "*m"], j: Int[np.ndarray, "*m"], n: int) -> Int[np.ndarray, "*m"]:
    """Where a face's list has node (i, j)."""
    return i * (n + 1) - i * (i - 1) // 2 + j


def lattice(faces: Int[np.ndarray, "F 3"], covered: Bool[np.ndarray, " F"], segments: int) -> Lattice:
    """The nodes of the covered faces."""
    n = segments
    if not covered.any():
        blank = np.zeros((len(faces), (n + 1) * (n + 2) // 2), np.int32)
        return Lattice(segments=n, face_nodes=blank, count=1)
    inside = faces[covered]
    size = int(faces.max()) + 1
    pairs = [(inside[:, a], inside[:, b]) for a, b in ((0, 1), (0, 2), (1, 2))]
    # an edge as one number, as rows take many times as long to sort
    numbers = np.stack([np.minimum(a, b) * size + np.maximum(a, b) for a, b in pairs], axis=1)
    edges, edge_of = np.unique(numbers, return_inverse=True)
    edge_of = edge_of.reshape(-1, 3)
    border = np.bincount(edge_of.ravel(), minlength=len(edges)) == 1
    if covered.all():
        border[:] = False
    within = np.zeros(size, dtype=bool)
    within[inside] = True
    within[edges[border] // size] = within[edges[border] % size] = False
    vertices = np.flatnonzero(within)
    vertex_node = np.zeros(size, np.int64)
    vertex_node[vertices] = 1 + np.arange(len(vertices))
    count = 1 + len(vertices)
    edge_node = np.zeros((len(edges), n - 1), np.int64)
    edge_node[~border] = count + np.arange((~border).sum() * (n - 1)).reshape((~border).sum(), n - 1)
    count += (~border).sum() * (n - 1)
    nodes = np.zeros((len(inside), (n + 1) * (n + 2) // 2), np.int64)
    nodes[:, place(np.array([0, n, 0]), np.array([0, 0, n]), n)] = vertex_node[inside]
    step = np.arange(1, n)
    sides = (((0, 1), step, 0 * step), ((0, 2), 0 * step, step), ((1, 2), n - step, step))
    for side, ((a, b), i, j) in enumerate(sides):
        own = edge_node[edge_of[:, side]]  # counted from the smaller vertex on
        turned = inside[:, a] > inside[:, b]
        nodes[:, place(i, j, n)] = np.where(turned[:, None], own[:, ::-1], own)
    i, j = (a.ravel() for a in np.meshgrid(step, step, indexing="ij"))
    middle = place(i, j, n)[i + j < n]
    nodes[:, middle] = count + np.arange(len(inside) * len(middle)).reshape(len(inside), len(middle))
    face_nodes = np.zeros((len(faces), nodes.shape[1]), np.int32)
    face_nodes[covered] = nodes
    return Lattice(segments=n, face_nodes=face_nodes, count=int(count + len(inside) * len(middle)))


def node_places(
    vertices: Float[np.ndarray, "V 3"], faces: Int[np.ndarray, "F 3"], nodes: Lattice
) -> Float[np.ndarray, "nodes 3"]:
    """Where the nodes lie, metres; node 0 at the origin."""
    n = nodes.segments
    i, j = (a.ravel() for a in np.meshgrid(np.arange(n + 1), np.arange(n + 1), indexing="ij"))
    i, j = i[i + j <= n], j[i + j <= n]
    weights = np.stack([n - i - j, i, j], axis=1)[np.argsort(place(i, j, n))] / n
    found = np.zeros((nodes.count, 3))
    found[nodes.face_nodes] = np.einsum("mk,fkx->fmx", weights, vertices[faces])
    found[0] = 0
    return found


def at_points(
    face_nodes: Int[Tensor, "F M"],
    segments: int,
    face: Int[Tensor, "*n"],
    barycentric: Float[Tensor, "*n 3"],
) -> tuple[Int[Tensor, "*n 3"], Float[Tensor, "*n 3"]]:
    """Three nodes around each body point, and their weights; that of node 0 is zero."""
    n = segments
    u, v = barycentric[..., 1] * n, barycentric[..., 2] * n
    i = u.floor().clamp(0, n - 1)
    j = torch.minimum(v.floor().clamp_min(0), n - 1 - i)
    u, v = u - i, v - j
    upper = (u + v > 1) & (i + j < n - 1)
    i, j = i.long(), j.long()
    over = upper.long()
    local = torch.stack(
        [place_of(i + over, j + over, n), place_of(i + 1, j, n), place_of(i, j + 1, n)], dim=-1
    )
    weights = torch.where(
        upper[..., None],
        torch.stack([u + v - 1, 1 - v, 1 - u], dim=-1),
        torch.stack([1 - u - v, u, v], dim=-1),
    )
    nodes = face_nodes[face[..., None], local]
    return nodes, weights * (nodes > 0)


def place_of(i: Tensor, j: Tensor, n: int) -> Tensor:
    """`place` of torch's numbers."""
    return i * (n + 1) - torch.div(i * (i - 1), 2, rounding_mode="floor") + j
