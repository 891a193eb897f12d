"""Marching cubes in cells with a saddle: a side whose corners are inside and outside by turns.

Signs do not tell whether such a side's inside corners hang together through its middle or its outside corners
do. Tables of marching cubes answer always alike, which bridges thin air or tears thin sheets wherever two
surfaces meet at a sharp angle. Here the bilinear interpolant of the side's four values answers (Nielson and
Hamann 1991, "The Asymptotic Decider"), the same way for the cells on both sides. The loops that the crossings
of a cell then form are each filled by a disk.

Letters: C cells, L loops of a length n. A cell's corners are ordered as `CORNERS`.
"""

from itertools import pairwise

import numpy as np
from jaxtyping import Bool, Float64, Int64

from assets.isosurface.grid import CORNERS

# corners around each side, counter-clockwise from outside the cell
SIDES = np.array([(0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (2, 3, 7, 6), (0, 4, 7, 3), (1, 2, 6, 5)])
EDGES = np.array(
    [(a, b) for a in range(8) for b in range(a + 1, 8) if np.abs(CORNERS[a] - CORNERS[b]).sum() == 1]
)
NUMBER_OF_EDGE = {frozenset(edge): number for number, edge in enumerate(EDGES.tolist())}
EDGES_OF_SIDE = np.array(
    [[NUMBER_OF_EDGE[frozenset(pair)] for pair in pairwise([*side, side[0]])] for side in SIDES.tolist()]
)


def with_saddle(values: Float64[np.ndarray, "C 8"]) -> Bool[np.ndarray, " C"]:
    """Cells with a side whose corners are inside and outside by turns."""
    inside = values[:, SIDES] < 0
    turns = (inside != np.roll(inside, 1, axis=2)).sum(axis=2)
    return (turns == 4).any(axis=1)


def find_loops(
    values: Float64[np.ndarray, "C 8"],
) -> list[tuple[Int64[np.ndarray, " L"], Int64[np.ndarray, "L n"]]]:
    """The loops of crossed edges in which the surface leaves these cells' sides, counter-clockwise from
    outside: for each length n the cell of each loop, and the numbers of its edges."""
    following = links(values)
    left = following >= 0
    found: dict[int, list[tuple[np.ndarray, np.ndarray]]] = {}
    for start in range(len(EDGES)):
        cells = np.flatnonzero(left[:, start])
        path, here = [np.full(len(cells), start)], following[cells, start]
        while len(cells):
            left[cells, path[-1]] = False
            closed = here == start
            if closed.any():
                loops = np.stack([step[closed] for step in path], axis=1)
                found.setdefault(len(path), []).append((cells[closed], loops))
            cells, path = cells[~closed], [*(step[~closed] for step in path), here[~closed]]
            here = following[cells, path[-1]]
    return [
        (np.concatenate([cells for cells, _ in parts]), np.concatenate([loops for _, loops in parts]))
        for _, parts in sorted(found.items())
    ]


def links(values: Float64[np.ndarray, "C 8"]) -> Int64[np.ndarray, "C 12"]:
    """The edge that follows each crossed edge around its loop, -1 for edges that are not crossed."""
    following = np.full((len(values), len(EDGES)), -1)
    for corners, edges in zip(SIDES, EDGES_OF_SIDE, strict=True):
        around = values[:, corners]
        inside = around < 0
        enters, leaves = ~inside & np.roll(inside, -1, axis=1), inside & ~np.roll(inside, -1, axis=1)
        both = enters.sum(axis=1) == 2
        joined = both & (inner_product(around, inside) > inner_product(around, ~inside))
        once = np.flatnonzero(enters.sum(axis=1) == 1)
        following[once, edges[enters[once].argmax(axis=1)]] = edges[leaves[once].argmax(axis=1)]
        for place in range(4):
            # an inside corner alone lies between where the way around enters and where it leaves next; where
            # the inside corners are joined, an outside one does
            alone = np.flatnonzero(both & ~joined & leaves[:, place])
            following[alone, edges[place - 1]] = edges[place]
            apart = np.flatnonzero(joined & leaves[:, place])
            following[apart, edges[(place + 1) % 4]] = edges[place]
    return following


def inner_product(
    around: Float64[np.ndarray, "C 4"], which: Bool[np.ndarray, "C 4"]
) -> Float64[np.ndarray, " C"]:
    """The product of the values at these corners. The bilinear interpolant's saddle is inside where that of
    the inside corners is the larger one."""
    return np.where(which, around, 1.0).prod(axis=1)
