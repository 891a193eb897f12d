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

from assets.mesh.surface import Surface, opposite_edges

ROUNDS = 4

Twins = Int64[np.ndarray, " E"]


def repair(surface: Surface) -> Surface:
    """A surface without open, crowded or twisted edges and without vertices that several fans share.

    Nothing is promised about the area or the orientation of what is left, nor about the number of components.
    """
    for _ in range(ROUNDS):
        surface, twin = remove_bad_faces(surface)
        surface = fill_holes(split_vertices(surface, twin), twin)
        if (opposite_edges(surface.faces, len(surface.vertices)) >= 0).all():
            break
    return surface


def remove_bad_faces(surface: Surface) -> tuple[Surface, Twins]:
    """Without the faces at crowded or twisted edges, and those that name a vertex twice; and the twins of the
    edges that are left, -1 for none: open edges may stay. All vertices stay."""
    faces = surface.faces
    faces = faces[(faces != np.roll(faces, 1, axis=1)).all(axis=1)]
    count = len(surface.vertices)
    twin = opposite_edges(faces, count)
    single = np.flatnonzero(twin < 0)  # nothing shares an edge with these but others of them
    start, end = ends_of(faces, single)
    _, edge, shared = np.unique(
        np.minimum(start, end) * count + np.maximum(start, end), return_inverse=True, return_counts=True
    )
    kept = np.ones(len(faces), dtype=bool)
    kept[single[shared[edge] > 1] // 3] = False
    left = twin.reshape(-1, 3)[kept].reshape(-1)
    there = (left >= 0) & kept[left // 3]
    left = np.where(there, 3 * (np.cumsum(kept) - 1)[left // 3] + left % 3, -1)
    return Surface(vertices=surface.vertices, faces=faces[kept]), left


def split_vertices(surface: Surface, twin: Twins) -> Surface:
    """A vertex of its own for each fan of faces, fans being faces that share edges; a vertex without faces
    goes. Twins stay what they are."""
    from assets.mesh.connectivity import label_fans

    fan, first = label_fans(np.ascontiguousarray(surface.faces), twin)
    vertices = surface.vertices[surface.faces.reshape(-1)[first]]
    return Surface(vertices=vertices, faces=fan.reshape(-1, 3))


def next_edge(edge: Int64[np.ndarray, " E"]) -> Int64[np.ndarray, " E"]:
    """The next edge of the same face."""
    return edge - edge % 3 + (edge + 1) % 3


def ends_of(
    faces: Int64[np.ndarray, "F 3"], edge: Int64[np.ndarray, " N"]
) -> tuple[Int64[np.ndarray, " N"], Int64[np.ndarray, " N"]]:
    """The vertices that directed edges run from and to."""
    flat = faces.reshape(-1)
    return flat[edge], flat[next_edge(edge)]


def fill_holes(surface: Surface, twin: Twins) -> Surface:
    """Close every rim with faces to a new vertex in its middle."""
    start, end = ends_of(surface.faces, np.flatnonzero(twin < 0))
    if len(start) == 0:
        return surface
    on_rim, place = np.unique(np.concatenate([start, end]), return_inverse=True)
    size, pairs = len(on_rim), place.reshape(2, -1)
    graph = coo_array((np.ones(len(start), dtype=bool), (pairs[0], pairs[1])), shape=(size, size))
    rim = connected_components(graph, directed=False)[1][pairs[0]].astype(np.int64)
    weight = np.bincount(rim)
    middles = np.stack([np.bincount(rim, surface.vertices[start, d]) / weight for d in range(3)], axis=1)
    caps = np.stack([end, start, len(surface.vertices) + rim], axis=1)
    return Surface(
        vertices=np.concatenate([surface.vertices, middles]),
        faces=np.concatenate([surface.faces, caps]).astype(np.int64),
    )
