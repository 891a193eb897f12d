"""Tangents for normal maps, by the rule that viewers follow where a file has none (MikkTSpace, Mikkelsen
2008): a vertex's tangent is the mean of its faces' directions of growing u, each laid into the plane of the
vertex's normal and weighted by the face's angle there.

The bitangent is cross(normal, tangent) * w and points up in the texture: w is 1 where the chart shows the
surface as seen from outside and -1 where it shows it mirrored. Letters: W vertices split at the seams, F
faces.
"""

import numpy as np
from jaxtyping import Float32, Float64

from assets.mesh.surface import Surface, sum_at_vertices

TINY = 1e-30


def find_tangents(
    surface: Surface, normals: Float64[np.ndarray, "W 3"], uv: Float64[np.ndarray, "W 2"]
) -> Float32[np.ndarray, "W 4"]:
    """Unit tangents across the normals, and w, of the split surface; uv origin at the texture's top left."""
    along, handed = u_directions(surface, uv)
    at_corner = normals[surface.faces]  # F 3 3
    angle = angles_around(surface, at_corner)
    flat = across(np.broadcast_to(along[:, None], at_corner.shape), at_corner)
    votes = sum_at_vertices(surface, (angle * handed[:, None])[..., None])[:, 0]
    w = np.where(votes < 0, -1.0, 1.0)
    agrees = handed[:, None] == w[surface.faces]  # a face turned over counts only where most are
    total = across(sum_at_vertices(surface, (angle * agrees)[..., None] * flat), normals)
    lost = np.linalg.norm(total, axis=1) < 0.5
    total[lost] = across(np.eye(3)[np.abs(normals[lost]).argmin(axis=1)], normals[lost])
    return np.concatenate([total, w[:, None]], axis=1).astype(np.float32)


def u_directions(
    surface: Surface, uv: Float64[np.ndarray, "W 2"]
) -> tuple[Float64[np.ndarray, "F 3"], Float64[np.ndarray, " F"]]:
    """Unit direction of growing u on each face, and whether its chart mirrors (-1) or not (1); 0 for both
    where a face has no area in the texture."""
    corners, places = surface.vertices[surface.faces], (uv * [1, -1])[surface.faces]  # v up
    (p, q), (s, t) = (np.moveaxis(x[:, 1:] - x[:, :1], 1, 0) for x in (corners, places))
    area = s[:, 0] * t[:, 1] - s[:, 1] * t[:, 0]
    handed = np.where(np.abs(area) > TINY, np.sign(area), 0.0)
    along = t[:, 1:] * p - s[:, 1:] * q
    length = np.linalg.norm(along, axis=1, keepdims=True)
    return handed[:, None] * along / np.maximum(length, TINY), handed


def angles_around(surface: Surface, normals: Float64[np.ndarray, "F 3 3"]) -> Float64[np.ndarray, "F 3"]:
    """Angle of each face at each corner, seen along the vertex's normal, radians."""
    corners = surface.vertices[surface.faces]
    forward, backward = (across(np.roll(corners, turn, axis=1) - corners, normals) for turn in (-1, 1))
    return np.arccos(np.clip((forward * backward).sum(axis=-1), -1, 1))


def across(
    vectors: Float64[np.ndarray, "*N 3"], normals: Float64[np.ndarray, "*N 3"]
) -> Float64[np.ndarray, "*N 3"]:
    """Unit parts of vectors across unit normals; zero where there is none."""
    flat = vectors - (vectors * normals).sum(axis=-1, keepdims=True) * normals
    length = np.linalg.norm(flat, axis=-1, keepdims=True)
    return np.where(length > TINY, flat / np.maximum(length, TINY), 0.0)
