"""Cubic cells over a box, and the values of a field at their corners.

Letters: C cells, N points. Grid coordinates are whole numbers of cells from the low corner of the box; a
cell is named by its low corner.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Float64, Int64

from assets.field import Field, ask
from avatargen.errors import InputError

CORNERS = np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)])
MAX_CORNERS = 1 << 31
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

    def corners(self, keys: Int64[np.ndarray, " N"]) -> Int64[np.ndarray, "N 3"]:
        """The corners that have these keys."""
        rest, x = np.divmod(keys, self.shape[0] + 1)
        z, y = np.divmod(rest, self.shape[1] + 1)
        return np.stack([x, y, z], axis=1)


def make_grid(bounds: Float64[np.ndarray, "2 3"], resolution: int) -> Grid:
    """Cubic cells, `resolution` of them along the longest side.

    Raises:
        InputError: bounds that hold no box, or too many cells.
    """
    side = bounds[1] - bounds[0]
    if not (np.isfinite(bounds).all() and (side > 0).all()):
        raise InputError(f"extract: bounds {bounds.tolist()} hold no box; give finite low and high corners")
    cell_size = float(side.max()) / resolution
    shape = np.maximum(np.ceil(side / cell_size - 1e-9), 1).astype(np.int64)
    if np.prod(shape + 1) > MAX_CORNERS:
        raise InputError(f"extract: {shape.tolist()} cells are too many; lower the resolution")
    return Grid(low=bounds[0], cell_size=cell_size, shape=shape)


class CornerValues:
    """The field at corners of the grid, asked once each.

    `slot` has a place for every corner of the grid, 0 where it has not been asked; the system hands out its
    memory only as it is touched.
    """

    def __init__(self, sdf: Field, grid: Grid) -> None:
        self.sdf, self.grid = sdf, grid
        self.slot = np.zeros(int(np.prod(grid.shape + 1)), dtype=np.int32)
        self.keys = np.zeros(0, dtype=np.int64)
        self.values = np.zeros(0)

    def index(self, keys: Int64[np.ndarray, "*N"]) -> Int64[np.ndarray, "*N"]:
        """Rows of `values` for corners, asking the field where it has not been asked."""
        flat = keys.reshape(-1)
        flat = flat[self.slot[flat] == 0]
        if len(flat):
            ticket = np.arange(1, len(flat) + 1, dtype=np.int32)
            self.slot[flat] = ticket
            new = flat[self.slot[flat] == ticket]  # each corner once
            self.slot[new] = np.arange(len(self.keys) + 1, len(self.keys) + 1 + len(new))
            values = ask(self.sdf, self.grid.points(self.grid.corners(new)))
            tiny = NEVER_ZERO * self.grid.cell_size
            values = np.where(np.abs(values) < tiny, np.where(values < 0, -tiny, tiny), values)
            self.keys, self.values = np.concatenate([self.keys, new]), np.concatenate([self.values, values])
        return self.slot[keys].astype(np.int64) - 1

    def at(self, corners: Int64[np.ndarray, "N 3"]) -> Float64[np.ndarray, " N"]:
        """The field at corners."""
        index = self.index(self.grid.keys(corners))
        return self.values[index]

    def of_cells(self, cells: Int64[np.ndarray, "C 3"]) -> Int64[np.ndarray, "C 8"]:
        """Rows of `values` for the corners of cells, in the order of `CORNERS`."""
        return self.index(self.grid.keys(cells)[:, None] + self.grid.keys(CORNERS))

    def inside(self, cells: Int64[np.ndarray, "C 3"]) -> Bool[np.ndarray, "C 8"]:
        """Whether each corner of each cell is inside the surface."""
        index = self.of_cells(cells)
        return (self.values < 0)[index]
