"""One garment learns: tables are fitted to what was seen, and a network and its features learn the distance.

    pool of points --least squares--> way to an edge, place on the cloth, paint
    body's distance, features, place in space --network--> distance

Letters: P points of the pool, N points of a step, K features. Metres.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor, nn
from torch.nn import functional as F

from avatargen.body.distance import BodyHit
from avatargen.body.model import CanonicalBody
from avatargen.generator.decoder import distance_features, encode, fade
from avatargen.generator.dressed.config import GarmentConfig, TableConfig
from avatargen.generator.dressed.lattice import Lattice, at_points, lattice, node_places
from avatargen.generator.dressed.network import GarmentNetwork, signed_distance
from avatargen.training.dressed.painting import fit_nodes, fitted
from avatargen.wardrobe.makehuman.pool import PointPool

Colors = Callable[[int], tuple[Float[np.ndarray, "N 4"], BodyHit]]  # of as many points of the surface

POINTS_PER_NODE = 8
HELD_OUT = 20_000  # points that are not learned from
CERTAIN = 0.004  # m from the surface over which what is painted counts less and less
BESIDE = 0.015  # m from the surface within which a face of the body gets numbers of its own
UNIT = 0.01  # m, of the loss
GHOST = 0.003  # m, well outside
RIM = 0.03  # m, the longest way to an edge that matters


@dataclass(frozen=True, kw_only=True)
class LearningConfig:
    """Settings of a garment's learning."""

    points: int = 450_000  # of the pool
    steps: int = 2000
    batch: int = 4096  # points a step
    learning_rate: float = 5e-3
    final_learning_rate: float = 0.01  # of the first one
    band: float = 0.02  # m around the surface where distances count in full
    far_weight: float = 0.3  # of distances beyond it
    seed: int = 0

    def rate(self, step: int) -> float:
        """The learning rate of a step: a short rise, then half a cosine."""
        last = self.final_learning_rate
        share = last + (1 - last) * 0.5 * (1 + math.cos(math.pi * step / self.steps))
        return self.learning_rate * share * min(1, (step + 1) / 100)


@dataclass(frozen=True, kw_only=True)
class Cut:
    """How finely a garment's tables are cut, how much its network reads of a node, how large it is."""

    features: int = 12
    coarse: int = 2  # segments under the features
    fine: int = 6  # segments under the paint
    width: int = 96  # of the network
    frequencies: int = 8  # of the encoded point


@dataclass(frozen=True, kw_only=True, eq=False)
class Lesson:
    """A pool with what the tables are read for there."""

    pool: PointPool
    points: Float[Tensor, "P 3"]
    distance: Float[Tensor, " P"]
    color: Float[Tensor, "P 4"]
    body: Float[Tensor, " P"]
    faded: Float[Tensor, " P"]
    coarse: tuple[Int[Tensor, "P 3"], Float[Tensor, "P 3"]]
    fine: tuple[Int[Tensor, "P 3"], Float[Tensor, "P 3"]]


@dataclass(frozen=True, kw_only=True, eq=False)
class Learned:
    """What a garment's learning gives: values of its tables, and errors at points held out."""

    config: GarmentConfig
    network: GarmentNetwork
    features: Float[Tensor, "n K"]
    sewn: Float[Tensor, "n 3"]
    paint: Float[Tensor, "m c"]
    covered: Bool[np.ndarray, " F"]
    errors: dict[str, float]


def covered_faces(pool: PointPool, faces: Int[np.ndarray, "F 3"]) -> Bool[np.ndarray, " F"]:
    """The body's faces that the garment's surface lies over, and those around them."""
    near = np.abs(pool.distance) < BESIDE
    seen = np.zeros(len(faces), dtype=bool)
    seen[pool.face[near]] = True
    for _ in range(2):
        touched = np.zeros(int(faces.max()) + 1, dtype=bool)
        touched[faces[seen]] = True
        seen = touched[faces].any(axis=1)
    return np.asarray(seen)


def lesson_of(
    pool: PointPool, body: CanonicalBody, inverse_reach: Float[Tensor, " V"], tables: tuple[Lattice, Lattice]
) -> Lesson:
    """The pool's points as the tables see them."""
    face, barycentric = torch.from_numpy(pool.face), torch.from_numpy(pool.barycentric)
    distance = torch.from_numpy(pool.body)
    reach = (inverse_reach[torch.from_numpy(body.faces)[face]] * barycentric).sum(dim=1)
    read = [at_points(torch.from_numpy(t.face_nodes), t.segments, face, barycentric) for t in tables]
    return Lesson(
        pool=pool,
        points=torch.from_numpy(pool.points),
        distance=torch.from_numpy(pool.distance),
        color=torch.from_numpy(pool.color),
        body=distance,
        faded=fade(distance[None], reach[None])[0],
        coarse=(read[0][0].int(), read[0][1].float()),
        fine=(read[1][0].int(), read[1][1].float()),
    )


def cube(points: np.ndarray) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
    """The smallest cube around points with their middle: one scale on all axes."""
    low, high = points.min(axis=0), points.max(axis=0)
    middle, half = (low + high) / 2, float((high - low).max()) / 2
    corners = np.round([middle - half, middle + half], 4).tolist()
    return tuple(corners[0]), tuple(corners[1])


def painted_at(
    lattice_: Lattice,
    reading: tuple[Tensor, Tensor],
    values: np.ndarray,
    certain: np.ndarray,
    body: CanonicalBody,
) -> Float[Tensor, "n k"]:
    """Values at the lattice's nodes that fit those at points."""
    places = node_places(body.vertices, body.faces, lattice_)
    return torch.from_numpy(fit_nodes(reading[0].numpy(), reading[1].numpy(), certain, values, places))


def mixed(table: Float[Tensor, "n K"], reading: tuple[Tensor, Tensor], index: Tensor) -> Float[Tensor, "N K"]:
    """A table's numbers at some points."""
    return F.embedding_bag(reading[0][index], table, per_sample_weights=reading[1][index], mode="sum")


@dataclass(frozen=True, kw_only=True)
class Named:
    """What a garment is: `middle` is the median of its own colours, CIELAB."""

    name: str
    kind: str
    tags: tuple[str, ...]
    middle: tuple[float, float, float]


class Student(nn.Module):
    """A garment's network with the features that it reads, asked at points of a lesson."""

    def __init__(self, config: GarmentConfig, lesson: Lesson) -> None:
        super().__init__()
        self.config, self.lesson = config, lesson
        self.features = nn.Parameter(torch.randn(config.features.nodes, config.features.numbers) * 0.1)
        self.network = GarmentNetwork(config)
        self.low, self.size = torch.tensor(config.low), torch.tensor(config.high) - torch.tensor(config.low)

    def forward(self, index: Int[Tensor, " N"]) -> Float[Tensor, " N"]:
        """Signed distance at some points, m."""
        lesson, distance = self.lesson, self.lesson.body[index]
        place = (lesson.points[index] - self.low) / self.size * 2 - 1
        read = mixed(self.features, lesson.coarse, index) * lesson.faded[index, None]
        seen = [distance_features(distance[None])[0], read, encode(place[None], self.config.frequencies)[0]]
        return signed_distance(self.network(torch.cat(seen, dim=-1)), distance)


def learn(
    named: Named,
    pool: PointPool,
    colors: Colors,
    body: CanonicalBody,
    inverse_reach: Float[Tensor, " V"],
    cut: Cut,
    learning: LearningConfig,
    show: Callable[[str], None],
) -> Learned:
    """Learn a garment from its pool, and from the colours of its surface."""
    torch.manual_seed(learning.seed)
    covered = covered_faces(pool, body.faces)
    coarse, fine = (lattice(body.faces, covered, n) for n in (cut.coarse, cut.fine))
    lesson = lesson_of(pool, body, inverse_reach, (coarse, fine))
    paints = 1 if named.kind == "hair" else 3 if (pool.color[:, 3] == 1).all() else 4  # a shade; with trim
    low, high = cube(pool.points)
    config = GarmentConfig(
        name=named.name,
        kind=named.kind,
        tags=named.tags,
        features=TableConfig(segments=cut.coarse, numbers=cut.features, nodes=coarse.count),
        sewn=TableConfig(segments=cut.coarse, numbers=3, nodes=coarse.count, bits=16),
        paint=TableConfig(segments=cut.fine, numbers=paints, nodes=fine.count),
        low=low,
        high=high,
        middle=named.middle,
        width=cut.width,
        frequencies=cut.frequencies,
    )
    certain = np.exp(-((pool.distance / CERTAIN) ** 2)) + 1e-4
    sewn = np.column_stack([pool.sewn[:, 0].clip(0, RIM), pool.sewn[:, 1:]])
    sewn_nodes = painted_at(coarse, lesson.coarse, sewn, certain, body)
    color, hit = colors(POINTS_PER_NODE * fine.count)
    paint = torch.from_numpy(fitted(body, fine, hit, color[:, :paints]))
    student = Student(config, lesson)
    return Learned(
        config=config,
        network=student.network,
        features=student.features.detach(),
        sewn=sewn_nodes,
        paint=paint,
        covered=covered,
        errors=teach(student, learning, paint, show),
    )


def teach(
    student: Student, learning: LearningConfig, paint: Float[Tensor, "m c"], show: Callable[[str], None]
) -> dict[str, float]:
    """Teach the distance by steps of some points each; returns the errors at points held out."""
    lesson = student.lesson
    optimizer = torch.optim.Adam(student.parameters(), lr=learning.learning_rate, betas=(0.9, 0.99))
    random = torch.Generator().manual_seed(learning.seed)
    order = torch.randperm(len(lesson.points), generator=random)
    held, used = order[:HELD_OUT], order[HELD_OUT:]
    for step in range(learning.steps):
        for group in optimizer.param_groups:
            group["lr"] = learning.rate(step)
        index = used[torch.randint(len(used), (learning.batch,), generator=random)]
        true = lesson.distance[index]
        error = (student(index) - true).abs().clamp(max=0.05)
        band = (true.abs() < learning.band).float()
        loss = (error * (learning.far_weight + (1 - learning.far_weight) * band)).mean() / UNIT
        optimizer.zero_grad(set_to_none=True)
        loss.backward()
        optimizer.step()
        if step % 500 == 0:
            show(f"{student.config.name} {step}: " + told(errors_at(student, held, paint)))
    student.eval().requires_grad_(False)
    errors = errors_at(student, held, paint)
    show(f"{student.config.name}: " + told(errors))
    return errors


def told(errors: dict[str, float]) -> str:
    return ", ".join(f"{name} {value:.4g}" for name, value in errors.items())


def error_at_lids(
    student: Student, index: Int[Tensor, " N"], found: Float[Tensor, " N"]
) -> Float[Tensor, ""]:
    """Mean error of distance (mm) at the lids of a garment's openings outside the body; 0 without any."""
    lesson = student.lesson
    true, way = lesson.distance[index], torch.from_numpy(lesson.pool.sewn[:, 0])[index]
    at_lid = (way <= 0) & (lesson.body[index] > 0) & (true.abs() < 0.006)
    return 1000 * (found - true).abs()[at_lid].mean() if at_lid.any() else torch.zeros(())


@torch.no_grad()
def errors_at(student: Student, index: Tensor, paint: Float[Tensor, "m c"]) -> dict[str, float]:
    """Mean and 99th percentile of distance (mm) near the surface; the mean at the lids of
    openings (mm); the share of points well outside that seem inside; colours at the surface (L1, dB)."""
    lesson, true = student.lesson, student.lesson.distance[index]
    found = student(index)
    error = 1000 * (found - true).abs()[true.abs() < 0.006]
    near = index[true.abs() < 0.002]
    difference = mixed(paint, lesson.fine, near)[:, :3] - lesson.color[near][:, :3]
    return {
        "mm": float(error.mean()),
        "p99 mm": float(error.quantile(0.99)),
        "edge mm": float(error_at_lids(student, index, found)),
        "ghosts": float(((found < 0) & (true > GHOST)).float().mean()),
        "L1": float(difference.abs().mean()),
        "dB": float(-10 * torch.log10(difference.square().mean())),
    }
