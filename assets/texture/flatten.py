"""Charts laid flat, all at once: first with angles kept (least squares conformal maps, Levy et al. 2002),
then as rigidly as possible (Liu et al. 2008, "A local/global approach to mesh parameterization"); where faces
would still be turned over or pressed flat, vertices are moved one by one (`assets.texture.relax`).

A point of the plane is a complex number, so that a turn is a product. Each face has a frame of its own, with
its first edge along the real axis; the map on a face is z = a x + b conj(x), whose singular values are |a| +
|b| and |a| - |b|, the latter negative where the face is turned over.

Letters: W vertices, F faces, C charts. Metres.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Complex128, Float64, Int64
from scipy.sparse import coo_array, csc_array, csr_array, diags_array
from scipy.sparse.linalg import SuperLU, splu

ROUNDS = 12  # of turning faces and solving for vertices
THINNEST = 1e-7  # metres that a face counts as high, at least
RIGID = 1e-3  # weight that holds one vertex of each chart, and one that keeps every equation solvable
TINY = 1e-30


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
    def local(self) -> Complex128[np.ndarray, "F 3"]:
        """Corners of each face in its own frame."""
        corners = self.vertices[self.faces]
        along, across = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
        length = np.maximum(np.linalg.norm(along, axis=1), THINNEST)
        place = np.einsum("fd,fd->f", along, across) / length
        height = np.maximum(np.linalg.norm(np.cross(along, across), axis=1) / length, THINNEST)
        return np.stack([np.zeros(len(length)), length, place + 1j * height], axis=1)

    @cached_property
    def edges(self) -> Complex128[np.ndarray, "F 3"]:
        """From each corner to the next."""
        return np.roll(self.local, -1, axis=1) - self.local

    @cached_property
    def areas(self) -> Float64[np.ndarray, " F"]:
        return 0.5 * np.real(self.local[:, 1]) * np.imag(self.local[:, 2])

    @cached_property
    def cotangents(self) -> Float64[np.ndarray, "F 3"]:
        """Of the angle opposite to each edge."""
        forward, back = np.roll(self.edges, -2, axis=1), -np.roll(self.edges, -1, axis=1)
        return np.real(back * np.conj(forward)) / (2 * self.areas)[:, None]

    @cached_property
    def owner(self) -> Int64[np.ndarray, " W"]:
        """The chart of each vertex."""
        owner = np.zeros(len(self.vertices), dtype=np.int64)
        owner[self.faces.reshape(-1)] = np.repeat(self.chart, 3)
        return owner

    @cached_property
    def pins(self) -> Int64[np.ndarray, "2 C"]:
        """Two vertices of each chart that are far apart."""
        first = np.unique(self.owner, return_index=True)[1]
        second = self.farthest(first)
        return np.stack([self.farthest(second), second])

    def farthest(self, vertex: Int64[np.ndarray, " C"]) -> Int64[np.ndarray, " C"]:
        """The vertex of each chart that is farthest from the one given."""
        off = np.linalg.norm(self.vertices - self.vertices[vertex][self.owner], axis=1)
        order = np.lexsort((off, self.owner))
        return order[np.searchsorted(self.owner[order], np.arange(self.count), side="right") - 1]

    @cached_property
    def differences(self) -> csr_array:
        """[3 F, W] from values at vertices to their differences along edges."""
        row = np.arange(self.faces.size)
        start, end = self.faces.reshape(-1), np.roll(self.faces, -1, axis=1).reshape(-1)
        value = np.repeat([-1.0, 1.0], len(row))
        place = np.tile(row, 2), np.concatenate([start, end])
        return csr_array(coo_array((value, place), shape=(len(row), len(self.vertices))))


def flatten(sheets: Sheets) -> Complex128[np.ndarray, " W"]:
    """Where the vertices lie in the plane, each chart around a place of its own."""
    return as_rigid_as_possible(sheets, conformal(sheets))


def conformal(sheets: Sheets) -> Complex128[np.ndarray, " W"]:
    """Charts with angles kept in the least squares sense, each as large as it is in space."""
    x = sheets.local
    gradient = (np.roll(x, -2, axis=1) - np.roll(x, -1, axis=1)) / np.sqrt(2 * sheets.areas)[:, None]
    place = np.repeat(np.arange(len(x)), 3), sheets.faces.reshape(-1)
    rows = csr_array(coo_array((gradient.reshape(-1), place), shape=(len(x), len(sheets.vertices))))
    matrix = csr_array(rows.conj().T @ rows)
    first, second = sheets.pins
    z = np.zeros(len(sheets.vertices), dtype=np.complex128)
    z[second] = np.linalg.norm(sheets.vertices[second] - sheets.vertices[first], axis=1)
    free = np.ones(len(z), dtype=bool)
    free[sheets.pins] = False
    wanted = matrix[free]
    z[free] = factorise(wanted[:, free]).solve(-(wanted[:, ~free] @ z[~free]))
    u = along_edges(sheets, z)
    area = np.bincount(sheets.chart, 0.5 * np.imag(u[:, 0] * np.conj(u[:, 2])), minlength=sheets.count)
    true = np.bincount(sheets.chart, sheets.areas, minlength=sheets.count)
    return z * np.sqrt(true / np.maximum(np.abs(area), 1e-6 * true))[sheets.owner]


def as_rigid_as_possible(sheets: Sheets, z: Complex128[np.ndarray, " W"]) -> Complex128[np.ndarray, " W"]:
    """In turn the best rotation of each face, and the best vertices for these."""
    weight = sheets.cotangents.reshape(-1)
    back = csr_array(sheets.differences.T)
    held = np.full(len(z), RIGID * RIGID)
    held[sheets.pins[0]] = RIGID
    solver = factorise(back @ diags_array(weight) @ sheets.differences + diags_array(held))
    for _ in range(ROUNDS):
        turn = (sheets.cotangents * along_edges(sheets, z) * np.conj(sheets.edges)).sum(axis=1)
        turn = turn / np.maximum(np.abs(turn), TINY)
        wanted = back @ (weight * (turn[:, None] * sheets.edges).reshape(-1))
        z = solver.solve(np.stack([wanted.real, wanted.imag], axis=1)) @ np.array([1, 1j])
    return z


def factorise(matrix: csr_array) -> SuperLU:
    """A solver for a symmetric or Hermitian positive definite matrix."""
    options = {"SymmetricMode": True, "DiagPivotThresh": 0.0}
    return splu(csc_array(matrix), permc_spec="MMD_AT_PLUS_A", options=options)


def along_edges(sheets: Sheets, z: Complex128[np.ndarray, " W"]) -> Complex128[np.ndarray, "F 3"]:
    """The faces' edges in the plane."""
    return (sheets.differences @ z).reshape(-1, 3)


def singular_values(
    sheets: Sheets, z: Complex128[np.ndarray, " W"]
) -> tuple[Float64[np.ndarray, " F"], Float64[np.ndarray, " F"]]:
    """Of the map from each face to the plane: the larger, and the smaller, negative where the face is turned
    over."""
    (e, f), (u, v) = sheets.edges[:, :2].T, along_edges(sheets, z)[:, :2].T
    area = 2j * (e * np.conj(f)).imag
    a, b = (u * np.conj(f) - v * np.conj(e)) / area, (e * v - f * u) / area
    return np.abs(a) + np.abs(b), np.abs(a) - np.abs(b)
