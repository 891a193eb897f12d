"""What a mesh is compared with: points on the zero level of an avatar's field, their normals and colours.

They come from a finer extraction than any that is measured, moved onto the zero level by Newton steps. Errors
are measured from these points to the mesh; `assets.mesh.measure` goes the other way.

Letters: N points, V vertices, F faces. Canonical space, metres.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Float64, Int64, UInt8

from assets.field import Field, ask
from assets.isosurface.extract import ExtractConfig, extract
from assets.mesh.clean import clean
from assets.mesh.surface import Surface, vertex_normals
from assets.texture.atlas import Atlas
from avatargen.body.distance import BodyDistance

STEP = 2.5e-4  # metres, of the differences that give the gradient
ON_ZERO = 2e-6  # metres from the zero level at which a point counts as on it
NEWTON_STEPS = 3
LONGEST_STEP = 2e-3  # metres


@dataclass(frozen=True, kw_only=True)
class Truth:
    """Points spread over the zero level."""

    points: Float64[np.ndarray, "N 3"]
    normals: Float64[np.ndarray, "N 3"]  # unit gradients
    colors: Float64[np.ndarray, "N 3"]  # sRGB


@dataclass(frozen=True, kw_only=True)
class Match:
    """The closest places of a mesh to the true points."""

    distance: Float64[np.ndarray, " N"]
    face: Int64[np.ndarray, " N"]
    barycentric: Float64[np.ndarray, "N 3"]


def find_truth(
    sdf: Field, color: Field, bounds: Float[np.ndarray, "2 3"], resolution: int, count: int, seed: int = 0
) -> Truth:
    """Points of the zero level, from `count` vertices of a fine extraction.

    Points that no step brings onto the level (the field is not smooth there) are left out.
    """
    surface = clean(extract(sdf, bounds, ExtractConfig(resolution=resolution))).surface
    chosen = np.random.default_rng(seed).permutation(len(surface.vertices))[:count]
    points, normals, off = project(surface.vertices[np.sort(chosen)], sdf)
    points, normals = points[off < ON_ZERO], normals[off < ON_ZERO]
    return Truth(points=points, normals=normals, colors=np.clip(ask(color, points, 3), 0, 1))


def project(
    points: Float64[np.ndarray, "N 3"], sdf: Field
) -> tuple[Float64[np.ndarray, "N 3"], Float64[np.ndarray, "N 3"], Float64[np.ndarray, " N"]]:
    """Points moved towards the zero level, the unit gradients there, and how far off they still are."""
    for _ in range(NEWTON_STEPS):
        value, slope, direction = gradient(points, sdf)
        points = points - np.clip(value / slope, -LONGEST_STEP, LONGEST_STEP)[:, None] * direction
    value, slope, direction = gradient(points, sdf)
    return points, direction, np.abs(value) / slope


def gradient(
    points: Float64[np.ndarray, "N 3"], sdf: Field
) -> tuple[Float64[np.ndarray, " N"], Float64[np.ndarray, " N"], Float64[np.ndarray, "N 3"]]:
    """Value, slope and unit direction of the field's central differences."""
    steps = np.concatenate([np.eye(3), -np.eye(3), np.zeros((1, 3))]) * STEP
    values = ask(sdf, (points[:, None] + steps).reshape(-1, 3)).reshape(len(points), 7)
    rise = (values[:, :3] - values[:, 3:6]) / (2 * STEP)
    slope = np.maximum(np.linalg.norm(rise, axis=1), 1e-3)
    return values[:, 6], slope, rise / slope[:, None]


def match(truth: Truth, surface: Surface) -> Match:
    """The closest point of a mesh to each true point."""
    hit = BodyDistance(surface.vertices, surface.faces).query(truth.points)
    return Match(
        distance=np.abs(hit.distance).astype(np.float64),
        face=hit.face,
        barycentric=hit.barycentric.astype(np.float64),
    )


def normal_errors(truth: Truth, surface: Surface, found: Match) -> Float64[np.ndarray, " N"]:
    """Degrees between the mesh's shading normals and the field's gradient."""
    normals = vertex_normals(surface)[surface.faces[found.face]]
    shading = np.einsum("nc,ncd->nd", found.barycentric, normals)
    shading /= np.maximum(np.linalg.norm(shading, axis=1, keepdims=True), 1e-12)
    cosine = np.einsum("nd,nd->n", shading, truth.normals)
    return np.degrees(np.arccos(np.clip(cosine, -1, 1)))


def texture_psnr(truth: Truth, atlas: Atlas, texels: UInt8[np.ndarray, "S S 3"], found: Match) -> float:
    """Peak signal to noise ratio of the filtered texture at the closest places, dB."""
    uv = np.einsum("nc,ncd->nd", found.barycentric, atlas.uv[atlas.faces[found.face]].astype(np.float64))
    error = sample(texels, uv) - truth.colors
    return float(-10 * np.log10(max(np.mean(error**2), 1e-12)))


def sample(texels: UInt8[np.ndarray, "S S 3"], uv: Float64[np.ndarray, "N 2"]) -> Float64[np.ndarray, "N 3"]:
    """Bilinear filtering, sRGB in 0..1."""
    size = len(texels)
    place = np.clip(uv * size - 0.5, 0, size - 1)
    low = np.minimum(place.astype(np.int64), size - 2)
    t = (place - low)[:, :, None]
    corner = [texels[low[:, 1] + dy, low[:, 0] + dx] / 255.0 for dy in (0, 1) for dx in (0, 1)]
    upper = corner[0] * (1 - t[:, 0]) + corner[1] * t[:, 0]
    lower = corner[2] * (1 - t[:, 0]) + corner[3] * t[:, 0]
    return upper * (1 - t[:, 1]) + lower * t[:, 1]
