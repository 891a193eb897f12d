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
    b, c = weights(triangles, triangle, x + 0.5, y + 0.5)
    inside = np.flatnonzero((b >= -ON_EDGE) & (c >= -ON_EDGE) & (b + c <= 1 + ON_EDGE))
    b, c = b[inside], c[inside]
    return Fragments(
        triangle=triangle[inside],
        pixel=(y[inside] * width + x[inside]),
        barycentric=np.stack([1 - b - c, b, c], axis=1),
    )


def coordinates(
    triangles: Float64[np.ndarray, "T 3 2"],
    triangle: Int64[np.ndarray, " N"],
    points: Float64[np.ndarray, "N 2"],
) -> Float64[np.ndarray, "N 3"]:
    """Barycentric coordinates of points in triangles, outside 0..1 beyond them; NaN in triangles without
    area."""
    b, c = weights(triangles, triangle, points[:, 0], points[:, 1])
    return np.stack([1 - b - c, b, c], axis=1)


def weights(
    triangles: Float64[np.ndarray, "T 3 2"],
    triangle: Int64[np.ndarray, " N"],
    x: Float64[np.ndarray, " N"],
    y: Float64[np.ndarray, " N"],
) -> tuple[Float64[np.ndarray, " N"], Float64[np.ndarray, " N"]]:
    """Barycentric weights of the second and the third corner, linear in x and y."""
    a, u, v = triangles[:, 0], triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    area = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]
    scale = np.where(np.abs(area) > 1e-12, 1 / np.where(np.abs(area) > 1e-12, area, 1.0), np.nan)
    found = []
    for across in (np.stack([v[:, 1], -v[:, 0]]) * scale, np.stack([-u[:, 1], u[:, 0]]) * scale):
        at_origin = -(across[0] * a[:, 0] + across[1] * a[:, 1])
        found.append(across[0][triangle] * x + across[1][triangle] * y + at_origin[triangle])
    return found[0], found[1]
