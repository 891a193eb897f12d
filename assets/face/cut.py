"""A mesh whose edges are split: new vertices lie on edges and in faces that are there, with everything that
vertices carry mixed of their ends', so that nothing looks otherwise.

Letters: W vertices (the texture's seams have split them), F faces, C values that a vertex carries, E edges.
An edge is a pair of welded vertices, the smaller number first.
"""

import itertools
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float64, Int64

from assets.errors import GeometryError
from assets.mesh.surface import directed_edges


@dataclass(frozen=True, kw_only=True)
class CutMesh:
    """Faces, the number of each vertex before the seams split it, and what it carries."""

    faces: Int64[np.ndarray, "F 3"]
    welded: Int64[np.ndarray, " W"]
    places: Float64[np.ndarray, "W 3"]  # canonical, metres
    values: Float64[np.ndarray, "W C"]

    @property
    def points(self) -> Float64[np.ndarray, "V 3"]:
        """Canonical places of the welded vertices."""
        found = np.zeros((int(self.welded.max()) + 1, 3))
        found[self.welded] = self.places
        return found

    @property
    def welded_faces(self) -> Int64[np.ndarray, "F 3"]:
        return self.welded[self.faces]

    def edges(self) -> Int64[np.ndarray, "E 2"]:
        """Every edge once."""
        ends, size = np.sort(directed_edges(self.welded_faces), axis=1), int(self.welded.max()) + 1
        return np.stack(np.divmod(np.unique(ends @ np.array([size, 1])), size), axis=1)


def split_edges(mesh: CutMesh, edges: Int64[np.ndarray, "E 2"], shares: Float64[np.ndarray, " E"]) -> CutMesh:
    """The mesh with a vertex on each of these edges, at a share of the way from the first to the second."""
    if not len(edges):
        return mesh
    first_new, count = int(mesh.welded.max()) + 1, len(mesh.welded)
    number = {(a, b): i for i, (a, b) in enumerate(edges.tolist())}
    size = first_new
    keys = np.sort(edges, axis=1) @ [size, 1]
    of_face = np.sort(mesh.welded_faces[:, [[0, 1], [1, 2], [2, 0]]], axis=2) @ np.array([size, 1])
    touched = np.isin(of_face, keys).any(axis=1)
    made: dict[tuple[int, int, int], int] = {}
    faces: list[tuple[int, int, int]] = []
    for corners in mesh.faces[touched].tolist():
        middles: list[int | None] = []
        for a, b in ((0, 1), (1, 2), (2, 0)):
            low, high = corners[a], corners[b]
            if mesh.welded[low] > mesh.welded[high]:
                low, high = high, low
            index = number.get((int(mesh.welded[low]), int(mesh.welded[high])))
            middles.append(None if index is None else made.setdefault((low, high, index), count + len(made)))
        faces += parted(corners, middles, mesh.places)
    low, high, index = np.array(list(made)).reshape(-1, 3).T
    share = shares[index][:, None]
    return CutMesh(
        faces=np.concatenate([mesh.faces[~touched], np.array(faces, np.int64).reshape(-1, 3)]),
        welded=np.concatenate([mesh.welded, first_new + index]),
        places=np.concatenate([mesh.places, mixed(mesh.places, low, high, share)]),
        values=np.concatenate([mesh.values, mixed(mesh.values, low, high, share)]),
    )


def mixed(
    values: Float64[np.ndarray, "W C"],
    low: Int64[np.ndarray, " N"],
    high: Int64[np.ndarray, " N"],
    share: Float64[np.ndarray, "N 1"],
) -> Float64[np.ndarray, "N C"]:
    return values[low] + share * (values[high] - values[low])


def parted(
    corners: list[int], middles: list[int | None], places: Float64[np.ndarray, "W 3"]
) -> list[tuple[int, int, int]]:
    """One face in two to four, by the vertices on its edges 01, 12 and 20."""
    found = [middle for middle in middles if middle is not None]
    if len(found) == 3:
        (a, b, c), (m, n, o) = corners, found
        return [(a, m, o), (m, b, n), (o, n, c), (m, n, o)]
    # turned so that the edge without a vertex comes last, or the one with one first
    turn = middles.index(None) + 1 if len(found) == 2 else [m is not None for m in middles].index(True)
    a, b, c = (corners[(turn + k) % 3] for k in range(3))
    if len(found) == 1:
        return [(a, found[0], c), (found[0], b, c)]
    m, n = (middles[(turn + k) % 3] for k in range(2))
    assert m is not None and n is not None
    corner = (m, b, n)
    middle_m, middle_n = (places[a] + places[b]) / 2, (places[b] + places[c]) / 2
    if np.linalg.norm(places[a] - middle_n) <= np.linalg.norm(places[c] - middle_m):
        return [corner, (a, m, n), (a, n, c)]
    return [corner, (a, m, c), (m, n, c)]


def insert(mesh: CutMesh, face: int, barycentric: Float64[np.ndarray, "3"]) -> CutMesh:
    """The mesh with a vertex more, in a face that becomes three."""
    a, b, c = mesh.faces[face].tolist()
    new = len(mesh.welded)
    rows = mesh.faces[face]
    return CutMesh(
        faces=np.concatenate(
            [np.delete(mesh.faces, face, axis=0), np.array([(a, b, new), (b, c, new), (c, a, new)])]
        ),
        welded=np.append(mesh.welded, int(mesh.welded.max()) + 1),
        places=np.concatenate([mesh.places, (barycentric @ mesh.places[rows])[None]]),
        values=np.concatenate([mesh.values, (barycentric @ mesh.values[rows])[None]]),
    )


def without(
    mesh: CutMesh, gone: Bool[np.ndarray, " F"]
) -> tuple[CutMesh, Int64[np.ndarray, " _"], Int64[np.ndarray, " _"]]:
    """The mesh without some faces and without what only these use, the vertices that are left, and the new
    number of each welded one, -1 where it is gone."""
    kept, faces = np.unique(mesh.faces[~gone], return_inverse=True)
    names, welded = np.unique(mesh.welded[kept], return_inverse=True)
    number = np.full(int(mesh.welded.max()) + 1, -1)
    number[names] = np.arange(len(names))
    left = CutMesh(
        faces=faces.reshape(-1, 3),
        welded=welded.reshape(-1),
        places=mesh.places[kept],
        values=mesh.values[kept],
    )
    return left, kept, number


def border(faces: Int64[np.ndarray, "F 3"], near: Int64[np.ndarray, " N"]) -> Int64[np.ndarray, " K"]:
    """The one loop of open edges among some vertices, in the faces' direction.

    Raises:
        GeometryError: there is none, or another number of them.
    """
    around = faces[np.isin(faces, near).any(axis=1)]
    edges = directed_edges(around)
    both = set(map(tuple, edges.tolist()))
    open_ones = edges[np.isin(edges, near).all(axis=1)].tolist()
    following = {a: b for a, b in open_ones if (b, a) not in both}
    loop = [min(following, default=-1)]
    while loop[-1] in following and len(loop) <= len(following):
        loop.append(following[loop[-1]])
    if len(loop) != len(following) + 1 or loop[-1] != loop[0] or len(loop) < 9:
        raise GeometryError("face: the lids' margin breaks off on this surface; leave the face as it is")
    return np.array(loop[:-1])


def double(mesh: CutMesh, chain: Int64[np.ndarray, " N"]) -> tuple[CutMesh, Int64[np.ndarray, " N"]]:
    """The mesh open along a chain of welded vertices, and the chain on the side to the right of its
    direction; the ends are not doubled."""
    welded, size = mesh.welded_faces, int(mesh.welded.max()) + 1
    along = {(int(a), int(b)) for a, b in itertools.pairwise(chain)}
    of_edge = {}
    for f, (a, b, c) in enumerate(welded.tolist()):
        of_edge[a, b] = of_edge[b, c] = of_edge[c, a] = f
    other = {int(v): size + i for i, v in enumerate(chain[1:-1])}
    faces, new_welded, source = mesh.faces.copy(), [], []
    copies: dict[int, int] = {}
    for v in other:
        nxt = next(b for a, b in along if a == v)
        for f in right_fan(welded, of_edge, v, nxt, along):
            k = welded[f].tolist().index(v)
            old = int(mesh.faces[f, k])
            if old not in copies:
                copies[old] = len(mesh.welded) + len(source)
                new_welded.append(other[v])
                source.append(old)
            faces[f, k] = copies[old]
    opened = replace(
        mesh,
        faces=faces,
        welded=np.concatenate([mesh.welded, np.array(new_welded, np.int64)]),
        places=np.concatenate([mesh.places, mesh.places[source]]),
        values=np.concatenate([mesh.values, mesh.values[source]]),
    )
    return opened, np.array([other.get(int(v), int(v)) for v in chain])


def right_fan(
    welded: Int64[np.ndarray, "F 3"],
    of_edge: dict[tuple[int, int], int],
    vertex: int,
    following: int,
    along: set[tuple[int, int]],
) -> list[int]:
    """Faces around a vertex of the chain, from its next edge clockwise to the one it came by."""
    found, spoke = [], following
    while True:
        face = of_edge[spoke, vertex]  # the face to the right of vertex -> spoke
        found.append(face)
        a, b, c = welded[face].tolist()
        spoke = {a, b, c}.difference({vertex, spoke}).pop()
        if (spoke, vertex) in along:
            return found
