"""The zero level of a field as a closed triangle surface: a narrow band from coarse to fine, then marching
cubes.

    cells of 16 ... 2 times the final size: keep those whose centre is near enough for the surface to pass
    through cells of the final size: the same from two opposite corners, which neighbours share
    ask the field at all corners of what is left, and follow the surface into neighbours the band has missed
    marching cubes (Lorensen and Cline 1987) on the cells the surface crosses, its vertices slid along their
    grid edges

A cell is near enough if |field| <= lipschitz * distance to its farthest point. Where the constant is not
given it is estimated at each level, with a margin; a seeded sample of the skipped cells is audited, and one
miss repeats the search with a wider band. Every point asked but the audit's is a corner of the final grid
and is asked once.

Letters: C cells, K cells kept, N points. Metres; grid coordinates as in `assets.grid`.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Float64, Int64

from assets.errors import GeometryError
from assets.field import Field, ask
from assets.grid import CORNERS, CornerValues, make_grid
from assets.surface import Surface
from avatargen.errors import InputError

SIDES = ((-1, 0, 0), (1, 0, 0), (0, -1, 0), (0, 1, 0), (0, 0, -1), (0, 0, 1))
CORNERS_OF_SIDE = np.array([np.flatnonzero((CORNERS * 2 - 1) @ np.array(side) > 0) for side in SIDES])
HALVES = np.array([(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)])
# largest sum of the distances from a point of a unit cube to two opposite corners
FARTHEST_SUM = 1 + np.sqrt(2)
MAX_RESOLUTION = 2048


@dataclass(frozen=True, kw_only=True)
class ExtractConfig:
    """Resolution counts cubic cells along the longest side of the bounds."""

    resolution: int = 512
    coarsest: int = 32  # cells along the longest side at the first level, at least
    lipschitz: float | None = None  # largest slope of the field; None: estimated
    slope_quantile: float = 0.995  # of the slopes met near the surface, for the estimate
    margin: float = 1.1  # on an estimated constant
    audit: int = 2000  # skipped cells checked at each level
    attempts: int = 4
    widen: float = 1.6  # growth of the band after a failed audit
    slide: bool = True  # one more question a vertex, to bring it from the straight line's zero to the field's
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
        GeometryError: no surface inside the bounds, or it leaves them, or the band never settles.
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
            surface, corners = march(values, follow_surface(values, band.cells))
            if config.slide:
                other_queries += len(surface.vertices)
                surface = slide(surface, values)
            return Extraction(
                surface=surface,
                cell_size=grid.cell_size,
                queries=other_queries + len(values.keys),
                crossing_corners=corners,
                attempts=attempt,
            )
        widening *= config.widen
    raise GeometryError(
        f"extract: the band missed parts of the surface {config.attempts} times; the field is no distance, "
        "give a larger lipschitz"
    )


@dataclass(frozen=True, kw_only=True)
class Band:
    """Cells of the final size that may hold the surface."""

    cells: Int64[np.ndarray, "C 3"]
    queries: int  # beside those at corners of the grid
    missed: int  # audited points of skipped cells on the other side of the surface than their cell's centre


def find_band(values: CornerValues, config: ExtractConfig, widening: float) -> Band:
    """Halve cells until they have the final size, keeping at each level only those the surface may pass
    through."""
    grid, rng = values.grid, np.random.default_rng(config.seed)
    size = 2 ** max(0, int(np.log2(config.resolution / config.coarsest)))
    axes = [np.arange(0, count, size) for count in grid.shape]
    cells = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    queries = missed = 0
    slope = config.lipschitz or 1.0
    while size > 1 and len(cells):
        centre = np.minimum(cells + size // 2, grid.shape)
        high = np.minimum(cells + size, grid.shape)
        reach = np.linalg.norm(np.maximum(centre - cells, high - centre), axis=1) * grid.cell_size
        value = values.at(centre)
        if config.lipschitz is None:
            slope, asked = estimate_slope(values, cells, high, centre, config, rng)
            queries += asked
        near = np.abs(value) <= slope * widening * reach
        skipped = rng.permutation(np.flatnonzero(~near))[: config.audit]
        missed += audit(values, cells[skipped], high[skipped], value[skipped], rng)
        queries += len(skipped)
        size //= 2
        cells = (cells[near][:, None] + size * HALVES).reshape(-1, 3)
        cells = cells[(cells < grid.shape).all(axis=1)]
    return Band(cells=near_opposite_corners(values, cells, slope * widening), queries=queries, missed=missed)


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


def near_opposite_corners(
    values: CornerValues, cells: Int64[np.ndarray, "C 3"], slope: float
) -> Int64[np.ndarray, "K 3"]:
    """Those cells that the surface may cross, judged by their all-even and their all-odd corner.

    A zero at p needs |f(a)| <= slope |p - a| and |f(b)| <= slope |p - b|, so their sum is at most slope * (1
    + sqrt 2) sides.
    """
    odd = cells & 1
    a, b = values.at(cells + odd), values.at(cells + 1 - odd)
    farthest = slope * FARTHEST_SUM * values.grid.cell_size
    return cells[(np.abs(a) + np.abs(b) <= farthest) | ((a < 0) != (b < 0))]


def follow_surface(values: CornerValues, band: Int64[np.ndarray, "C 3"]) -> Int64[np.ndarray, "K 3"]:
    """Every cell that the surface crosses: those of the band, and those reached from them through crossed
    sides.

    Raises:
        GeometryError: no cell is crossed, or the surface leaves the grid.
    """
    grid = values.grid
    listed = np.zeros(len(values.slot), dtype=bool)
    frontier, found = band, np.zeros((0, 3), dtype=np.int64)
    while len(frontier):
        listed[grid.keys(frontier)] = True
        inside = values.inside(frontier)
        crossed = mixed(inside)
        frontier, inside = frontier[crossed], inside[crossed]
        found = np.concatenate([found, frontier])
        beyond = np.concatenate(
            [frontier[mixed(inside[:, i])] + s for s, i in zip(SIDES, CORNERS_OF_SIDE, strict=True)]
        )
        if ((beyond < 0) | (beyond >= grid.shape)).any():
            raise GeometryError(
                "extract: the surface touches the bounds and would stay open; give larger bounds"
            )
        keys = grid.keys(beyond)
        frontier = grid.corners(np.unique(keys[~listed[keys]]))
    if len(found) == 0:
        state = "inside" if len(values.values) and (values.values < 0).all() else "outside"
        raise GeometryError(
            f"extract: the bounds are all {state}, no surface; check the bounds and the field's sign"
        )
    return found


def mixed(inside: np.ndarray) -> np.ndarray:
    """Rows that hold both signs."""
    return np.asarray(inside.any(axis=1) & ~inside.all(axis=1))


def march(values: CornerValues, cells: Int64[np.ndarray, "C 3"]) -> tuple[Surface, int]:
    """Marching cubes on crossed cells; also how many corners they have."""
    import igl

    grid = values.grid
    cells = cells[np.argsort(grid.keys(cells))]  # the order of the grid, whatever the search did
    index = values.of_cells(cells)
    used = np.zeros(len(values.values), dtype=bool)
    used[index] = True
    rows = np.flatnonzero(used)
    place = np.zeros(len(used), dtype=np.int64)
    place[rows] = np.arange(len(rows))
    corners = grid.points(grid.corners(values.keys[rows]))
    vertices, faces = igl.marching_cubes(values.values[rows], corners, place[index], 0.0)[:2]
    return Surface(vertices=np.asarray(vertices), faces=np.asarray(faces).astype(np.int64)), len(rows)


def slide(surface: Surface, values: CornerValues) -> Surface:
    """Move each vertex along its grid edge from the straight line's zero to the field's own, by inverse
    quadratic interpolation.

    A vertex stays on its edge, between the corner on the other side and where it was, so no face can turn
    over. One question a vertex.
    """
    grid = values.grid
    place = (surface.vertices - grid.low) / grid.cell_size
    axis = np.argmax(np.abs(place - np.rint(place)), axis=1)
    rows = np.arange(len(place))
    low = np.rint(place).astype(np.int64)
    low[rows, axis] = np.floor(place[rows, axis]).astype(np.int64)
    high = low.copy()
    high[rows, axis] += 1
    at = ask(values.sdf, surface.vertices)
    t = place[rows, axis] - low[rows, axis]
    place[rows, axis] = low[rows, axis] + inverse_quadratic(values.at(low), at, values.at(high), t)
    return Surface(vertices=grid.points(place), faces=surface.faces)


def inverse_quadratic(
    f0: Float64[np.ndarray, " N"],
    ft: Float64[np.ndarray, " N"],
    f1: Float64[np.ndarray, " N"],
    t: Float64[np.ndarray, " N"],
) -> Float64[np.ndarray, " N"]:
    """Zero in 0..1 of a function with values f0, ft, f1 at 0, t, 1, where f0 and f1 differ in sign; t where
    that fails."""
    from_low = (f0 < 0) == (ft < 0)  # then the zero lies in t..1
    least, most = np.where(from_low, t, 0.0), np.where(from_low, 1.0, t)
    with np.errstate(divide="ignore", invalid="ignore"):
        zero = t * (f0 * f1) / ((ft - f0) * (ft - f1)) + (f0 * ft) / ((f1 - f0) * (f1 - ft))
    return np.where((zero > least) & (zero < most), zero, t)
