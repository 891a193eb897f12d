"""Which pixels a triangle covers, for textures and preview pictures: plain numpy, all triangles at once.

Letters: T triangles, N fragments (a triangle over the centre of a pixel), S pixels along a side. Positions
are in pixels, x right and y down from the top left corner; the centre of pixel (x, y) is at (x + 0.5, y +
0.5).
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int64

MOST_PIXELS = 4_000_000  # looked at in one go
ON_EDGE = 1e-7  # in barycentric coordinates: neighbours leave no gap between them


@dataclass(frozen=True, kw_only=True)
class Fragments:
    """Pixels under triangles; one pixel may occur under several."""

    triangle: Int64[np.ndarray, " N"]
    pixel: Int64[np.ndarray, " N"]  # y * width + x
    barycentric: Float64[np.ndarray, "N 3"]


def rasterise(triangles: Float64[np.ndarray, "T 3 2"], width: int, height: int) -> Iterator[Fragments]:
    """Fragments of triangles inside a picture, in the triangles' order, in pieces of bounded size."""
    if len(triangles) == 0:
        return
    low = np.clip(np.ceil(triangles.min(axis=1) - 0.5), 0, [width, height]).astype(np.int64)
    high = np.clip(np.floor(triangles.max(axis=1) - 0.5), -1, [width - 1, height - 1]).astype(np.int64)
    extent = np.maximum(high - low + 1, 0)
    pixels = extent.prod(axis=1)
    piece = np.cumsum(pixels) // MOST_PIXELS
    starts = np.flatnonzero(np.diff(piece, prepend=-1))
    for first, last in zip(starts, [*starts[1:], len(pixels)], strict=True):
        chosen = np.arange(first, last)
        yield cover(triangles, low, extent, chosen, width)


def cover(
    triangles: Float64[np.ndarray, "T 3 2"],
    low: Int64[np.ndarray, "T 2"],
    extent: Int64[np.ndarray, "T 2"],
    chosen: Int64[np.ndarray, " K"],
    width: int,
) -> Fragments:
    """Fragments of the chosen triangles, out of the boxes of pixels around them."""
    counts = extent[chosen].prod(axis=1)
    triangle = np.repeat(chosen, counts)
    within = np.arange(len(triangle)) - np.repeat(np.cumsum(counts) - counts, counts)
    row, column = np.divmod(within, np.maximum(extent[triangle, 0], 1))
    x, y = low[triangle, 0] + column, low[triangle, 1] + row
    barycentric = coordinates(triangles, triangle, np.stack([x, y], axis=1) + 0.5)
    inside = (barycentric >= -ON_EDGE).all(axis=1)
    return Fragments(
        triangle=triangle[inside], pixel=(y * width + x)[inside], barycentric=barycentric[inside]
    )


def coordinates(
    triangles: Float64[np.ndarray, "T 3 2"],
    triangle: Int64[np.ndarray, " N"],
    points: Float64[np.ndarray, "N 2"],
) -> Float64[np.ndarray, "N 3"]:
    """Barycentric coordinates of points in triangles, outside 0..1 beyond them; -1 in triangles without
    area."""
    a, b, c = (triangles[:, corner] for corner in range(3))
    u, v = b - a, c - a
    area = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]
    scale = np.where(np.abs(area) > 1e-12, 1 / np.where(np.abs(area) > 1e-12, area, 1.0), np.nan)
    second = np.stack([v[:, 1], -v[:, 0]], axis=1) * scale[:, None]  # T 2: weight of b grows along it
    third = np.stack([-u[:, 1], u[:, 0]], axis=1) * scale[:, None]
    from_a = points - a[triangle]
    weight_b = np.einsum("nd,nd->n", from_a, second[triangle])
    weight_c = np.einsum("nd,nd->n", from_a, third[triangle])
    return np.stack([1 - weight_b - weight_c, weight_b, weight_c], axis=1)
