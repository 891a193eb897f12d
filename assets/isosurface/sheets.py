"""A number for each sheet of the surface in each crossed cell: the vertices of dual contouring.

In a small cell the case tells which edges belong to one sheet (`assets.isosurface.cell`). In a large one that
holds too, unless the cells beyond a side are small. There the surface can cross edges in the middle of that
side as well. Then the small cells' sides tell which edges to join, quarter by quarter, and a union-find does
so.

A large cell has up to 36 edges: its own 12, and four within each halved side, from 12 + 4 * side: the low and
the high half of the side's middle line along the first axis after the side's own, then along the second.

Letters: S small cells, L large cells, M slots of corners. Coordinates as in
`assets.isosurface.corner_lookup`.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Int8, Int32, Int64

from assets.isosurface.cell import EDGES, enters, way_out
from assets.isosurface.corner_lookup import case_of, number_at, offset
from avatargen.compiled import compiled, inner

LARGE_EDGES = EDGES + 6 * 4  # of a large cell, with those within halved sides
HALVED = -1  # in the place of a large cell's number


class Cells(NamedTuple):
    """The crossed cells by number and by place."""

    small: Int64[np.ndarray, "S 3"]  # low corners
    large: Int64[np.ndarray, "L 3"]
    small_at: Int32[np.ndarray, " M"]  # by slot of the low corner: a cell's number, from 1; 0 for none
    large_at: Int32[np.ndarray, " M"]  # the same; HALVED where small cells have taken its place


class Sheets(NamedTuple):
    """The vertices of cells: one for each sheet, those of the small cells first."""

    case: Int64[np.ndarray, " S"]  # of each small cell
    first: Int64[np.ndarray, "S+1"]  # vertex of each small cell; its other sheets' vertices follow
    sheet_of_edge: Int8[np.ndarray, "256 12"]  # by case, as in `CellTables`
    of_large: Int64[np.ndarray, "L 36"]  # the vertex at each edge of the large cells, -1 for none


@compiled
def sheets_of_small(small, sheet_count, lookup):
    """[S] the case of each small cell [S 3]; [S + 1] its first vertex, and in the end how many there are."""
    case, first = np.empty(len(small), np.int64), np.zeros(len(small) + 1, np.int64)
    for cell in range(len(small)):
        x, y, z = small[cell]
        case[cell] = case_of(lookup, x, y, z, 1)
        first[cell + 1] = first[cell] + sheet_count[case[cell]]
    return case, first


@inner(forceinline=True)
def find_root(parent, edge):
    """The edge that stands for all edges joined with this one."""
    while parent[edge] != edge:
        edge = parent[edge]
    return edge


@inner(forceinline=True)
def join(parent, a, b):
    """Put two crossed edges into one sheet; `parent` is -1 for edges not crossed so far."""
    if parent[a] < 0:
        parent[a] = a
    if parent[b] < 0:
        parent[b] = b
    parent[find_root(parent, a)] = find_root(parent, b)


@inner
def join_side(parent, case, side, tables):
    """Join the edges of one side of a large cell where the surface crosses it."""
    for corner in range(4):
        if enters(case, tables.rings, side, corner):
            a = tables.side_edges[side, corner - 1]
            join(parent, a, tables.side_edges[side, way_out(case, tables.rings, side, corner)])


@inner(forceinline=True)
def edge_of_quarter(side, i, j, k):
    """The large cell's number of edge k (0 to 3) of the ring around the quarter at i, j of one of its
    sides."""
    axis, across = side // 2, side % 2
    if k % 2 == 0:  # along the first axis of the side
        at = j + k // 2
        along = (axis + 1) % 3
        return EDGES + 4 * side + i if at == 1 else 4 * along + at // 2 + 2 * across
    at = i + (k == 1)
    along = (axis + 2) % 3
    return EDGES + 4 * side + 2 + j if at == 1 else 4 * along + across + 2 * (at // 2)


@inner
def join_halved_side(parent, x, y, z, side, case_of_small, cells, lookup, tables):
    """`join_side` where small cells lie beyond the side, quarter by quarter; x, y, z is the large cell's low
    corner."""
    axis, across = side // 2, side % 2
    facing = 2 * axis + 1 - across  # the small cells' side
    step = 2 if across else -1
    for quarter in range(4):
        i, j = quarter & 1, quarter >> 1
        low_x, low_y, low_z = offset(x, y, z, axis, step, i, j)
        small = number_at(lookup, cells.small_at, low_x, low_y, low_z)
        if small == 0:
            continue
        case = case_of_small[small - 1]
        for corner in range(4):
            if enters(case, tables.rings, facing, corner):
                a = edge_of_quarter(side, i, j, (corner - 1) % 4)
                b = edge_of_quarter(side, i, j, way_out(case, tables.rings, facing, corner))
                join(parent, a, b)


@compiled
def sheets_of_large(cells, case_of_small, count, lookup, tables):
    """[L 36] the vertex at each edge of the large cells, -1 for none, numbered from `count` on; and how many
    vertices there are then."""
    large = cells.large
    vertex = np.full((len(large), LARGE_EDGES), -1, np.int64)
    parent = np.empty(LARGE_EDGES, np.int64)
    for cell in range(len(large)):
        x, y, z = large[cell]
        case = case_of(lookup, x, y, z, 2)
        parent[:] = -1
        for side in range(6):
            low_x, low_y, low_z = offset(x, y, z, side // 2, 4 * (side % 2) - 2, 0, 0)
            if number_at(lookup, cells.large_at, low_x, low_y, low_z) == HALVED:
                join_halved_side(parent, x, y, z, side, case_of_small, cells, lookup, tables)
            else:
                join_side(parent, case, side, tables)
        for edge in range(LARGE_EDGES):
            if parent[edge] >= 0:
                root = find_root(parent, edge)
                if vertex[cell, root] < 0:
                    vertex[cell, root] = count
                    count += 1
                vertex[cell, edge] = vertex[cell, root]
    return vertex, count
