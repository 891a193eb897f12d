"""Crossed cells of two sizes to a closed surface: a vertex in each cell for each sheet of the surface that
passes through it, and a face for each crossed edge, between the cells around it.

Dual contouring (Ju et al. 2002) on an octree's leaves, with a vertex for each sheet (Nielson 2004, "Dual
Marching Cubes"), at the mean of the sheet's crossings with the cell's edges. The surface closes whatever the
field does: an edge's face takes one vertex from each cell around it, and the cells on both sides of a square
see the same signs and join its crossings in the same pairs, so that each edge of a face has one opposite.

The edges of a small cell are crossed or not. A large one has no more crossings than it has edges, too, unless
the cell beyond a side is halved: then the edges that cross in the middle of that side count as well. It must
not have edges that are crossed twice, once in each half (`adaptive` halves those).

Letters: S small cells, L large cells, Q faces, V vertices. Coordinates as in `grid`; the low corner of
a large cell is even. Corner x + 2 y + 4 z of a cell is at x, y, z. Edge 4 a + i + 2 j lies along axis a, at i
and j of the next two axes; side 2 a + d is at d of axis a. Edges within a halved side have numbers from 12,
four a side: the low and the high half of the middle line along each of the next two axes.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int64

from assets.isosurface.grid import CornerValues
from avatargen.compiled import compiled, inner
from avatargen.mesh.morton import morton_order

EDGES, WITH_HALVED_SIDES = 12, 36
HALVED = -1  # in the place of a large cell's number


@dataclass(frozen=True, kw_only=True)
class Leaves:
    """The cells that the surface crosses: small ones of one fine cell, large ones of two along a side."""

    small: Int64[np.ndarray, "S 3"]
    large: Int64[np.ndarray, "L 3"]
    halved: Int64[np.ndarray, "H 3"]  # large cells that gave way to small ones


@dataclass(frozen=True, kw_only=True)
class Contour:
    """Vertices, the field's change around each, and the faces between them, facing outward."""

    vertices: Float64[np.ndarray, "V 3"]  # grid coordinates
    slopes: Float64[np.ndarray, "V 3"]  # of the field in the vertex's cell, a fine cell along each axis
    faces: Int64[np.ndarray, "F 3"]


def contour(values: CornerValues, leaves: Leaves) -> Contour:
    """The closed surface through these cells."""
    small, large = (cells[morton_order(cells.astype(np.float32))] for cells in (leaves.small, leaves.large))
    small_at = np.zeros(len(values.values), dtype=np.int32)  # by slot of the low corner, from 1; 0 for none
    large_at = small_at.copy()
    small_at[values.slots(small)] = np.arange(1, len(small) + 1)
    large_at[values.slots(large)] = np.arange(1, len(large) + 1)
    large_at[values.slots(leaves.halved)] = HALVED
    field = (*values.shares, values.opened, values.values)
    case, first = sheets_of_small(small, field, SHEETS)
    vertex, count = sheets_of_large(large, case, first[-1], small_at, large_at, field, RINGS, SIDE_EDGES)
    tables = case, first, SHEET_OF_EDGE
    vertices, slopes, quads = cross_edges(small, large, tables, vertex, count, small_at, large_at, field)
    return Contour(vertices=vertices, slopes=slopes, faces=divide(vertices, quads))


def divide(vertices: Float64[np.ndarray, "V 3"], quads: Int64[np.ndarray, "Q 4"]) -> Int64[np.ndarray, "F 3"]:
    """Triangles of the faces, along their shorter diagonals; a face may name one vertex twice in a row."""
    twice = quads == np.roll(quads, -1, axis=1)
    start = np.where(twice.any(axis=1), np.argmax(twice, axis=1), 0)
    a, b, c, d = np.take_along_axis(quads, (start[:, None] + np.arange(4)) % 4, axis=1).T
    lengths = [((vertices[p] - vertices[q]) ** 2).sum(axis=1) for p, q in ((a, c), (b, d))]
    single, first = a == b, lengths[0] <= lengths[1]
    parts = ((single, (a, c, d)), (~single & first, (a, b, c)), (~single & first, (a, c, d)))
    parts += ((~single & ~first, (a, b, d)), (~single & ~first, (b, c, d)))
    return np.concatenate([np.stack([corner[which] for corner in corners], 1) for which, corners in parts])


def ring_of(side: int) -> list[int]:
    """The corners around a side."""
    axis, across = divmod(side, 2)
    i, j = 1 << (axis + 1) % 3, 1 << (axis + 2) % 3
    return [(across << axis) + corner for corner in (0, i, i + j, j)]


def edge_between(a: int, b: int) -> int:
    """The edge between two corners."""
    axis = (a ^ b).bit_length() - 1
    return 4 * axis + (a >> (axis + 1) % 3 & 1) + 2 * (a >> (axis + 2) % 3 & 1)


def number_sheets() -> tuple[np.ndarray, np.ndarray]:
    """[256] how many sheets pass through a cell, by which of its corners are inside, one bit each; [256 12]
    which of them crosses each edge, -1 for none."""
    count, sheet = np.zeros(256, dtype=np.int8), np.full((256, EDGES), -1, dtype=np.int8)
    for case in range(256):
        joined = np.arange(EDGES)
        for side in range(6):
            for corner in range(4):
                if enters.py_func(case, RINGS, side, corner):
                    a = SIDE_EDGES[side, corner - 1]
                    b = SIDE_EDGES[side, way_out.py_func(case, RINGS, side, corner)]
                    joined[joined == joined[a]] = joined[b]
        crossed = [edge for side in range(6) for edge in SIDE_EDGES[side][differ(case, RINGS[side])]]
        for edge in sorted(set(crossed)):
            others = [other for other in range(edge) if other in crossed and joined[other] == joined[edge]]
            sheet[case, edge] = sheet[case, others[0]] if others else count[case]
            count[case] += not others
    return count, sheet


def differ(case: int, ring: np.ndarray) -> np.ndarray:
    """Whether each corner of a ring is on another side of the surface than the next."""
    inside = case >> ring & 1
    return inside != np.roll(inside, -1)


@inner(forceinline=True)
def enters(case, rings, side, corner):
    """Whether a ring of corners comes inside at this one."""
    return case >> rings[side, corner] & 1 and not case >> rings[side, corner - 1] & 1


@inner(forceinline=True)
def way_out(case, rings, side, corner):
    """The ring's edge by which it goes outside again."""
    while case >> rings[side, (corner + 1) % 4] & 1:
        corner += 1
    return corner % 4


@inner(forceinline=True)
def beside(x, y, z, axis, along, i, j):
    """The place so far from this one along an axis, and along the next two."""
    if axis == 0:
        return x + along, y + i, z + j
    if axis == 1:
        return x + j, y + along, z + i
    return x + i, y + j, z + along


@inner(forceinline=True)
def slot_of(x, y, z, field):
    """Where the value of a corner lies, -1 where none does."""
    xs, ys, zs, opened, _ = field
    if min(x, y, z) < 0 or x >= len(xs) or y >= len(ys) or z >= len(zs):
        return -1
    code = xs[x] + ys[y] + zs[z]
    brick = opened[code >> 6]
    return -1 if brick == 0 else (brick - 1 << 6) + (code & 63)


@inner(forceinline=True)
def number_at(numbers, x, y, z, field):
    """The number of the cell with this low corner, 0 for none."""
    slot = slot_of(x, y, z, field)
    return 0 if slot < 0 else numbers[slot]


@inner(forceinline=True)
def case_of(x, y, z, size, field):
    """Which corners of a cell are inside, one bit each."""
    case = 0
    for corner in range(8):
        slot = slot_of(x + size * (corner & 1), y + size * (corner >> 1 & 1), z + size * (corner >> 2), field)
        case |= (field[4][slot] < 0) << corner
    return case


@compiled
def sheets_of_small(small, field, sheets):
    """[S] the case of each small cell, and [S + 1] its first vertex."""
    case, first = np.empty(len(small), np.int64), np.zeros(len(small) + 1, np.int64)
    for cell in range(len(small)):
        x, y, z = small[cell]
        case[cell] = case_of(x, y, z, 1, field)
        first[cell + 1] = first[cell] + sheets[case[cell]]
    return case, first


@inner(forceinline=True)
def root(joined, edge):
    """The one that stands for all edges joined with this one."""
    while joined[edge] != edge:
        edge = joined[edge]
    return edge


@inner(forceinline=True)
def join(joined, a, b):
    """Let two crossed edges be of one sheet."""
    if joined[a] < 0:
        joined[a] = a
    if joined[b] < 0:
        joined[b] = b
    joined[root(joined, a)] = root(joined, b)


@inner(forceinline=True)
def edge_of_quarter(side, i, j, k):
    """The large cell's number of edge k of the ring around a quarter, at i, j, of one of its sides."""
    axis, across = side // 2, side % 2
    if k % 2 == 0:  # along the first axis of the side
        at = j + k // 2
        along = (axis + 1) % 3
        return 12 + 4 * side + i if at == 1 else 4 * along + at // 2 + 2 * across
    at = i + (k == 1)
    along = (axis + 2) % 3
    return 12 + 4 * side + 2 + j if at == 1 else 4 * along + across + 2 * (at // 2)


@inner
def join_side(joined, case, side, rings, side_edges):
    """Join the edges of one side of a large cell where the surface crosses it."""
    for corner in range(4):
        if enters(case, rings, side, corner):
            a, b = side_edges[side, corner - 1], way_out(case, rings, side, corner)
            join(joined, a, side_edges[side, b])


@inner
def join_halved_side(joined, x, y, z, side, case_of_small, small_at, field, rings):
    """The same for a side beyond which are small cells, quarter by quarter; the large cell's low corner is
    given."""
    axis, across = side // 2, side % 2
    facing = 2 * axis + 1 - across  # the small cells' side
    step = 2 if across else -1
    for quarter in range(4):
        i, j = quarter & 1, quarter >> 1
        low_x, low_y, low_z = beside(x, y, z, axis, step, i, j)
        small = number_at(small_at, low_x, low_y, low_z, field)
        if small == 0:
            continue
        case = case_of_small[small - 1]
        for corner in range(4):
            if enters(case, rings, facing, corner):
                a = edge_of_quarter(side, i, j, (corner - 1) % 4)
                b = edge_of_quarter(side, i, j, way_out(case, rings, facing, corner))
                join(joined, a, b)


@compiled
def sheets_of_large(large, case_of_small, count, small_at, large_at, field, rings, side_edges):
    """[L 36] the vertex of each crossed edge of the large cells, -1 for none; the number of all vertices."""
    vertex = np.full((len(large), WITH_HALVED_SIDES), -1, np.int64)
    joined = np.empty(WITH_HALVED_SIDES, np.int64)
    for cell in range(len(large)):
        x, y, z = large[cell]
        case = case_of(x, y, z, 2, field)
        joined[:] = -1
        for side in range(6):
            low_x, low_y, low_z = beside(x, y, z, side // 2, 4 * (side % 2) - 2, 0, 0)
            if number_at(large_at, low_x, low_y, low_z, field) == HALVED:
                join_halved_side(joined, x, y, z, side, case_of_small, small_at, field, rings)
            else:
                join_side(joined, case, side, rings, side_edges)
        for edge in range(WITH_HALVED_SIDES):
            if joined[edge] >= 0:
                first = root(joined, edge)
                if vertex[cell, first] < 0:
                    vertex[cell, first] = count
                    count += 1
                vertex[cell, edge] = vertex[cell, first]
    return vertex, count


@inner(forceinline=True)
def edge_in_large(axis, along, i, j):
    """The large cell's number of an edge that lies i and j fine cells from its low corner along the next two
    axes and `along` from it along its own, on its surface."""
    if i == 1:
        return 12 + 4 * (2 * ((axis + 2) % 3) + j // 2) + along  # the first axis of that side
    if j == 1:
        return 12 + 4 * (2 * ((axis + 1) % 3) + i // 2) + 2 + along
    return 4 * axis + i // 2 + 2 * (j // 2)


@inner(forceinline=True)
def cell_around(x, y, z, axis, quadrant, size, small_at, large_at, field):
    """In one of the quadrants around an edge that starts here, in turn from before it along both other axes:
    the number of its small cell, or, less than zero, of its large one; 0 for one that has given way."""
    i, j = size * (quadrant == 0 or quadrant == 3), size * (quadrant < 2)
    x, y, z = beside(x, y, z, axis, 0, -i, -j)
    if size == 1:
        small = number_at(small_at, x, y, z, field)
        if small > 0:
            return small
    return -max(0, number_at(large_at, x & ~1, y & ~1, z & ~1, field))


@inner(forceinline=True)
def vertex_at(x, y, z, axis, quadrant, number, small_tables, large, vertex):
    """The vertex in the cell with this number, in a quadrant around a crossed edge that starts here."""
    if number > 0:
        case, first, sheet_of_edge = small_tables
        edge = 4 * axis + (quadrant == 0 or quadrant == 3) + 2 * (quadrant < 2)
        return first[number - 1] + sheet_of_edge[case[number - 1], edge]
    cell = -number - 1
    dx, dy, dz = x - large[cell, 0], y - large[cell, 1], z - large[cell, 2]
    if axis == 0:
        return vertex[cell, edge_in_large(0, dx, dy, dz)]
    if axis == 1:
        return vertex[cell, edge_in_large(1, dy, dz, dx)]
    return vertex[cell, edge_in_large(2, dz, dx, dy)]


@inner(forceinline=True)
def look_around(around, x, y, z, axis, size, own, small_at, large_at, field):
    """Fill in the cells around an edge that starts here; whether its face is found from the cell with our
    number, which is the first one of its size around the edge, and no smaller one is there."""
    mine = False
    for turn in range(4):
        quadrant = (turn + 2) & 3  # an edge at its cell's low corner is soon known to be the cell's own
        number = cell_around(x, y, z, axis, quadrant, size, small_at, large_at, field)
        mine |= number == own
        if number == 0 or (not mine and (number > 0 or size == 2)):
            return False
        around[quadrant] = number
    return True


@inner(forceinline=True)
def add_slope(slopes, cell, low, size, small_tables, vertex, field):
    """Note a cell's slope at its vertices."""
    case, first, sheet_of_edge = small_tables
    x, y, z = slope_of(low[0], low[1], low[2], size, field)
    for edge in range(EDGES if size == 1 else WITH_HALVED_SIDES):
        one = sheet_of_edge[case[cell], edge] if size == 1 else vertex[cell, edge]
        if one >= 0:
            one += first[cell] if size == 1 else 0
            slopes[one, 0], slopes[one, 1], slopes[one, 2] = x, y, z


@inner(forceinline=True)
def add_crossing(vertices, crossings, ring, x, y, z, axis, size, field):
    """Add a crossed edge's crossing to the vertices around it; whether it leads outward."""
    steps = size * (axis == 0), size * (axis == 1), size * (axis == 2)
    start = field[4][slot_of(x, y, z, field)]
    share = start / (start - field[4][slot_of(x + steps[0], y + steps[1], z + steps[2], field)])
    for quadrant in range(4):
        one = ring[quadrant]
        if one != ring[quadrant - 1]:
            crossings[one] += 1
            vertices[one, 0] += x + share * steps[0]
            vertices[one, 1] += y + share * steps[1]
            vertices[one, 2] += z + share * steps[2]
    return start < 0


@compiled
def cross_edges(small, large, small_tables, vertex, count, small_at, large_at, field):
    """[V 3] vertices at the mean of their crossings, [V 3] the field's change in their cells, [Q 4] the faces
    of the crossed edges."""
    case, _, sheet_of_edge = small_tables
    vertices, crossings, slopes = np.zeros((count, 3)), np.zeros(count), np.zeros((count, 3))
    quads = np.empty((4 * (len(small) + len(large)), 4), np.int64)
    found = 0
    around, ring = np.empty(4, np.int64), np.empty(4, np.int64)
    for number in range(len(small) + len(large)):
        size = 1 if number < len(small) else 2
        cell = number if size == 1 else number - len(small)
        low = small[cell] if size == 1 else large[cell]
        own = cell + 1 if size == 1 else -cell - 1
        add_slope(slopes, cell, low, size, small_tables, vertex, field)
        for edge in range(EDGES):
            if (sheet_of_edge[case[cell], edge] if size == 1 else vertex[cell, edge]) < 0:
                continue
            axis = edge // 4
            x, y, z = beside(low[0], low[1], low[2], axis, 0, size * (edge & 1), size * (edge >> 1 & 1))
            if not look_around(around, x, y, z, axis, size, own, small_at, large_at, field):
                continue
            for quadrant in range(4):
                ring[quadrant] = vertex_at(
                    x, y, z, axis, quadrant, around[quadrant], small_tables, large, vertex
                )
            outward = add_crossing(vertices, crossings, ring, x, y, z, axis, size, field)
            for quadrant in range(4):
                quads[found, quadrant if outward else 3 - quadrant] = ring[quadrant]
            found += 1
    for one in range(count):
        for d in range(3):
            vertices[one, d] /= max(crossings[one], 1.0)
    return vertices, slopes, quads[:found]


@inner(forceinline=True)
def slope_of(x, y, z, size, field):
    """The mean change of the field along each axis of a cell, for one fine cell."""
    dx = dy = dz = 0.0
    for corner in range(8):
        i, j, k = corner & 1, corner >> 1 & 1, corner >> 2
        value = field[4][slot_of(x + size * i, y + size * j, z + size * k, field)]
        dx += value if i else -value
        dy += value if j else -value
        dz += value if k else -value
    return dx / (4.0 * size), dy / (4.0 * size), dz / (4.0 * size)


RINGS = np.array([ring_of(side) for side in range(6)])
SIDE_EDGES = np.array(
    [[edge_between(ring[k], ring[(k + 1) % 4]) for k in range(4)] for ring in RINGS.tolist()]
)  # between each corner of a ring and the next
SHEETS, SHEET_OF_EDGE = number_sheets()
