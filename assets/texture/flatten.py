"""Charts laid flat, all at once: first with angles kept (least squares conformal maps, Levy et al. 2002),
then as rigidly as possible (Liu et al. 2008, "A local/global approach to mesh parameterization"); where faces
would still be turned over or pressed flat, vertices are moved one by one (`assets.texture.relax`).

A point of the plane is a complex number, so that a turn is a product. Each face has a frame of its own, with
its first edge along the real axis; the map on a face is z = a x + b conj(x), whose singular values are |a| +
|b| and |a| - |b|, the latter negative where the face is turned over.

Letters: W vertices, F faces, C charts, N entries of a sparse matrix. Metres.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Complex128, Float64, Int64
from scipy.sparse import csc_array
from scipy.sparse.linalg import SuperLU, splu

from avatargen.compiled import compiled, inner

ROUNDS = 12  # of turning faces and solving for vertices
RIGID = 1e-3  # weight that holds one vertex of each chart, and one that keeps every equation solvable
PINNED = 1e3  # weight of two vertices of each chart while angles are kept


@dataclass(frozen=True, kw_only=True)
class Sheets:
    """Disks in space that are to lie flat."""

    vertices: Float64[np.ndarray, "W 3"]
    faces: Int64[np.ndarray, "F 3"]
    chart: Int64[np.ndarray, " F"]  # 0 to C - 1

    @cached_property
    def count(self) -> int:
        return int(self.chart.max()) + 1

    @cached_property
    def local(self) -> Float64[np.ndarray, "F 3"]:
        """Each face in its own frame: how long its first edge is, and along and across that where its third
        corner lies."""
        return local_frames(self.vertices, self.faces)

    @cached_property
    def areas(self) -> Float64[np.ndarray, " F"]:
        return 0.5 * self.local[:, 0] * self.local[:, 2]

    @cached_property
    def owner(self) -> Int64[np.ndarray, " W"]:
        """The chart of each vertex."""
        owner = np.zeros(len(self.vertices), dtype=np.int64)
        owner[self.faces.reshape(-1)] = np.repeat(self.chart, 3)
        return owner

    @cached_property
    def pins(self) -> Int64[np.ndarray, "2 C"]:
        """Two vertices of each chart that are far apart."""
        first = np.zeros(self.count, dtype=np.int64)
        first[self.owner[::-1]] = np.arange(len(self.owner))[::-1]
        second = self.farthest(first)
        return np.stack([self.farthest(second), second])

    def farthest(self, vertex: Int64[np.ndarray, " C"]) -> Int64[np.ndarray, " C"]:
        """The vertex of each chart that is farthest from the one given."""
        off = np.linalg.norm(self.vertices - self.vertices[vertex][self.owner], axis=1)
        order = np.lexsort((off, self.owner))
        return order[np.searchsorted(self.owner[order], np.arange(self.count), side="right") - 1]

    @cached_property
    def pattern(self) -> tuple[Int64[np.ndarray, " _"], Int64[np.ndarray, " N"], Int64[np.ndarray, "F 3 3"]]:
        """Where a matrix of the vertices and their neighbours has entries, column by column: the first of
        each column, their rows, and the entry of each face's pair of corners, row before column."""
        return entries(self.faces, len(self.vertices))


def flatten(sheets: Sheets) -> Complex128[np.ndarray, " W"]:
    """Where the vertices lie in the plane, each chart around a place of its own."""
    return as_rigid_as_possible(sheets, conformal(sheets))


def conformal(sheets: Sheets) -> Complex128[np.ndarray, " W"]:
    """Charts with angles kept in the least squares sense, each as large as it is in space."""
    first, slots = sheets.pattern[0], sheets.pattern[2]
    values = np.zeros(first[-1], dtype=np.complex128)
    add_conformal(sheets.local, slots, values)
    start, end = sheets.pins
    wanted = np.zeros(len(sheets.vertices), dtype=np.complex128)
    wanted[end] = PINNED * np.linalg.norm(sheets.vertices[end] - sheets.vertices[start], axis=1)
    z = factorise(sheets, values, np.concatenate([start, end]), PINNED).solve(wanted)
    area = np.bincount(sheets.chart, areas_in_plane(sheets.faces, z), minlength=sheets.count)
    true = np.bincount(sheets.chart, sheets.areas, minlength=sheets.count)
    return z * np.sqrt(true / np.maximum(np.abs(area), 1e-6 * true))[sheets.owner]


def as_rigid_as_possible(sheets: Sheets, z: Complex128[np.ndarray, " W"]) -> Complex128[np.ndarray, " W"]:
    """In turn the best rotation of each face, and the best vertices for these."""
    values = np.zeros(sheets.pattern[0][-1])
    weights = cotangents(sheets.local)
    add_stiffness(weights, sheets.pattern[2], values)
    solver = factorise(sheets, values, sheets.pins[0], RIGID)
    for _ in range(ROUNDS):
        wanted = np.zeros((len(z), 2), order="F")
        add_turned(sheets.faces, sheets.local, weights, z, wanted)
        z = solver.solve(wanted) @ np.array([1, 1j])
    return z


def factorise(sheets: Sheets, values: np.ndarray, held: Int64[np.ndarray, " _"], weight: float) -> SuperLU:
    """A solver for a symmetric or Hermitian positive definite matrix of the sheets' pattern, with so much
    added where vertices are held, and nearly nothing elsewhere."""
    first, rows, _ = sheets.pattern
    values = values.copy()
    values[first[:-1]] += RIGID * RIGID  # each column's first entry is that of its own row
    values[first[held]] += weight
    size = len(first) - 1
    matrix = csc_array((values, rows.astype(np.int32), first.astype(np.int32)), shape=(size, size))
    matrix.sort_indices()
    matrix.has_canonical_format = True
    options = {"SymmetricMode": True, "DiagPivotThresh": 0.0}
    return splu(matrix, permc_spec="MMD_AT_PLUS_A", options=options)


def singular_values(
    sheets: Sheets, z: Complex128[np.ndarray, " W"]
) -> tuple[Float64[np.ndarray, " F"], Float64[np.ndarray, " F"]]:
    """Of the map from each face to the plane: the larger, and the smaller, negative where the face is turned
    over."""
    large, small = np.empty(len(sheets.faces)), np.empty(len(sheets.faces))
    stretches(sheets.faces, sheets.local, z, large, small)
    return large, small


@compiled
def local_frames(vertices, faces):
    """[F 3] `Sheets.local` of faces [F 3] on vertices [W 3]; no number is less than a tenth of a micrometre
    where it is divided by."""
    local = np.empty((len(faces), 3))
    for f in range(len(faces)):
        a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
        ux, uy = vertices[b, 0] - vertices[a, 0], vertices[b, 1] - vertices[a, 1]
        vx, vy = vertices[c, 0] - vertices[a, 0], vertices[c, 1] - vertices[a, 1]
        uz, vz = vertices[b, 2] - vertices[a, 2], vertices[c, 2] - vertices[a, 2]
        nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
        length = max(np.sqrt(ux * ux + uy * uy + uz * uz), 1e-7)
        local[f, 0], local[f, 1] = length, (ux * vx + uy * vy + uz * vz) / length
        local[f, 2] = max(np.sqrt(nx * nx + ny * ny + nz * nz) / length, 1e-7)
    return local


@inner
def edges_of(local, f):
    """The edges of a face in its own frame, from each corner to the next."""
    tip = complex(local[f, 1], local[f, 2])
    return complex(local[f, 0], 0.0), tip - local[f, 0], -tip


@compiled
def entries(faces, count):
    """As `Sheets.pattern`, of faces [F 3] on so many vertices; each column's own row comes first."""
    corner, place = faces.ravel(), np.zeros(count + 1, np.int64)
    for vertex in corner:
        place[vertex + 1] += 1
    for v in range(count):
        place[v + 1] += place[v]
    ring, filled = np.empty(len(corner), np.int64), place[:-1].copy()
    for k in range(len(corner)):
        ring[filled[corner[k]]] = k
        filled[corner[k]] += 1
    first, rows = np.zeros(count + 1, np.int64), np.empty(3 * len(corner) + count, np.int64)
    slots, at, size = np.empty((len(faces), 3, 3), np.int64), np.full(count, -1, np.int64), 0
    for v in range(count):
        at[v], rows[size] = size, v
        begin, size = size, size + 1
        for k in range(place[v], place[v + 1]):
            face, column = ring[k] // 3, ring[k] % 3
            for i in range(3):
                other = faces[face, i]
                if at[other] < begin:
                    at[other], rows[size] = size, other
                    size += 1
                slots[face, i, column] = at[other]
        first[v + 1] = size
    return first, rows[:size].copy(), slots


@compiled
def add_conformal(local, slots, values):
    """Add the conformal energy of faces with frames `local` [F 3] to the entries `values` [N] of a matrix
    that is Hermitian; `slots` [F 3 3] as `entries` returns them."""
    for f in range(len(local)):
        e, g, h = edges_of(local, f)
        gradients = (g, h, e)  # of each corner: the edge opposite to it
        for i in range(3):
            for j in range(3):
                product = np.conj(gradients[i]) * gradients[j]
                values[slots[f, i, j]] += product / (local[f, 0] * local[f, 2])


@compiled
def cotangents(local):
    """[F 3] of the angle opposite to each edge of faces with frames [F 3]."""
    weights = np.empty((len(local), 3))
    for f in range(len(local)):
        e, g, h = edges_of(local, f)
        double = local[f, 0] * local[f, 2]
        weights[f, 0] = -(g * np.conj(h)).real / double
        weights[f, 1] = -(h * np.conj(e)).real / double
        weights[f, 2] = -(e * np.conj(g)).real / double
    return weights


@compiled
def add_stiffness(weights, slots, values):
    """Add the weighted squares of the edges' differences to the entries `values` [N] of a matrix; weights
    [F 3] of the faces' edges, `slots` as `entries` returns them."""
    for f in range(len(weights)):
        for i in range(3):
            j = (i + 1) % 3
            values[slots[f, i, i]] += weights[f, i]
            values[slots[f, j, j]] += weights[f, i]
            values[slots[f, i, j]] -= weights[f, i]
            values[slots[f, j, i]] -= weights[f, i]


@compiled
def add_turned(faces, local, weights, z, wanted):
    """Add to `wanted` [W 2] what is to come out of the stiffness for vertices at which each face has its own
    shape, turned as is best for the vertices at `z` [W]."""
    for f in range(len(faces)):
        own, turn = edges_of(local, f), 0j
        for i in range(3):
            turn += weights[f, i] * (z[faces[f, (i + 1) % 3]] - z[faces[f, i]]) * np.conj(own[i])
        turn /= max(abs(turn), 1e-30)
        for i in range(3):
            edge = weights[f, i] * turn * own[i]
            start, end = faces[f, i], faces[f, (i + 1) % 3]
            wanted[start, 0], wanted[start, 1] = wanted[start, 0] - edge.real, wanted[start, 1] - edge.imag
            wanted[end, 0], wanted[end, 1] = wanted[end, 0] + edge.real, wanted[end, 1] + edge.imag


@compiled
def areas_in_plane(faces, z):
    """[F] of faces [F 3] whose vertices are at `z` [W], negative where they are turned over."""
    areas = np.empty(len(faces))
    for f in range(len(faces)):
        u, v = z[faces[f, 1]] - z[faces[f, 0]], z[faces[f, 2]] - z[faces[f, 0]]
        areas[f] = 0.5 * (u.real * v.imag - u.imag * v.real)
    return areas


@compiled
def stretches(faces, local, z, large, small):
    """Write the singular values of the maps from faces with frames `local` [F 3] to the plane into `large`
    and `small` [F]."""
    for f in range(len(faces)):
        e, g, _ = edges_of(local, f)
        u, v = z[faces[f, 1]] - z[faces[f, 0]], z[faces[f, 2]] - z[faces[f, 1]]
        area = 2j * (e * np.conj(g)).imag
        a, b = (u * np.conj(g) - v * np.conj(e)) / area, (e * v - g * u) / area
        large[f], small[f] = abs(a) + abs(b), abs(a) - abs(b)
