"""The zero level of a field as a closed triangle surface: a narrow band from coarse to fine, then marching
cubes.

    cells from coarse to 1/128 of the box: keep those whose centre is near enough for the surface to pass
    through between corners of these that lie on either side of the surface, halve to a fine cell that it
    crosses from there follow the surface through crossed sides, cell by cell, until it closes
    marching cubes (Lorensen and Cline 1987) on the cells the surface crosses

The search is in `assets.band`. Following asks at no corner but those of crossed cells, which is the least
there is. Every point asked but the audit's is a corner of the final grid and is asked once. What the band can
miss is a component of its own that is smaller than 1/128 of the box.

Letters: C cells, K cells kept, E edges, N points. Metres; grid coordinates as in `assets.grid`.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int64

from assets.band import Band, ExtractConfig, find_band
from assets.errors import BoundsError, GeometryError
from assets.field import Field
from assets.grid import CORNERS, CornerValues, grown, make_grid, once
from assets.surface import Surface

SIDES = ((-1, 0, 0), (1, 0, 0), (0, -1, 0), (0, 1, 0), (0, 0, -1), (0, 0, 1))
BIT_OF_CORNER = 1 << np.arange(8)
BITS_OF_SIDE = [int(BIT_OF_CORNER @ ((CORNERS * 2 - 1) @ np.array(side) > 0)) for side in SIDES]
QUARTERS = [[np.array(offset) for offset in CORNERS if offset[axis] == 0] for axis in range(3)]
ROOM, GROWTHS = 0.05, 3  # metres by which bounds grow where the surface leaves them, and how often


@dataclass(frozen=True, kw_only=True)
class Extraction:
    """A closed surface and what it cost."""

    surface: Surface
    cell_size: float  # metres
    queries: int  # points asked
    crossing_corners: int  # corners of the cells that the surface crosses: no search can ask fewer
    attempts: int


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


def trace(sdf: Field, bounds: Float[np.ndarray, "2 3"], config: ExtractConfig) -> Extraction:
    """`extract` with its costs. Raises the same errors."""
    grid = make_grid(np.asarray(bounds, dtype=np.float64), config.resolution)
    values = CornerValues(sdf, grid)
    widening, other_queries = 1.0, 0
    for attempt in range(1, config.attempts + 1):
        band = find_band(values, config, widening)
        other_queries += band.queries
        if not band.missed:
            surface, corners = march(values, follow_surface(values, seed_cells(values, band)))
            return Extraction(
                surface=surface,
                cell_size=grid.cell_size,
                queries=other_queries + values.queries,
                crossing_corners=corners,
                attempts=attempt,
            )
        widening *= config.widen
    raise GeometryError(
        f"extract: the band missed parts of the surface {config.attempts} times; the field is no distance, "
        "give a larger lipschitz"
    )


def trace_whole(sdf: Field, bounds: Float[np.ndarray, "2 3"], config: ExtractConfig) -> Extraction:
    """`trace`, in larger bounds where the surface leaves those given, as a wide skirt may."""
    bounds = bounds.astype(np.float64)
    for _ in range(GROWTHS):
        try:
            return trace(sdf, bounds, config)
        except BoundsError as error:
            bounds = bounds + ROOM * (error.sides * np.array([[-1], [1]]))
    return trace(sdf, bounds, config)


def seed_cells(values: CornerValues, band: Band) -> Int64[np.ndarray, "K 3"]:
    """A fine cell that the surface crosses for each edge of the band's cells whose ends lie on either side
    of it.

    Raises:
        GeometryError: there is none.
    """
    grid = values.grid
    found = [np.zeros((0, 3), dtype=np.int64)]
    for axis in range(3):
        low = np.concatenate([band.cells + band.size * offset for offset in QUARTERS[axis]])
        low = different(values, low[(low <= grid.shape).all(axis=1)])
        high = low.copy()
        high[:, axis] = np.minimum(high[:, axis] + band.size, grid.shape[axis])
        inside = values.at(low) < 0
        crossed = inside != (values.at(high) < 0)
        found.append(halve(values, low[crossed], high[crossed], inside[crossed], axis))
    seeds = np.minimum(np.concatenate(found), grid.shape - 1)
    if len(seeds) == 0:
        state = "outside" if (values.values > 0).any() else "inside"
        raise GeometryError(
            f"extract: the bounds are all {state}, no surface; check the bounds and the field's sign"
        )
    return different(values, seeds)


def different(values: CornerValues, corners: Int64[np.ndarray, "N 3"]) -> Int64[np.ndarray, "K 3"]:
    """Each of these corners once."""
    return values.corners(once(values.slots(corners), len(values.values)))


def halve(
    values: CornerValues,
    low: Int64[np.ndarray, "E 3"],
    high: Int64[np.ndarray, "E 3"],
    inside: Bool[np.ndarray, " E"],
    axis: int,
) -> Int64[np.ndarray, "E 3"]:
    """The low ends of the fine edges where the sign changes on edges along an axis; `inside` is the sign at
    `low`."""
    low, high = low.copy(), high.copy()
    while (high[:, axis] - low[:, axis] > 1).any():
        middle = (low + high) // 2
        same = ((values.at(middle) < 0) == inside)[:, None]
        low, high = np.where(same, middle, low), np.where(same, high, middle)
    return low


def follow_surface(values: CornerValues, seeds: Int64[np.ndarray, "C 3"]) -> Int64[np.ndarray, "K 3"]:
    """Every cell that the surface crosses on its way from the seeds, through crossed sides.

    Raises:
        BoundsError: the surface leaves the grid.
    """
    listed = np.zeros(0, dtype=bool)  # by the slot of a cell's low corner
    frontier, found = seeds, [seeds[:0]]
    while len(frontier):
        slots = values.slots_of_cells(frontier)
        inside = (values.ask(slots) < 0) @ BIT_OF_CORNER
        listed = grown(listed, len(values.values))
        listed[slots[:, 0]] = True
        found.append(frontier)
        reached = np.concatenate(
            [frontier[mixed(inside, bits)] + side for side, bits in zip(SIDES, BITS_OF_SIDE, strict=True)]
        )
        left = np.stack([(reached < 0).any(axis=0), (reached >= values.grid.shape).any(axis=0)])
        if left.any():
            raise BoundsError(left)
        slots = values.slots(reached)
        listed = grown(listed, len(values.values))
        frontier = values.corners(once(slots[~listed[slots]], len(listed)))
    return np.concatenate(found)


def mixed(inside: Int64[np.ndarray, " C"], bits: int) -> Bool[np.ndarray, " C"]:
    """Cells that have both signs at these corners."""
    there = inside & bits
    return (there != 0) & (there != bits)


def march(values: CornerValues, cells: Int64[np.ndarray, "C 3"]) -> tuple[Surface, int]:
    """Marching cubes on crossed cells; also how many corners they have."""
    import igl

    cells = cells[np.argsort(values.grid.keys(cells))]  # the order of the grid, whatever the search did
    index = values.slots_of_cells(cells)
    slots = once(index.reshape(-1), len(values.values))
    place = np.zeros(len(values.values), dtype=np.int32)
    place[slots] = np.arange(len(slots))
    corners = values.grid.points(values.corners(slots))
    vertices, faces = igl.marching_cubes(values.values[slots], corners, place[index].astype(np.int64), 0.0)[
        :2
    ]
    return Surface(vertices=np.asarray(vertices), faces=np.asarray(faces).astype(np.int64)), len(slots)
