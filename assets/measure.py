"""How far a mesh is from the zero level of a field: sampled evenly over its area, in millimetres."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int64

from assets.field import Field, ask
from assets.surface import Surface, face_areas

SECANT_STEPS = 2


@dataclass(frozen=True, kw_only=True)
class MeasureConfig:
    """Six questions to the field a sample."""

    samples: int = 25_000
    step: float = 2.5e-4  # metres, of the finite differences
    seed: int = 0


@dataclass(frozen=True, kw_only=True)
class SurfaceError:
    """Distance from the mesh to the zero level, millimetres."""

    mean_mm: float
    p99_mm: float
    max_mm: float


def surface_error(surface: Surface, sdf: Field, config: MeasureConfig | None = None) -> SurfaceError:
    """Mean, 99th percentile and largest distance from samples on the mesh to the zero level of `sdf`.

    Raises:
        FieldError: the field is NaN or infinite.
    """
    config = config or MeasureConfig()
    face, barycentric = sample_surface(surface, config.samples, config.seed)
    distance = 1000 * distance_to_zero(points_on(surface, face, barycentric), sdf, config.step)
    return SurfaceError(
        mean_mm=float(distance.mean()),
        p99_mm=float(np.quantile(distance, 0.99)),
        max_mm=float(distance.max()),
    )


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


def distance_to_zero(
    points: Float64[np.ndarray, "N 3"], sdf: Field, step: float
) -> Float64[np.ndarray, " N"]:
    """Distance along the field's gradient to its zero, metres: a Newton step, then secant steps on the same
    line.

    What is left of the field at the end is added, so a search that does not end well counts as far, not as
    near.
    """
    value = ask(sdf, points)
    ahead = ask(sdf, (points[:, None] + step * np.eye(3)).reshape(-1, 3)).reshape(-1, 3)
    gradient = (ahead - value[:, None]) / step
    slope = np.maximum(np.linalg.norm(gradient, axis=1), 0.1)
    direction = gradient / slope[:, None]
    before, at_before = np.zeros(len(points)), value
    here = -value / slope
    at_here = ask(sdf, points + here[:, None] * direction)
    for _ in range(SECANT_STEPS - 1):
        change = at_here - at_before
        useful = np.abs(change) > 1e-9
        secant = np.where(useful, (here - before) / np.where(useful, change, 1.0), 1 / slope)
        # within half and twice the Newton step, so that noise cannot throw it
        secant = np.clip(secant, 0.5 / slope, 2 / slope)
        before, at_before, here = here, at_here, here - at_here * secant
        at_here = ask(sdf, points + here[:, None] * direction)
    return np.abs(here) + np.abs(at_here) / slope
