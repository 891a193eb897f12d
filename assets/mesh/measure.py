"""How far a mesh is from the zero level of a field, and that from the mesh: sampled evenly over the area, in
millimetres."""

from dataclasses import dataclass
from itertools import product

import numpy as np
from jaxtyping import Bool, Float64, Int64

from assets.field import Field, ask
from assets.mesh.surface import Surface, face_areas, face_normals

DOUBTFUL = 0.001  # metres beyond which a zero found along the gradient may not be the nearest, where ...
DIFFERENT, STEEP = 1.25, 0.9  # ... it is so many times what the value tells at this quantile of the slopes
LONGEST = 100  # of these distances that are looked at anyway, as the largest error is one of them
LOST = 0.2  # share of the field's value that may be left after the steps
NEAR_ZERO = 2e-6  # metres from zero that count as there
SHORTEST, FARTHEST, SHELLS, HALVINGS = 5e-5, 0.05, 16, 5  # metres and numbers, of the search all around
AROUND = np.array([np.array(d) / np.linalg.norm(d) for d in product((-1, 0, 1), repeat=3) if any(d)])


@dataclass(frozen=True, kw_only=True)
class MeasureConfig:
    """Six questions to the field a sample."""

    samples: int = 12_000
    step: float = 2.5e-4  # metres, of the finite differences
    seed: int = 0


@dataclass(frozen=True, kw_only=True)
class SurfaceError:
    """Distance between the mesh and the zero level, millimetres."""

    mean_mm: float
    p99_mm: float
    max_mm: float

    def facts(self) -> dict[str, float]:
        """For reports."""
        return {"mean": self.mean_mm, "p99": self.p99_mm, "max": self.max_mm}


def surface_error(surface: Surface, sdf: Field, config: MeasureConfig | None = None) -> SurfaceError:
    """Mean, 99th percentile and largest distance from samples on the mesh to the zero level of `sdf`.

    A distance is the way to a zero of the field along a line, so it may be too long but not too short; where
    it is long, shorter ways are sought all around.

    Raises:
        FieldError: the field is NaN or infinite.
    """
    config = config or MeasureConfig()
    face, barycentric = sample_surface(surface, config.samples, config.seed)
    points = points_on(surface, face, barycentric)
    return summary(distances(points, face_normals(surface)[face], sdf, config.step))


def missed_error(mesh: Surface, finer: Surface, config: MeasureConfig | None = None) -> SurfaceError:
    """The other way: from samples on a finer surface to the mesh.

    Of what the mesh has lost, such as the tip of a finger, no sample on the mesh can tell.
    """
    from avatargen.mesh.closest import ClosestPoints

    config = config or MeasureConfig()
    points = points_on(finer, *sample_surface(finer, config.samples, config.seed))
    squared, _, _ = ClosestPoints(mesh.vertices, mesh.faces).query(points)
    return summary(np.sqrt(squared))


def summary(distance: Float64[np.ndarray, " N"]) -> SurfaceError:
    """Of distances in metres."""
    millimetres = 1000 * distance
    return SurfaceError(
        mean_mm=float(millimetres.mean()),
        p99_mm=float(np.quantile(millimetres, 0.99)),
        max_mm=float(millimetres.max()),
    )


def face_errors(surface: Surface, sdf: Field, step: float = MeasureConfig.step) -> Float64[np.ndarray, " F"]:
    """Distance from the middle of each face to the zero level of `sdf`, millimetres.

    Raises:
        FieldError: the field is NaN or infinite.
    """
    middles = surface.vertices[surface.faces].mean(axis=1)
    return 1000 * distances(middles, face_normals(surface), sdf, step)


def distances(
    points: Float64[np.ndarray, "N 3"], normals: Float64[np.ndarray, "N 3"], sdf: Field, step: float
) -> Float64[np.ndarray, " N"]:
    """Distance to the zero level along the field's gradient or, where that leads nowhere or far, the least
    in many directions, metres."""
    distance, told = distance_to_zero(points, sdf, step)
    lost = to_look_at(distance, told)
    if lost.any():
        along = normals[lost] / np.maximum(np.linalg.norm(normals[lost], axis=1, keepdims=True), 1e-300)
        distance[lost] = np.minimum(distance[lost], distance_around(points[lost], along, sdf))
    return distance


def sample_surface(
    surface: Surface, count: int, seed: int
) -> tuple[Int64[np.ndarray, " N"], Float64[np.ndarray, "N 3"]]:
    """Faces and barycentric coordinates of points spread evenly over the area: same seed, same points."""
    rng = np.random.default_rng(seed)
    cumulative = np.cumsum(face_areas(surface))
    # one in each of `count` equal strata
    even = (np.arange(count) + rng.random(count)) / count * cumulative[-1]
    face = np.minimum(np.searchsorted(cumulative, even), len(surface.faces) - 1)
    root, along = np.sqrt(rng.random(count)), rng.random(count)
    return face.astype(np.int64), np.stack([1 - root, root * (1 - along), root * along], axis=1)


def points_on(
    surface: Surface, face: Int64[np.ndarray, " N"], barycentric: Float64[np.ndarray, "N 3"]
) -> Float64[np.ndarray, "N 3"]:
    """Points on faces, metres."""
    return np.einsum("nc,ncd->nd", barycentric, surface.vertices[surface.faces[face]])


def to_look_at(
    distance: Float64[np.ndarray, " N"], told: Float64[np.ndarray, " N"]
) -> Bool[np.ndarray, " N"]:
    """Which points may have a nearer zero elsewhere: those where a field that rises as distances do would
    have told another one."""
    far = distance > DOUBTFUL
    agree = (distance <= DIFFERENT * told) & (told <= DIFFERENT * distance) & (distance <= FARTHEST)
    chosen = far & ~agree
    others = np.flatnonzero(far & ~chosen)
    chosen[others[np.argsort(-distance[others], kind="stable")[:LONGEST]]] = True
    return chosen


def distance_to_zero(
    points: Float64[np.ndarray, "N 3"], sdf: Field, step: float
) -> tuple[Float64[np.ndarray, " N"], Float64[np.ndarray, " N"]]:
    """Distance along the field's gradient to its zero, metres: a Newton step, then a secant step on the same
    line; infinite where this comes near no zero.

    The second array is the distance that the value tells if the field rises as it does in most places.
    """
    value = ask(sdf, points)
    ahead = ask(sdf, (points[:, None] + step * np.eye(3)).reshape(-1, 3)).reshape(-1, 3)
    gradient = (ahead - value[:, None]) / step
    slope = np.maximum(np.linalg.norm(gradient, axis=1), 1e-6)
    direction = gradient / slope[:, None]
    newton = np.clip(-value / slope, -FARTHEST, FARTHEST)
    there = ask(sdf, points + newton[:, None] * direction)
    change = np.where(np.abs(there - value) > 1e-9, there - value, 1.0)
    per_value = np.where(np.abs(there - value) > 1e-9, newton / change, 1 / slope)
    secant = newton - there * np.clip(per_value, 0.5 / slope, 2 / slope)
    last = ask(sdf, points + secant[:, None] * direction)
    lost = np.abs(last) > np.maximum(LOST * np.abs(value), NEAR_ZERO * slope)
    distance = np.where(lost, np.inf, np.abs(secant) + np.abs(last) / slope)
    return distance, np.abs(value) / (np.quantile(slope, STEEP) if len(slope) else 1.0)


def distance_around(
    points: Float64[np.ndarray, "N 3"], normals: Float64[np.ndarray, "N 3"], sdf: Field
) -> Float64[np.ndarray, " N"]:
    """Radius of the first of ever wider shells on which the field changes sign in one of 28 directions, two
    of them along the normal; narrowed down by halving. `FARTHEST` where there is none.

    The true distance is not longer, and where the zero level is smooth hardly a tenth shorter.
    """
    directions = np.concatenate(
        [np.stack([normals, -normals], axis=1), np.broadcast_to(AROUND, (len(points), *AROUND.shape))], axis=1
    )
    inside = ask(sdf, points) < 0

    def reaches(rows: Int64[np.ndarray, " K"], radius: Float64[np.ndarray, " K"]) -> Bool[np.ndarray, " K"]:
        places = points[rows, None] + radius[:, None, None] * directions[rows]
        there = ask(sdf, places.reshape(-1, 3)).reshape(places.shape[:2]) < 0
        return (there != inside[rows, None]).any(axis=1)

    low, high, rows = np.zeros(len(points)), np.full(len(points), FARTHEST), np.arange(len(points))
    for radius in np.geomspace(SHORTEST, FARTHEST, SHELLS):
        met = reaches(rows, np.full(len(rows), radius))
        high[rows[met]], low[rows[~met]] = radius, radius
        rows = rows[~met]
    rows = np.flatnonzero(low < high)
    for _ in range(HALVINGS):
        middle = (low[rows] + high[rows]) / 2
        met = reaches(rows, middle)
        high[rows[met]], low[rows[~met]] = middle[met], middle[~met]
    return high
