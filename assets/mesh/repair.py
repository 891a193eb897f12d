"""Make any triangle soup closed and manifold by local surgery: cut out what is wrong, part what only
touches, cap the holes.

    faces at an edge that is not shared by exactly two opposed faces   are removed
    vertices whose faces form several fans                              are split, one for each fan
    every hole's rim is then a simple loop, closed by a fan around its middle

Letters: V vertices, F faces, E directed edges.
"""

import numpy as np
from jaxtyping import Int64
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from assets.mesh.surface import Surface, compact, directed_edges, opposite_edges

ROUNDS = 4


def repair(surface: Surface) -> Surface:
    """A surface without open, crowded or twisted edges and without vertices that several fans share.

    Nothing is promised about the area or the orientation of what is left, nor about the number of components.
    """
    for _ in range(ROUNDS):
        surface = split_vertices(remove_bad_faces(surface))
        surface = fill_holes(surface)
        if (opposite_edges(surface.faces, len(surface.vertices)) >= 0).all():
            break
    return surface


def remove_bad_faces(surface: Surface) -> Surface:
    """Without the faces at crowded or twisted edges, and those that name a vertex twice. Open edges may
    stay."""
    faces = surface.faces
    faces = faces[(faces != np.roll(faces, 1, axis=1)).all(axis=1)]
    count = len(surface.vertices)
    edges = directed_edges(faces)
    low, high = edges.min(axis=1), edges.max(axis=1)
    _, edge, shared = np.unique(low * count + high, return_inverse=True, return_counts=True)
    wrong = (shared[edge] > 1) & (opposite_edges(faces, count) < 0)
    return compact(surface.vertices, faces[~wrong.reshape(-1, 3).any(axis=1)])


def split_vertices(surface: Surface) -> Surface:
    """A vertex of its own for each fan of faces, fans being faces that share edges."""
    fan = fans(surface)
    _, first, corner = np.unique(fan, return_index=True, return_inverse=True)
    vertices = surface.vertices[surface.faces.reshape(-1)[first]]
    return Surface(vertices=vertices, faces=corner.reshape(-1, 3).astype(np.int64))


def fans(surface: Surface) -> Int64[np.ndarray, " E"]:
    """For each corner, in the order of `faces`, the number of the fan it belongs to."""
    twin = opposite_edges(surface.faces, len(surface.vertices))
    edge = np.flatnonzero(twin >= 0)
    rows = np.concatenate([edge, next_edge(edge)])  # the corners at an edge's start and end ...
    # ... are those at its opposite's end and start
    columns = np.concatenate([next_edge(twin[edge]), twin[edge]])
    size = surface.faces.size
    graph = coo_array((np.ones(len(rows), dtype=bool), (rows, columns)), shape=(size, size))
    return connected_components(graph, directed=False)[1].astype(np.int64)


def next_edge(edge: Int64[np.ndarray, " E"]) -> Int64[np.ndarray, " E"]:
    """The next edge of the same face."""
    return edge - edge % 3 + (edge + 1) % 3


def fill_holes(surface: Surface) -> Surface:
    """Close every rim with faces to a new vertex in its middle."""
    count = len(surface.vertices)
    edges = directed_edges(surface.faces)[opposite_edges(surface.faces, count) < 0]
    if len(edges) == 0:
        return surface
    graph = coo_array((np.ones(len(edges), dtype=bool), (edges[:, 0], edges[:, 1])), shape=(count, count))
    rim = connected_components(graph, directed=False)[1][edges[:, 0]]
    _, rim = np.unique(rim, return_inverse=True)
    weight = np.bincount(rim)
    middles = np.stack(
        [np.bincount(rim, surface.vertices[edges[:, 0], d]) / weight for d in range(3)], axis=1
    )
    caps = np.stack([edges[:, 1], edges[:, 0], count + rim], axis=1)
    return Surface(
        vertices=np.concatenate([surface.vertices, middles]),
        faces=np.concatenate([surface.faces, caps]).astype(np.int64),
    )
