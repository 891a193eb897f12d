"""The corners, edges and sides of a cubic cell by number, and how a surface passes through each of its cases.

    corner x + 2 y + 4 z    at x, y, z, which are 0 or 1
    edge 4 a + i + 2 j      along axis a (0 x, 1 y, 2 z), at i and j of the two axes after it: y z, z x, x y
    side 2 a + d            at d of axis a
    case                    the corners inside the surface, bit k for corner k: 0 to 255

A sheet is one connected piece of the surface within a cell (Nielson 2004, "Dual Marching Cubes"). On each
side it runs from the edge where a walk around the corners comes inside to the edge where that leaves again.
The two cells at a side see the same corners there, so they join the same edges, and no crack opens between
them.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Int, Int8

from avatargen.compiled import inner

EDGES = 12


class CellTables(NamedTuple):
    """What is the same for all cells."""

    rings: Int[np.ndarray, "6 4"]  # the corners around each side
    side_edges: Int[np.ndarray, "6 4"]  # edge k of a side lies between corner k of its ring and the next
    sheet_count: Int8[np.ndarray, "256"]  # by case
    sheet_of_edge: Int8[np.ndarray, "256 12"]  # by case: the sheet that crosses an edge, -1 for none


@inner(forceinline=True)
def enters(case, rings, side, corner):
    """Whether a walk around a side's ring comes inside at this corner (0 to 3) of it."""
    return case >> rings[side, corner] & 1 and not case >> rings[side, corner - 1] & 1


@inner(forceinline=True)
def way_out(case, rings, side, corner):
    """From a corner inside: the ring's edge (0 to 3) by which the walk goes outside again."""
    while case >> rings[side, (corner + 1) % 4] & 1:
        corner += 1
    return corner % 4


def ring_of(side: int) -> list[int]:
    """The corners around a side."""
    axis, across = divmod(side, 2)
    i, j = 1 << (axis + 1) % 3, 1 << (axis + 2) % 3
    return [(across << axis) + corner for corner in (0, i, i + j, j)]


def edge_between(a: int, b: int) -> int:
    """The edge between two corners that differ in one coordinate."""
    axis = (a ^ b).bit_length() - 1
    return 4 * axis + (a >> (axis + 1) % 3 & 1) + 2 * (a >> (axis + 2) % 3 & 1)


def make_tables() -> CellTables:
    """Number the sheets of every case, in the order of the lowest edge that each crosses."""
    rings = np.array([ring_of(side) for side in range(6)])
    side_edges = np.array(
        [[edge_between(ring[k], ring[(k + 1) % 4]) for k in range(4)] for ring in rings.tolist()]
    )
    count, sheet = np.zeros(256, dtype=np.int8), np.full((256, EDGES), -1, dtype=np.int8)
    for case in range(256):
        joined = joined_edges(case, rings, side_edges)
        for edge in np.flatnonzero(joined >= 0):
            first = np.flatnonzero(joined == joined[edge])[0]
            sheet[case, edge] = count[case] if first == edge else sheet[case, first]
            count[case] += first == edge
    return CellTables(rings, side_edges, count, sheet)


def joined_edges(
    case: int, rings: Int[np.ndarray, "6 4"], side_edges: Int[np.ndarray, "6 4"]
) -> Int[np.ndarray, "12"]:
    """A number for each crossed edge that is the same for the edges of one sheet; -1 for edges not
    crossed."""
    joined = np.full(EDGES, -1)
    for side in range(6):
        for corner in range(4):
            if enters.py_func(case, rings, side, corner):
                pair = side_edges[side, [corner - 1, way_out.py_func(case, rings, side, corner)]]
                for edge in pair:
                    joined[edge] = edge if joined[edge] < 0 else joined[edge]
                joined[joined == joined[pair[0]]] = joined[pair[1]]
    return joined


TABLES = make_tables()
