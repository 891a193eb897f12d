"""Points on textured triangles, and texels at texture coordinates (from the top left)."""

import numpy as np
from jaxtyping import Float, Float64, Int64, UInt8


def texels(texture: UInt8[np.ndarray, "H W C"], uv: Float[np.ndarray, "N 2"]) -> Float64[np.ndarray, "N C"]:
    """Bilinear texture values in 0..1; outside the texture it repeats."""
    height, width = texture.shape[:2]
    x, y = uv[:, 0] * width - 0.5, uv[:, 1] * height - 0.5
    x0, y0 = np.floor(x).astype(np.int64), np.floor(y).astype(np.int64)
    fx, fy = (x - x0)[:, None], (y - y0)[:, None]
    x0, x1, y0, y1 = x0 % width, (x0 + 1) % width, y0 % height, (y0 + 1) % height
    above = texture[y0, x0] * (1 - fx) + texture[y0, x1] * fx
    below = texture[y1, x0] * (1 - fx) + texture[y1, x1] * fx
    return (above * (1 - fy) + below * fy) / 255


def sample_surface(
    vertices: Float[np.ndarray, "V 3"],
    faces: Int64[np.ndarray, "F 3"],
    uv: Float[np.ndarray, "F 3 2"],
    spacing: float,
) -> tuple[Float64[np.ndarray, "S 3"], Float64[np.ndarray, "S 2"]]:
    """Points no further than `spacing` (m) apart on every triangle, with their texture coordinates."""
    corners = vertices[faces].astype(np.float64)
    edges = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    steps = np.ceil(edges / spacing).astype(np.int64).clip(1, 400)
    points, coordinates = [], []
    for count in np.unique(steps):
        i, j = np.meshgrid(np.arange(count + 1), np.arange(count + 1), indexing="ij")
        inside = i + j <= count
        b = np.stack([i[inside], j[inside], (count - i - j)[inside]], axis=1) / count
        of = steps == count
        points.append(np.einsum("bk,fka->fba", b, corners[of]).reshape(-1, 3))
        coordinates.append(np.einsum("bk,fka->fba", b, uv[of].astype(np.float64)).reshape(-1, 2))
    return np.concatenate(points), np.concatenate(coordinates)
