"""Cubic cells over a box, and the values of a field at their corners.

Letters: C cells, N points. Grid coordinates are whole numbers of cells from the low corner of the box; a
cell is named by its low corner.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Float64, Int64, Shaped

from assets.field import Field, ask
from avatargen.errors import InputError

CORNERS = np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)])
MAX_CORNERS = 1 << 34
BITS = 2  # of a coordinate, that tell corners of one brick apart
BRICK = 1 << BITS  # corners along a brick's side
FEW = 1 / 100  # share of all numbers, under which sorting is faster than marking
NEVER_ZERO = 1e-5  # of a cell: values closer to zero are moved there, so that no triangle has zero area


@dataclass(frozen=True, kw_only=True)
class Grid:
    """Cubic cells over the bounds: `shape` cells of `cell_size` metres from `low`; the last ones may stand
    out a little."""

    low: Float64[np.ndarray, "3"]
    cell_size: float
    shape: Int64[np.ndarray, "3"]

    def points(
        self, coordinates: Float[np.ndarray, "N 3"] | Int64[np.ndarray, "N 3"]
    ) -> Float64[np.ndarray, "N 3"]:
        """Grid coordinates to metres."""
        return self.low + self.cell_size * coordinates

    def keys(self, corners: Int64[np.ndarray, "*N 3"]) -> Int64[np.ndarray, "*N"]:
        """One number for each corner of the grid."""
        return (corners[..., 2] * (self.shape[1] + 1) + corners[..., 1]) * (self.shape[0] + 1) + corners[
            ..., 0
        ]


def make_grid(bounds: Float64[np.ndarray, "2 3"], resolution: int, together: int = 1) -> Grid:
    """Cubic cells, `resolution` of them along the longest side; along each side a multiple of `together`.

    Raises:
        InputError: bounds that hold no box, or too many cells.
    """
    side = bounds[1] - bounds[0]
    if not (np.isfinite(bounds).all() and (side > 0).all()):
        raise InputError(f"extract: bounds {bounds.tolist()} hold no box; give finite low and high corners")
    cell_size = float(side.max()) / resolution
    shape = np.maximum(np.ceil(side / cell_size / together - 1e-9), 1).astype(np.int64) * together
    if np.prod(shape + 1) > MAX_CORNERS:
        raise InputError(f"extract: {shape.tolist()} cells are too many; lower the resolution")
    return Grid(low=bounds[0], cell_size=cell_size, shape=shape)


def grown(array: Shaped[np.ndarray, " M"], size: int) -> Shaped[np.ndarray, " N"]:
    """The array, followed by zeros where it is shorter; the system hands out memory as it is touched."""
    if len(array) >= size:
        return array
    longer = np.zeros(size, dtype=array.dtype)
    longer[: len(array)] = array
    return longer


def unique_below(numbers: Int64[np.ndarray, " N"], below: int) -> Int64[np.ndarray, " K"]:
    """Each of these numbers (0 to below - 1) once, in order: like `np.unique`, but by marking them, which is
    faster unless they are few."""
    if len(numbers) < FEW * below:
        return np.unique(numbers)
    there = np.zeros(below, dtype=bool)
    there[numbers] = True
    return np.flatnonzero(there)


class CornerValues:
    """The field at corners of the grid, asked once each.

    Values lie in bricks of 4 x 4 x 4 corners that are opened where they are needed, so memory follows the
    surface; a corner's place among the values is its slot. A value is never zero: zero says not asked yet.
    """

    def __init__(self, sdf: Field, grid: Grid) -> None:
        self.sdf, self.grid = sdf, grid
        self.bricks = grid.shape // BRICK + 1  # along each axis
        strides = np.cumprod([1, *self.bricks[:2]])
        # of each coordinate of each axis: its share in a corner's code, which is the brick and, in the last
        # bits, the place in it
        self.shares = [
            ((c >> BITS) * stride << 3 * BITS) + ((c & (BRICK - 1)) << axis * BITS)
            for axis, stride in enumerate(strides)
            for c in [np.arange(self.bricks[axis] * BRICK)]
        ]
        self.opened = np.zeros(int(np.prod(self.bricks)), dtype=np.int32)  # how many were before it, from 1
        self.brick = np.zeros(0, dtype=np.int64)  # of each that is open
        self.values = np.zeros(0)
        self.queries = 0

    def slots(self, corners: Int64[np.ndarray, "N 3"]) -> Int64[np.ndarray, " N"]:
        """Where the values of corners are or will be."""
        x, y, z = (share[corners[:, axis]] for axis, share in enumerate(self.shares))
        return self.decode(x + y + z)

    def slots_of_cells(self, cells: Int64[np.ndarray, "C 3"], size: int = 1) -> Int64[np.ndarray, "C 8"]:
        """The same for the corners of cells of a size, in the order of `CORNERS`."""
        x, y, z = ((share[cells[:, d]], share[cells[:, d] + size]) for d, share in enumerate(self.shares))
        return self.decode(np.stack([x[i] + y[j] + z[k] for i, j, k in CORNERS], axis=1))

    def decode(self, codes: Int64[np.ndarray, "*N"]) -> Int64[np.ndarray, "*N"]:
        """Slots by codes, in bricks that are opened where they are not."""
        brick = codes >> 3 * BITS
        number = self.opened[brick]
        if not number.all():
            self.open(brick[number == 0])
            number = self.opened[brick]
        return (number.astype(np.int64) - 1 << 3 * BITS) + (codes & (BRICK**3 - 1))

    def open(self, bricks: Int64[np.ndarray, " N"]) -> None:
        """Make room for bricks, which may be named more than once."""
        ticket = np.arange(1, len(bricks) + 1, dtype=np.int32)
        self.opened[bricks] = ticket
        new = bricks[self.opened[bricks] == ticket]  # each once
        self.opened[new] = np.arange(len(self.brick) + 1, len(self.brick) + 1 + len(new))
        self.brick = np.concatenate([self.brick, new])
        if len(self.brick) * BRICK**3 > len(self.values):
            self.values = grown(self.values, 2 * len(self.brick) * BRICK**3)

    def corners(self, slots: Int64[np.ndarray, " N"]) -> Int64[np.ndarray, "N 3"]:
        """The corners whose values have these slots."""
        rest, x = np.divmod(self.brick[slots >> 3 * BITS], self.bricks[0])
        z, y = np.divmod(rest, self.bricks[1])
        within = slots[:, None] >> np.array([0, BITS, 2 * BITS]) & (BRICK - 1)
        return (np.stack([x, y, z], axis=1) << BITS) + within

    def ask(self, slots: Int64[np.ndarray, "*N"]) -> Float64[np.ndarray, "*N"]:
        """The field at the corners of these slots, asked where it has not been asked."""
        found = self.values[slots]
        new = unique_below(slots[found == 0], len(self.values))
        if len(new) == 0:
            return found
        values = ask(self.sdf, self.grid.points(self.corners(new)))
        tiny = NEVER_ZERO * self.grid.cell_size
        self.values[new] = np.where(np.abs(values) < tiny, np.where(values < 0, -tiny, tiny), values)
        self.queries += len(new)
        return self.values[slots]

    def at(self, corners: Int64[np.ndarray, "N 3"]) -> Float64[np.ndarray, " N"]:
        """The field at corners."""
        return self.ask(self.slots(corners))

    def known(self, corners: Int64[np.ndarray, "N 3"]) -> Float64[np.ndarray, " N"]:
        """The field at corners where it has been asked already, 0 elsewhere."""
        slots = self.slots(corners)  # which may make room, and so comes first
        return self.values[slots]


class CellSet:
    """Cells of one size, of a grid whose corners have values."""

    def __init__(self, values: CornerValues) -> None:
        self.values = values
        self.there = np.zeros(0, dtype=bool)  # by the slot of a cell's low corner

    def add(self, cells: Int64[np.ndarray, "C 3"]) -> None:
        """Cells that may be in it already."""
        slots = self.values.slots(cells)
        self.there = grown(self.there, len(self.values.values))
        self.there[slots] = True

    def has(self, cells: Int64[np.ndarray, "C 3"]) -> Bool[np.ndarray, " C"]:
        """Which of these cells are in it."""
        slots = self.values.slots(cells)
        self.there = grown(self.there, len(self.values.values))
        return self.there[slots]

    def lacking(self, cells: Int64[np.ndarray, "C 3"]) -> Int64[np.ndarray, "K 3"]:
        """Those of these cells that are not in it, each once."""
        return unique_corners(self.values, cells[~self.has(cells)])


def unique_corners(values: CornerValues, corners: Int64[np.ndarray, "N 3"]) -> Int64[np.ndarray, "K 3"]:
    """Each of these corners once."""
    return values.corners(unique_below(values.slots(corners), len(values.values)))
