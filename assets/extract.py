"""The zero level of a field as a closed triangle surface: a narrow band from coarse to fine, then marching
cubes.

    cells from coarse to 1/128 of the box: keep those whose centre is near enough for the surface to pass
    through between corners of these that lie on either side of the surface, halve to a fine cell that it
    crosses from there follow the surface through crossed sides, cell by cell, until it closes
    marching cubes (Lorensen and Cline 1987) on the cells the surface crosses

A cell is near enough if |field| <= lipschitz * distance to its farthest point. Where the constant is not
given it is estimated at each level, with a margin; a seeded sample of the skipped cells is audited, and one
miss repeats the search with a wider band. Following asks at no corner but those of crossed cells, which is
the least there is. Every point asked but the audit's is a corner of the final grid and is asked once. What
the band can miss is a component of its own that is smaller than 1/128 of the box.

Letters: C cells, K cells kept, E edges, N points. Metres; grid coordinates as in `assets.grid`.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Float64, Int64

from assets.errors import BoundsError, GeometryError
from assets.field import Field, ask
from assets.grid import CORNERS, CornerValues, grown, make_grid, once
from assets.surface import Surface
from avatargen.errors import InputError

SIDES = ((-1, 0, 0), (1, 0, 0), (0, -1, 0), (0, 1, 0), (0, 0, -1), (0, 0, 1))
BIT_OF_CORNER = 1 << np.arange(8)
BITS_OF_SIDE = [int(BIT_OF_CORNER @ ((CORNERS * 2 - 1) @ np.array(side) > 0)) for side in SIDES]
QUARTERS = [[np.array(offset) for offset in CORNERS if offset[axis] == 0] for axis in range(3)]
HALVES = np.array([(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)])
MAX_RESOLUTION = 2048
ROOM, GROWTHS = 0.05, 3  # metres by which bounds grow where the surface leaves them, and how often


@dataclass(frozen=True, kw_only=True)
class ExtractConfig:
    """Resolution counts cubic cells along the longest side of the bounds."""

    resolution: int = 512
    coarsest: int = 32  # cells along the longest side at the first level, at least
    seeds: int = 128  # cells along the longest side at the last level of the band, at least
    lipschitz: float | None = None  # largest slope of the field; None: estimated
    slope_quantile: float = 0.995  # of the slopes met near the surface, for the estimate
    margin: float = 1.1  # on an estimated constant
    audit: int = 2000  # skipped cells checked at each level
    attempts: int = 4
    widen: float = 1.6  # growth of the band after a failed audit
    seed: int = 0

    def __post_init__(self) -> None:
        if not 4 <= self.resolution <= MAX_RESOLUTION:
            raise InputError(f"extract: resolution {self.resolution}; choose 4 to {MAX_RESOLUTION}")
        if self.lipschitz is not None and not self.lipschitz > 0:
            raise InputError(f"extract: lipschitz {self.lipschitz}; give a positive number or none")


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


@dataclass(frozen=True, kw_only=True)
class Band:
    """Cells of `size` fine cells along a side that may hold the surface."""

    cells: Int64[np.ndarray, "C 3"]
    size: int
    queries: int  # beside those at corners of the grid
    missed: int  # audited points of skipped cells on the other side of the surface than their cell's centre


def find_band(values: CornerValues, config: ExtractConfig, widening: float) -> Band:
    """Halve cells until they are small enough, keeping at each level only those the surface may pass
    through."""
    grid, rng = values.grid, np.random.default_rng(config.seed)
    last = largest_power(config.resolution / config.seeds)
    size = max(largest_power(config.resolution / config.coarsest), last)
    axes = [np.arange(0, count, size) for count in grid.shape]
    cells = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    queries = missed = 0
    while size > last and len(cells):
        centre = np.minimum(cells + size // 2, grid.shape)
        high = np.minimum(cells + size, grid.shape)
        reach = np.linalg.norm(np.maximum(centre - cells, high - centre), axis=1) * grid.cell_size
        value = values.at(centre)
        slope = config.lipschitz
        if slope is None:
            slope, asked = estimate_slope(values, cells, high, centre, config, rng)
            queries += asked
        near = np.abs(value) <= slope * widening * (reach - blind(value, last * grid.cell_size))
        skipped = rng.permutation(np.flatnonzero(~near))[: config.audit]
        missed += audit(values, cells[skipped], high[skipped], value[skipped], rng)
        queries += len(skipped)
        size //= 2
        cells = (cells[near][:, None] + size * HALVES).reshape(-1, 3)
        cells = cells[(cells < grid.shape).all(axis=1)]
    return Band(cells=cells, size=size, queries=queries, missed=missed)


def blind(value: Float64[np.ndarray, " C"], size: float) -> Float64[np.ndarray, " C"]:
    """How far from a cell's farthest point the surface may be overlooked, metres.

    Where the field is clamped it says nothing of the distance, and every coarse cell would be near. But what
    comes no nearer to any centre fits in a cell of `size` metres, the last of the band; such pieces may be
    overlooked anyway.
    """
    clamped = (value == value.max()) | (value == value.min())
    return np.where(clamped, np.sqrt(3) / 2 * size, 0.0)


def largest_power(number: float) -> int:
    """The largest power of two that is not above a number; at least 1."""
    return 2 ** max(0, int(np.log2(number)))


def estimate_slope(
    values: CornerValues,
    cells: Int64[np.ndarray, "C 3"],
    high: Int64[np.ndarray, "C 3"],
    centre: Int64[np.ndarray, "C 3"],
    config: ExtractConfig,
    rng: np.random.Generator,
) -> tuple[float, int]:
    """Slope of the field inside the cells nearest the surface, with the margin; and how many points it
    took."""
    value = values.at(centre)
    count = min(config.audit, len(cells))
    nearest = np.argsort(np.abs(value), kind="stable")[: 4 * count]
    chosen = rng.choice(nearest, count, replace=False)
    end = np.where(rng.random((count, 3)) < 0.5, cells[chosen], high[chosen])
    rise = np.abs(ask(values.sdf, values.grid.points(end)) - value[chosen])
    slope = rise / (np.linalg.norm(end - centre[chosen], axis=1) * values.grid.cell_size)
    return float(np.quantile(slope, config.slope_quantile)) * config.margin, count


def audit(
    values: CornerValues,
    cells: Int64[np.ndarray, "C 3"],
    high: Int64[np.ndarray, "C 3"],
    value: Float64[np.ndarray, " C"],
    rng: np.random.Generator,
) -> int:
    """How many of these skipped cells hold a random point across the surface from their centre, where the
    field is `value`."""
    inner = cells + (high - cells) * rng.random(cells.shape)
    return int(((ask(values.sdf, values.grid.points(inner)) < 0) != (value < 0)).sum())


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
