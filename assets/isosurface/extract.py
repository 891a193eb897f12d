"""The zero level of a field as a closed triangle surface: a narrow band from coarse to fine, then marching
cubes.

    cells from coarse to 1/128 of the box, kept where the surface may pass through        (band)
    between corners of these on either side of the surface, halved to a fine crossed cell (follow)
    from there cell by cell through crossed sides, until the surface closes               (follow)
    marching cubes (Lorensen and Cline 1987) on the crossed cells

Every point asked but the audit's is a corner of the final grid and is asked once. What the band can
miss is a component of its own that is smaller than 1/128 of the box.

Letters: C cells. Metres; grid coordinates as in `grid`.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int64

from assets.errors import BoundsError
from assets.field import Field
from assets.isosurface.band import ExtractConfig
from assets.isosurface.follow import find_start, follow_surface
from assets.isosurface.grid import CornerValues, make_grid, unique_below
from assets.mesh.surface import Surface

ROOM, GROWTHS = 0.05, 3  # metres by which bounds grow where the surface leaves them, and how often


@dataclass(frozen=True, kw_only=True)
class Extraction:
    """A closed surface and what it cost."""

    surface: Surface
    cell_size: float  # metres
    queries: int  # points asked
    attempts: int


Tracer = Callable[[Field, Float[np.ndarray, "2 3"], ExtractConfig], Extraction]
March = Callable[[CornerValues, Int64[np.ndarray, "C 3"]], Surface]  # of crossed cells


def extract(sdf: Field, bounds: Float[np.ndarray, "2 3"], config: ExtractConfig | None = None) -> Surface:
    """The zero level of `sdf` inside `bounds` (metres): closed, welded, facing outward; one or more
    components.

    Raises:
        GeometryError: no surface inside the bounds, or the band never settles.
        BoundsError: it leaves the bounds.
        FieldError: the field is NaN or infinite.
        InputError: bounds that hold no box, or a resolution out of range.
    """
    return trace(sdf, bounds, config or ExtractConfig()).surface


def trace(
    sdf: Field, bounds: Float[np.ndarray, "2 3"], config: ExtractConfig, march: March | None = None
) -> Extraction:
    """`extract` with its costs, by libigl's marching cubes or others. Raises the same errors."""
    grid = make_grid(np.asarray(bounds, dtype=np.float64), config.resolution)
    values = CornerValues(sdf, grid)
    start = find_start(values, config)
    return Extraction(
        surface=(march or march_cells)(values, follow_surface(values, start.cells)),
        cell_size=grid.cell_size,
        queries=start.queries + values.queries,
        attempts=start.attempts,
    )


def trace_whole(
    sdf: Field, bounds: Float[np.ndarray, "2 3"], config: ExtractConfig, trace: Tracer = trace
) -> Extraction:
    """`trace`, or another way, in larger bounds where the surface leaves those given, as a wide skirt may."""
    bounds = bounds.astype(np.float64)
    for _ in range(GROWTHS):
        try:
            return trace(sdf, bounds, config)
        except BoundsError as error:
            bounds = bounds + ROOM * (error.sides * np.array([[-1], [1]]))
    return trace(sdf, bounds, config)


def march_cells(values: CornerValues, cells: Int64[np.ndarray, "C 3"]) -> Surface:
    """libigl's marching cubes on crossed cells."""
    import igl

    cells = cells[np.argsort(values.grid.keys(cells))]  # the order of the grid, whatever the search did
    index = values.slots_of_cells(cells)
    slots = unique_below(index.reshape(-1), len(values.values))
    place = np.zeros(len(values.values), dtype=np.int32)
    place[slots] = np.arange(len(slots))
    corners = values.grid.points(values.corners(slots))
    vertices, faces = igl.marching_cubes(values.values[slots], corners, place[index].astype(np.int64), 0.0)[
        :2
    ]
    return Surface(vertices=np.asarray(vertices), faces=np.asarray(faces).astype(np.int64))
