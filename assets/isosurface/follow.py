"""Follow a surface from cell to cell through crossed sides until it closes.

Following asks at no corner but those of crossed cells, which is the least there is. It starts at fine edges
between corners of the band's cells that lie on either side of the surface.

Letters: C cells, K cells kept, E edges. Grid coordinates as in `grid`; `size` is that of the cells
followed, in fine cells.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Int64

from assets.errors import BoundsError, GeometryError
from assets.isosurface.band import Band, ExtractConfig, find_band
from assets.isosurface.grid import CORNERS, CellSet, CornerValues, Grid, unique_corners

SIDES = np.array(((-1, 0, 0), (1, 0, 0), (0, -1, 0), (0, 1, 0), (0, 0, -1), (0, 0, 1)))
BIT_OF_CORNER = 1 << np.arange(8)
BITS_OF_SIDE = [int(BIT_OF_CORNER @ ((CORNERS * 2 - 1) @ side > 0)) for side in SIDES]
QUARTERS = [[np.array(offset) for offset in CORNERS if offset[axis] == 0] for axis in range(3)]


@dataclass(frozen=True, kw_only=True)
class Start:
    """Cells to follow the surface from, and what finding them took."""

    cells: Int64[np.ndarray, "C 3"]
    queries: int  # beside those at corners of the grid
    attempts: int


def find_start(values: CornerValues, config: ExtractConfig, size: int = 1) -> Start:
    """Cells of the size on every part of the surface that the band can see.

    Raises:
        GeometryError: no surface inside the bounds, or the band never settles.
    """
    widening, queries = 1.0, 0
    for attempt in range(1, config.attempts + 1):
        band = find_band(values, config, widening, size)
        queries += band.queries
        if not band.missed:
            return Start(cells=seed_cells(values, band, size), queries=queries, attempts=attempt)
        widening *= config.widen
    raise GeometryError(
        f"extract: the band missed parts of the surface {config.attempts} times; the field is no distance, "
        "give a larger lipschitz"
    )


def seed_cells(values: CornerValues, band: Band, size: int) -> Int64[np.ndarray, "K 3"]:
    """A cell of the size that the surface crosses for each edge of the band's cells whose ends lie on either
    side of it.

    Raises:
        GeometryError: there is none.
    """
    grid = values.grid
    found = [np.zeros((0, 3), dtype=np.int64)]
    for axis in range(3):
        low = np.concatenate([band.cells + band.size * offset for offset in QUARTERS[axis]])
        low = unique_corners(values, low[(low <= grid.shape).all(axis=1)])
        high = low.copy()
        high[:, axis] = np.minimum(high[:, axis] + band.size, grid.shape[axis])
        inside = values.at(low) < 0
        crossed = inside != (values.at(high) < 0)
        found.append(halve(values, low[crossed], high[crossed], inside[crossed], axis, size))
    seeds = np.minimum(np.concatenate(found), grid.shape - size)
    if len(seeds) == 0:
        state = "outside" if (values.values > 0).any() else "inside"
        raise GeometryError(
            f"extract: the bounds are all {state}, no surface; check the bounds and the field's sign"
        )
    return unique_corners(values, seeds)


def halve(
    values: CornerValues,
    low: Int64[np.ndarray, "E 3"],
    high: Int64[np.ndarray, "E 3"],
    inside: Bool[np.ndarray, " E"],
    axis: int,
    size: int,
) -> Int64[np.ndarray, "E 3"]:
    """The low ends of the edges of the size where the sign changes on edges along an axis; `inside` is the
    sign at `low`."""
    low, high = low.copy(), high.copy()
    while (high[:, axis] - low[:, axis] > size).any():
        middle = (low + high) // (2 * size) * size
        same = ((values.at(middle) < 0) == inside)[:, None]
        low, high = np.where(same, middle, low), np.where(same, high, middle)
    return low


def follow_surface(
    values: CornerValues, seeds: Int64[np.ndarray, "C 3"], size: int = 1
) -> Int64[np.ndarray, "K 3"]:
    """Every cell that the surface crosses on its way from the seeds, through crossed sides.

    Raises:
        BoundsError: the surface leaves the grid.
    """
    listed = CellSet(values)
    frontier, found = seeds, [seeds[:0]]
    while len(frontier):
        listed.add(frontier)
        found.append(frontier)
        inside = values.ask(values.slots_of_cells(frontier, size)) < 0
        frontier = listed.lacking(cells_across(values.grid, frontier, inside, size))
    return np.concatenate(found)


def cells_across(
    grid: Grid, cells: Int64[np.ndarray, "C 3"], inside: Bool[np.ndarray, "C 8"], size: int = 1
) -> Int64[np.ndarray, "K 3"]:
    """The cells beyond each crossed side of these.

    Raises:
        BoundsError: the surface leaves the grid.
    """
    bits = inside @ BIT_OF_CORNER
    reached = np.concatenate(
        [cells[mixed(bits, of_side)] + size * side for side, of_side in zip(SIDES, BITS_OF_SIDE, strict=True)]
    )
    left = np.stack([(reached < 0).any(axis=0), (reached >= grid.shape).any(axis=0)])
    if left.any():
        raise BoundsError(left)
    return reached


def mixed(inside: Int64[np.ndarray, " C"], bits: int) -> Bool[np.ndarray, " C"]:
    """Cells that have both signs at these corners."""
    there = inside & bits
    return (there != 0) & (there != bits)
