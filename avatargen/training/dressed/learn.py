"""One garment is learned: its numbers are asked where its surface is, and its colours fitted to what is seen.

    box --every fourth node--> coarse distances --near zero--> blocks --every node--> distance, way to an edge
    points of the surface that are seen --least squares--> colours of the nodes around them

Letters: N points, V nodes, X Y Z blocks along the axes. Metres.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Float32, Float64, Int, Int64
from scipy.spatial import KDTree

from avatargen.generator.dressed.config import GarmentConfig, VolumeConfig
from avatargen.generator.dressed.volume import RIM, SIDE, Volume
from avatargen.training.dressed.painting import fit_nodes
from avatargen.wardrobe.makehuman.outfit import TAILORED
from avatargen.wardrobe.makehuman.truth import Truth, about

MARGIN = 0.05  # m of the grid around a garment
ROUNDS = 5  # of conjugate gradients for colours: more make colours of the rainbow where texels jump
PER_CELL = 4  # points of the surface for each cell that it crosses
FADED = 1.5  # cells from the surface beyond which a node's colour is hardly seen
BUSY, FINER = 30.0, 0.6  # dB below which colours are busier than their grid; of its cell, on the finer one
HELD_OUT = 20_000  # points that say how well it went
CORNERS = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)])
AROUND = np.array([[x, y, z] for x in (-1, 0, 1) for y in (-1, 0, 1) for z in (-1, 0, 1)])


@dataclass(frozen=True, kw_only=True)
class LearningConfig:
    """How finely garments are learned: metres between nodes."""

    cloth: float = 0.0045
    small: float = 0.0035  # of what sits on heads and feet
    large: float = 0.006  # of dresses, and of coats of the same making


@dataclass(frozen=True, kw_only=True)
class Named:
    """What a garment is: `middle` is the median of its own colours, CIELAB."""

    name: str
    kind: str
    tags: tuple[str, ...]
    middle: tuple[float, float, float]


@dataclass(frozen=True, kw_only=True, eq=False)
class Learned:
    """What a garment's learning gives, and its errors at points held out."""

    config: GarmentConfig
    volume: Volume
    errors: dict[str, float]


@dataclass(frozen=True, kw_only=True, eq=False)
class Grid:
    """Nodes about a garment, `cell` apart from `low` on; a node has three whole numbers, and one."""

    low: Float64[np.ndarray, "3"]
    cell: float
    blocks: Int64[np.ndarray, "3"]

    def number(self, nodes: Int[np.ndarray, "*n 3"]) -> Int64[np.ndarray, "*n"]:
        size = SIDE * self.blocks + 1
        return (nodes[..., 0] * size[1] + nodes[..., 1]) * size[2] + nodes[..., 2]

    def nodes(self, number: Int64[np.ndarray, "*n"]) -> Int64[np.ndarray, "*n 3"]:
        size = SIDE * self.blocks + 1
        return np.stack(np.unravel_index(number, tuple(size)), axis=-1)

    def place(self, nodes: Int[np.ndarray, "*n 3"]) -> Float32[np.ndarray, "*n 3"]:
        return (self.low + self.cell * nodes).astype(np.float32)

    def cells(self, points: Float[np.ndarray, "N 3"]) -> tuple[Int64[np.ndarray, "N 3"], np.ndarray]:
        """The lowest node of the cell around each point, and where in the cell it lies."""
        at = (points - self.low) / self.cell
        low = np.floor(at).astype(np.int64)
        return low, at - low


def grid_about(box: Float64[np.ndarray, "2 3"], cell: float) -> Grid:
    """A grid of whole blocks around a box."""
    blocks = np.ceil((box[1] - box[0] + 2 * MARGIN) / (SIDE * cell)).astype(np.int64)
    low = box.mean(axis=0) - 0.5 * SIDE * cell * blocks
    return Grid(low=np.round(low, 4), cell=cell, blocks=blocks)


@dataclass(frozen=True, kw_only=True, eq=False)
class Answers:
    """What was asked of a garment at nodes, by number."""

    number: Int64[np.ndarray, " V"]
    distance: Float32[np.ndarray, " V"]
    rim: Float32[np.ndarray, " V"]

    def at(self, number: Int64[np.ndarray, "*n"]) -> Int64[np.ndarray, "*n"]:
        """Their rows."""
        return np.searchsorted(self.number, number)


def ask_nodes(truth: Truth, grid: Grid, known: Answers | None, number: Int64[np.ndarray, " n"]) -> Answers:
    """The answers at nodes, with those that are known already."""
    new = number if known is None else np.setdiff1d(number, known.number)
    distance, rim = truth.ask(grid.place(grid.nodes(new)))
    if known is None:
        return Answers(number=new, distance=distance, rim=rim)
    both = np.concatenate([known.number, new])
    order = np.argsort(both)
    return Answers(
        number=both[order],
        distance=np.concatenate([known.distance, distance])[order],
        rim=np.concatenate([known.rim, rim])[order],
    )


def blocks_near(coarse: Float32[np.ndarray, "X1 Y1 Z1"], cell: float) -> Int64[np.ndarray, "n 3"]:
    """Blocks that the surface can cross: it is no farther than a block's diagonal from one of its corners."""
    near = np.abs(coarse) <= np.sqrt(3) * SIDE * cell
    touched = np.zeros([size - 1 for size in coarse.shape], dtype=bool)
    for x, y, z in CORNERS:
        touched |= near[x : x + touched.shape[0], y : y + touched.shape[1], z : z + touched.shape[2]]
    return np.argwhere(touched)


def crossed(answers: Answers, grid: Grid, cells: Int64[np.ndarray, "n 3"]) -> Bool[np.ndarray, " n"]:
    """Whether the surface crosses cells."""
    distance = answers.distance[answers.at(grid.number(cells[:, None] + CORNERS))]
    return (distance.min(axis=1) <= 0) & (distance.max(axis=1) >= 0)


def whole_block(blocks: Int64[np.ndarray, "n 3"], side: int) -> Int64[np.ndarray, "m 3"]:
    """The nodes of blocks, `side` along each axis."""
    steps = np.stack(np.meshgrid(*[np.arange(side)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    return (SIDE * blocks[:, None] + steps).reshape(-1, 3)


def learn_volume(truth: Truth, cell: float, rng: np.random.Generator) -> Volume:
    """A garment's numbers at nodes `cell` apart."""
    grid = grid_about(truth.box, cell)
    corners = np.argwhere(np.ones(grid.blocks + 1, dtype=bool))
    coarse, coarse_rim = (a.reshape(grid.blocks + 1) for a in truth.ask(grid.place(SIDE * corners)))
    candidates = blocks_near(coarse, cell)
    answers = ask_nodes(truth, grid, None, np.unique(grid.number(whole_block(candidates, SIDE + 1))))
    cells = whole_block(candidates, SIDE)
    cells = cells[crossed(answers, grid, cells)]
    beside = np.unique((cells[:, None] + AROUND).reshape(-1, 3), axis=0)  # the surface's neighbourhood
    touched = np.unique(np.concatenate([(beside + corner) // SIDE for corner in CORNERS]), axis=0)
    occupied = np.zeros(grid.blocks, dtype=bool)
    occupied[tuple(touched.T)] = True
    kept = grid.number(whole_block(np.argwhere(occupied), SIDE))
    answers = ask_nodes(truth, grid, answers, np.unique(kept))
    at = answers.at(kept)
    color = node_colors(truth, grid, kept, PER_CELL * len(cells), rng)
    color = calm(color, np.abs(answers.distance[at]) > FADED * cell)
    shape = (int(occupied.sum()), SIDE, SIDE, SIDE)
    volume = Volume(
        VolumeConfig(
            low=(float(grid.low[0]), float(grid.low[1]), float(grid.low[2])),
            cell=cell,
            blocks=(int(grid.blocks[0]), int(grid.blocks[1]), int(grid.blocks[2])),
            count=shape[0],
            colors=color.shape[1],
        )
    )
    volume.set(
        occupied,
        coarse,
        coarse_rim.clip(0, RIM),
        answers.distance[at].reshape(shape),
        answers.rim[at].reshape(shape),
        color.T.reshape(-1, *shape),
    )
    return volume


def node_colors(
    truth: Truth, grid: Grid, kept: Int64[np.ndarray, " V"], count: int, rng: np.random.Generator
) -> Float64[np.ndarray, "V C"]:
    """Colours of nodes whose mixtures come nearest to what is seen; those farther off have the colour of the
    nearest that is not."""
    points, color = truth.seen(count, rng)
    low, share = grid.cells(points)
    number = grid.number(low[:, None] + CORNERS)
    weights = np.where(CORNERS == 1, share[:, None], 1 - share[:, None]).prod(axis=2)
    nodes, row = np.unique(number, return_inverse=True)
    places = np.concatenate([np.zeros((1, 3)), grid.place(grid.nodes(nodes))])
    found = fit_nodes(1 + row.reshape(-1, 8), weights, np.ones(len(points)), color, places, ROUNDS)
    nearest = KDTree(places[1:]).query(grid.place(grid.nodes(kept)))[1]
    return found[1 + nearest].astype(np.float64)


def calm(color: Float64[np.ndarray, "V C"], far: Bool[np.ndarray, " V"]) -> Float64[np.ndarray, "V C"]:
    """Colours of whole blocks of nodes, those far from the surface replaced by the mean of the others: that
    takes half the room in a file."""
    blocks, away = color.reshape(-1, SIDE**3, color.shape[1]), far.reshape(-1, SIDE**3, 1)
    count = np.maximum((~away).sum(axis=1, keepdims=True), 1)
    mean = np.where(away, 0, blocks).sum(axis=1, keepdims=True) / count
    return np.where(away, mean, blocks).reshape(color.shape)


def learn(
    named: Named,
    truth: Truth,
    learning: LearningConfig,
    show: Callable[[str], None],
) -> Learned:
    """Learn a garment."""
    rng = np.random.default_rng(0)
    cell = cell_of(named, learning)
    volume = learn_volume(truth, cell, rng)
    errors = errors_of(volume, truth, rng)
    if named.kind != "hair" and errors["dB"] < BUSY:
        volume = learn_volume(truth, FINER * cell, rng)
        errors = errors_of(volume, truth, rng)
    show(f"{named.name}: " + told(errors))
    config = GarmentConfig(
        name=named.name,
        kind=named.kind,
        tags=named.tags,
        volume=volume.config,
        middle=named.middle,
    )
    return Learned(config=config, volume=volume, errors=errors)


def cell_of(named: Named, learning: LearningConfig) -> float:
    """Metres between a garment's nodes."""
    if named.kind in ("hair", "hat", "shoes"):
        return learning.small
    large = named.kind == "dress" or (named.kind == "outer" and TAILORED in named.tags)
    return learning.large if large else learning.cloth


def told(errors: dict[str, float]) -> str:
    return ", ".join(f"{name} {value:.4g}" for name, value in errors.items())


def errors_of(volume: Volume, truth: Truth, rng: np.random.Generator) -> dict[str, float]:
    """At points held out: mean and 99th percentile of the distance's error near the surface (mm), the share
    of points on the wrong side of it by 3 mm, and colours where the surface is seen (L1, dB)."""
    bricks = volume.read()
    points = about(truth, HELD_OUT, rng)
    true, found = truth.ask(points)[0], bricks.read(points)[0]
    error = 1000 * np.abs(found - true)[np.abs(true) < 0.006]
    wrong = (found < 0) != (true < 0)
    seen, color = truth.seen(HELD_OUT, rng)
    difference = bricks.colors(seen)[:, : min(3, color.shape[1])] - color[:, :3]
    return {
        "mm": float(error.mean()),
        "p99 mm": float(np.quantile(error, 0.99)),
        "wrong side": float((wrong & (np.abs(true) > 0.003)).mean()),
        "L1": float(np.abs(difference).mean()),
        "dB": float(-10 * np.log10(np.square(difference).mean() + 1e-12)),
    }
