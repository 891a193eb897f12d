"""Crossed cells of two sizes to a closed surface: a vertex for each sheet of the surface in each cell, and a
face for each crossed edge, between the cells around it.

This is dual contouring (Ju et al. 2002) on an octree's leaves, with a vertex for each sheet (Nielson 2004,
"Dual Marching Cubes") at the mean of the sheet's crossings with the cell's edges. The surface closes whatever
the field does. An edge's face takes one vertex from each cell around it. And the cells on both sides of a
square see the same signs and join its crossings in the same pairs, so each edge of a face has one opposite.

A large cell must not have edges that the surface crosses twice, once in each half: `adaptive` halves those.

    cells by number and by place -> a number for each sheet                (sheets)
    an edge's cells -> the vertices in them -> a quad -> two triangles     (here)

Letters: S small cells, L large cells, Q faces of four corners, F triangles, V vertices. Corners, edges and
sides by number as in `assets.isosurface.cell`, coordinates as in `assets.isosurface.corner_lookup`. The low
corner of a large cell is even. The quadrants around an edge, from 0 to 3, go around it: at low and low, high
and low, high and high, low and high coordinates of the two axes after its own.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int64

from assets.isosurface.cell import EDGES, TABLES
from assets.isosurface.corner_lookup import corner_lookup, gradient_of, number_at, offset, slot_of
from assets.isosurface.grid import CornerValues
from assets.isosurface.sheets import HALVED, LARGE_EDGES, Cells, Sheets, sheets_of_large, sheets_of_small
from avatargen.compiled import compiled, inner
from avatargen.mesh.morton import morton_order


@dataclass(frozen=True, kw_only=True)
class Leaves:
    """The cells that the surface crosses: small ones of one fine cell, large ones of two along a side."""

    small: Int64[np.ndarray, "S 3"]  # low corners
    large: Int64[np.ndarray, "L 3"]
    halved: Int64[np.ndarray, "H 3"]  # large cells whose place small ones have taken


@dataclass(frozen=True, kw_only=True)
class Contour:
    """Vertices, the field's gradient around each, and the faces between them, counter-clockwise from
    outside."""

    vertices: Float64[np.ndarray, "V 3"]  # fine cells, from the grid's low corner
    gradients: Float64[np.ndarray, "V 3"]  # metres a fine cell, in the vertex's cell
    faces: Int64[np.ndarray, "F 3"]


def contour(values: CornerValues, leaves: Leaves) -> Contour:
    """The closed surface through these cells, at whose corners the field has been asked."""
    small, large = (cells[morton_order(cells.astype(np.float32))] for cells in (leaves.small, leaves.large))
    small_at = np.zeros(len(values.values), dtype=np.int32)
    large_at = small_at.copy()
    small_at[values.slots(small)] = np.arange(1, len(small) + 1)
    large_at[values.slots(large)] = np.arange(1, len(large) + 1)
    large_at[values.slots(leaves.halved)] = HALVED
    cells, lookup = Cells(small, large, small_at, large_at), corner_lookup(values)
    case, first = sheets_of_small(small, TABLES.sheet_count, lookup)
    of_large, count = sheets_of_large(cells, case, first[-1], lookup, TABLES)
    sheets = Sheets(case, first, TABLES.sheet_of_edge, of_large)
    vertices, gradients, quads = cross_edges(cells, sheets, count, lookup)
    return Contour(vertices=vertices, gradients=gradients, faces=triangulate(vertices, quads))


def triangulate(
    vertices: Float64[np.ndarray, "V 3"], quads: Int64[np.ndarray, "Q 4"]
) -> Int64[np.ndarray, "F 3"]:
    """Triangles of the quads, along their shorter diagonals. A quad may name one vertex twice in a row, where
    a large cell lies on two sides of its edge: that is one triangle."""
    twice = quads == np.roll(quads, -1, axis=1)
    start = np.where(twice.any(axis=1), np.argmax(twice, axis=1), 0)
    a, b, c, d = np.take_along_axis(quads, (start[:, None] + np.arange(4)) % 4, axis=1).T
    lengths = [((vertices[p] - vertices[q]) ** 2).sum(axis=1) for p, q in ((a, c), (b, d))]
    single, first = a == b, lengths[0] <= lengths[1]
    parts = ((single, (a, c, d)), (~single & first, (a, b, c)), (~single & first, (a, c, d)))
    parts += ((~single & ~first, (a, b, d)), (~single & ~first, (b, c, d)))
    return np.concatenate([np.stack([corner[which] for corner in corners], 1) for which, corners in parts])


@inner(forceinline=True)
def edge_in_large(axis, along, i, j):
    """A large cell's number of the edge along an axis that starts `along` fine cells from its low corner on
    that axis, i and j on the two after it; the edge lies on the cell's surface."""
    if i == 1:
        return EDGES + 4 * (2 * ((axis + 2) % 3) + j // 2) + along  # the first axis of that side
    if j == 1:
        return EDGES + 4 * (2 * ((axis + 1) % 3) + i // 2) + 2 + along
    return 4 * axis + i // 2 + 2 * (j // 2)


@inner(forceinline=True)
def cell_around(x, y, z, axis, quadrant, size, cells, lookup):
    """The cell in a quadrant around an edge of this size that starts here: the number of a small one, minus
    the number of a large one, or 0 where small cells have taken a large one's place."""
    i, j = size * (quadrant == 0 or quadrant == 3), size * (quadrant < 2)
    x, y, z = offset(x, y, z, axis, 0, -i, -j)
    if size == 1:
        small = number_at(lookup, cells.small_at, x, y, z)
        if small > 0:
            return small
    return -max(0, number_at(lookup, cells.large_at, x & ~1, y & ~1, z & ~1))


@inner(forceinline=True)
def cells_around(around, x, y, z, axis, size, own, cells, lookup):
    """Fill in the cells around an edge that starts here. False if another cell makes this edge's face: that
    is done by the first cell of the edge's own size around it, if no smaller one is there."""
    mine = False
    for turn in range(4):
        quadrant = (turn + 2) & 3  # an edge at its cell's low corner is soon known to be the cell's own
        number = cell_around(x, y, z, axis, quadrant, size, cells, lookup)
        mine |= number == own
        if number == 0 or (not mine and (number > 0 or size == 2)):
            return False
        around[quadrant] = number
    return True


@inner(forceinline=True)
def vertex_in(x, y, z, axis, quadrant, number, cells, sheets):
    """The vertex of the sheet that crosses an edge starting here, in the cell of this number and quadrant."""
    if number > 0:
        edge = 4 * axis + (quadrant == 0 or quadrant == 3) + 2 * (quadrant < 2)
        return sheets.first[number - 1] + sheets.sheet_of_edge[sheets.case[number - 1], edge]
    cell = -number - 1
    dx, dy, dz = x - cells.large[cell, 0], y - cells.large[cell, 1], z - cells.large[cell, 2]
    if axis == 0:
        return sheets.of_large[cell, edge_in_large(0, dx, dy, dz)]
    if axis == 1:
        return sheets.of_large[cell, edge_in_large(1, dy, dz, dx)]
    return sheets.of_large[cell, edge_in_large(2, dz, dx, dy)]


@inner(forceinline=True)
def set_gradient(gradients, cell, low, size, sheets, lookup):
    """Fill in the gradient at a cell's vertices."""
    x, y, z = gradient_of(lookup, low[0], low[1], low[2], size)
    for edge in range(EDGES if size == 1 else LARGE_EDGES):
        one = sheets.sheet_of_edge[sheets.case[cell], edge] if size == 1 else sheets.of_large[cell, edge]
        if one >= 0:
            one += sheets.first[cell] if size == 1 else 0
            gradients[one, 0], gradients[one, 1], gradients[one, 2] = x, y, z


@inner(forceinline=True)
def add_crossing(vertices, crossings, ring, x, y, z, axis, size, lookup):
    """Add where the surface crosses an edge to the sums of the vertices around it; whether the edge leads
    outward."""
    steps = size * (axis == 0), size * (axis == 1), size * (axis == 2)
    start = lookup.values[slot_of(lookup, x, y, z)]
    end = lookup.values[slot_of(lookup, x + steps[0], y + steps[1], z + steps[2])]
    share = start / (start - end)
    for quadrant in range(4):
        one = ring[quadrant]
        if one != ring[quadrant - 1]:
            crossings[one] += 1
            vertices[one, 0] += x + share * steps[0]
            vertices[one, 1] += y + share * steps[1]
            vertices[one, 2] += z + share * steps[2]
    return start < 0


@compiled
def cross_edges(cells, sheets, count, lookup):
    """[V 3] `count` vertices at the mean of their crossings (fine cells), [V 3] the field's gradients there
    (metres a fine cell) and [Q 4] the quads of the crossed edges."""
    small, large = cells.small, cells.large
    vertices, crossings, gradients = np.zeros((count, 3)), np.zeros(count), np.zeros((count, 3))
    quads = np.empty((4 * (len(small) + len(large)), 4), np.int64)
    found = 0
    around, ring = np.empty(4, np.int64), np.empty(4, np.int64)  # cells and vertices by quadrant
    for number in range(len(small) + len(large)):
        size = 1 if number < len(small) else 2
        cell = number if size == 1 else number - len(small)
        low = small[cell] if size == 1 else large[cell]
        own = cell + 1 if size == 1 else -cell - 1
        set_gradient(gradients, cell, low, size, sheets, lookup)
        for edge in range(EDGES):
            if size == 1 and sheets.sheet_of_edge[sheets.case[cell], edge] < 0:
                continue
            if size == 2 and sheets.of_large[cell, edge] < 0:
                continue
            axis = edge // 4
            x, y, z = offset(low[0], low[1], low[2], axis, 0, size * (edge & 1), size * (edge >> 1 & 1))
            if not cells_around(around, x, y, z, axis, size, own, cells, lookup):
                continue
            for quadrant in range(4):
                ring[quadrant] = vertex_in(x, y, z, axis, quadrant, around[quadrant], cells, sheets)
            outward = add_crossing(vertices, crossings, ring, x, y, z, axis, size, lookup)
            for quadrant in range(4):
                quads[found, quadrant if outward else 3 - quadrant] = ring[quadrant]
            found += 1
    for one in range(count):
        for d in range(3):
            vertices[one, d] /= max(crossings[one], 1.0)
    return vertices, gradients, quads[:found]
