"""Cells that a surface may pass through: a narrow band around it, from coarse to fine.

A cell is kept if |field| <= lipschitz * distance to its farthest point, seen from its own centre and, once it
is halved, from the centres beside that. Where the constant is not given it is estimated at each level, with
a margin; a seeded sample of the skipped cells is audited, and a miss tells the caller to widen the band.

Letters: C cells, K halved cells. Metres; grid coordinates as in `assets.isosurface.grid`.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int64

from assets.field import ask
from assets.isosurface.grid import CornerValues
from avatargen.errors import InputError

MAX_RESOLUTION = 2048
HALVES = np.array([(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)])
ACROSS = np.sqrt(6)  # sizes of a halved cell, from its farthest corner to the centres beside its own


@dataclass(frozen=True, kw_only=True)
class ExtractConfig:
    """Resolution counts cubic cells along the longest side of the bounds."""

    resolution: int = 512
    coarsest: int = 8  # cells along the longest side at the first level, at least
    seeds: int = 128  # cells along the longest side at the last level of the band, at least
    lipschitz: float | None = None  # largest slope of the field; None: estimated
    slope_quantile: float = 0.995  # of the slopes met near the surface, for the estimate
    margin: float = 1.1  # on an estimated constant
    audit: int = 1000  # skipped cells checked at each level, and slopes met
    attempts: int = 4
    widen: float = 1.6  # growth of the band after a failed audit
    seed: int = 0

    def __post_init__(self) -> None:
        if not 4 <= self.resolution <= MAX_RESOLUTION:
            raise InputError(f"extract: resolution {self.resolution}; choose 4 to {MAX_RESOLUTION}")
        if self.lipschitz is not None and not self.lipschitz > 0:
            raise InputError(f"extract: lipschitz {self.lipschitz}; give a positive number or none")


@dataclass(frozen=True, kw_only=True)
class Band:
    """Cells of `size` fine cells along a side that may hold the surface."""

    cells: Int64[np.ndarray, "C 3"]
    size: int
    queries: int  # beside those at corners of the grid
    missed: int  # audited points of skipped cells across the surface from the centre that ruled them out


def find_band(values: CornerValues, config: ExtractConfig, widening: float, smallest: int = 1) -> Band:
    """Halve cells until they are small enough, keeping at each level only those the surface may pass
    through; none gets smaller than `smallest` fine cells."""
    grid, rng = values.grid, np.random.default_rng(config.seed)
    last = max(largest_power(config.resolution / config.seeds), smallest)
    size = max(largest_power(config.resolution / config.coarsest), last)
    axes = [np.arange(0, count, size) for count in grid.shape]
    cells = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    queries = missed = 0
    while size > last and len(cells):
        centre = np.minimum(cells + size // 2, grid.shape)
        high = np.minimum(cells + size, grid.shape)
        reach = np.linalg.norm(np.maximum(centre - cells, high - centre), axis=1) * grid.cell_size
        value = values.at(centre)
        slope = config.lipschitz or estimate_slope(values, cells, high, centre, config, rng)
        near = np.abs(value) <= slope * widening * (reach - blind(value, last * grid.cell_size))
        size //= 2
        halves, half = halve_cells(cells[near], size, grid.shape)
        beside = value_beside(values, halves, half, size)
        beyond = np.abs(beside) > slope * widening * ACROSS * size * grid.cell_size
        skipped = np.concatenate([cells[~near], halves[beyond]])
        ends = np.concatenate([high[~near], np.minimum(halves[beyond] + size, grid.shape)])
        seen = np.concatenate([value[~near], beside[beyond]])
        audited = rng.permutation(len(skipped))[: config.audit]
        missed += audit(values, skipped[audited], ends[audited], seen[audited], rng)
        queries += len(audited)
        cells = halves[~beyond]
    return Band(cells=cells, size=size, queries=queries, missed=missed)


def halve_cells(
    cells: Int64[np.ndarray, "C 3"], size: int, shape: Int64[np.ndarray, "3"]
) -> tuple[Int64[np.ndarray, "K 3"], Int64[np.ndarray, "K 3"]]:
    """The parts of `size` of cells halved along each axis, those that lie in the grid; and which half of its
    cell, 0 or 1, each is along each axis."""
    half = np.tile(HALVES, (len(cells), 1))
    halves = np.repeat(cells, len(HALVES), axis=0) + size * half
    within = (halves < shape).all(axis=1)
    return halves[within], half[within]


def value_beside(
    values: CornerValues, halves: Int64[np.ndarray, "K 3"], half: Int64[np.ndarray, "K 3"], size: int
) -> Float64[np.ndarray, " K"]:
    """The value farthest from zero at the centres of the three cells that a halved cell touches beside its
    own, of those that are known; 0 where none is."""
    centre = halves + size * (1 - half)
    best = np.zeros(len(halves))
    for axis in range(3):
        other = centre.copy()
        other[:, axis] += 2 * size * (2 * half[:, axis] - 1)
        within = np.flatnonzero(((other >= 0) & (other <= values.grid.shape)).all(axis=1))
        known = values.known(other[within])
        best[within] = np.where(np.abs(known) > np.abs(best[within]), known, best[within])
    return best


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
) -> float:
    """Slope of the field inside the cells nearest the surface, with the margin."""
    value = values.at(centre)
    count = min(config.audit, len(cells))
    nearest = np.argsort(np.abs(value), kind="stable")[: 4 * count]
    chosen = rng.choice(nearest, count, replace=False)
    end = np.where(rng.random((count, 3)) < 0.5, cells[chosen], high[chosen])
    change = np.abs(values.at(end) - value[chosen])
    slope = change / (np.linalg.norm(end - centre[chosen], axis=1) * values.grid.cell_size)
    return float(np.quantile(slope, config.slope_quantile)) * config.margin


def audit(
    values: CornerValues,
    cells: Int64[np.ndarray, "C 3"],
    high: Int64[np.ndarray, "C 3"],
    value: Float64[np.ndarray, " C"],
    rng: np.random.Generator,
) -> int:
    """How many of these skipped cells hold a random point across the surface from the centre that ruled them
    out, where the field is `value`."""
    inner = cells + (high - cells) * rng.random(cells.shape)
    return int(((ask(values.sdf, values.grid.points(inner)) < 0) != (value < 0)).sum())
