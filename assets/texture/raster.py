"""Which pixels a triangle covers, for textures and preview pictures.

Letters: T triangles, N fragments (a triangle over the centre of a pixel), S pixels along a side. Positions
are in pixels, x right and y down from the top left corner; the centre of pixel (x, y) is at (x + 0.5, y +
0.5).
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int64

from avatargen.compiled import compiled

MOST_PIXELS = 4_000_000  # looked at in one go, for 160 MB of fragments
ON_EDGE = 1e-7  # barycentric: centres this far outside an edge count as covered, so neighbours leave no gap
FLAT = 1e-12  # square pixels, at or under which a triangle has no area


@dataclass(frozen=True, kw_only=True)
class Fragments:
    """Pixels whose centres lie under triangles; one pixel may occur under several."""

    triangle: Int64[np.ndarray, " N"]
    pixel: Int64[np.ndarray, " N"]  # y * width + x
    barycentric: Float64[np.ndarray, "N 3"]


def rasterise(triangles: Float64[np.ndarray, "T 3 2"], width: int, height: int) -> Iterator[Fragments]:
    """Fragments of triangles (pixels) in a picture of width x height pixels, in the triangles' order, in
    pieces of bounded size."""
    if len(triangles) == 0:
        return
    low = np.clip(np.ceil(triangles.min(axis=1) - 0.5), 0, [width, height]).astype(np.int64)
    high = np.clip(np.floor(triangles.max(axis=1) - 0.5), -1, [width - 1, height - 1]).astype(np.int64)
    pixels = np.maximum(high - low + 1, 0).prod(axis=1)
    weights = linear_weights(triangles)
    piece = np.cumsum(pixels) // MOST_PIXELS
    starts = np.flatnonzero(np.diff(piece, prepend=-1))
    for first, last in zip(starts, [*starts[1:], len(pixels)], strict=True):
        most = int(pixels[first:last].sum())
        triangle, pixel = np.empty(most, np.int64), np.empty(most, np.int64)
        barycentric = np.empty((most, 3))
        count = cover(weights, low, high, first, last, width, triangle, pixel, barycentric)
        yield Fragments(triangle=triangle[:count], pixel=pixel[:count], barycentric=barycentric[:count])


@compiled
def cover(weights, low, high, first, last, width, triangle, pixel, barycentric):
    """Fill in the fragments of the triangles from `first` to `last`; returns how many there are.

    `weights` [T 2 3] as `linear_weights` makes them; `low` and `high` [T 2] are the first and last column and
    row of pixels to look at; `triangle` [N], `pixel` [N] and `barycentric` [N 3] have room for all of these.
    """
    count = 0
    for t in range(first, last):
        bx, by, b0 = weights[t, 0, 0], weights[t, 0, 1], weights[t, 0, 2]
        cx, cy, c0 = weights[t, 1, 0], weights[t, 1, 1], weights[t, 1, 2]
        for row in range(low[t, 1], high[t, 1] + 1):
            for column in range(low[t, 0], high[t, 0] + 1):
                x, y = column + 0.5, row + 0.5
                b, c = bx * x + by * y + b0, cx * x + cy * y + c0
                if b >= -ON_EDGE and c >= -ON_EDGE and b + c <= 1 + ON_EDGE:
                    triangle[count], pixel[count] = t, row * width + column
                    barycentric[count, 0], barycentric[count, 1], barycentric[count, 2] = 1 - b - c, b, c
                    count += 1
    return count


def coordinates(
    triangles: Float64[np.ndarray, "T 3 2"],
    triangle: Int64[np.ndarray, " N"],
    points: Float64[np.ndarray, "N 2"],
) -> Float64[np.ndarray, "N 3"]:
    """Barycentric coordinates of points (pixels), each in the triangle of the number beside it; outside 0..1
    beyond it, NaN where it has no area."""
    x, y = np.ascontiguousarray(points.T)
    weights = np.ascontiguousarray(linear_weights(triangles).transpose(1, 2, 0))
    b, c = (by_x[triangle] * x + by_y[triangle] * y + rest[triangle] for by_x, by_y, rest in weights)
    return np.stack([1 - b - c, b, c], axis=1)


def linear_weights(triangles: Float64[np.ndarray, "T 3 2"]) -> Float64[np.ndarray, "T 2 3"]:
    """Barycentric coordinates of the second and the third corner as linear functions: what x, y and 1 count;
    NaN for triangles without area."""
    a, u, v = triangles[:, 0], triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    area = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]
    scale = np.where(np.abs(area) > FLAT, 1 / np.where(np.abs(area) > FLAT, area, 1.0), np.nan)
    slopes = np.stack([v[:, 1], -v[:, 0], -u[:, 1], u[:, 0]], axis=1).reshape(-1, 2, 2)
    slopes = slopes * scale[:, None, None]
    return np.concatenate([slopes, -(slopes @ a[:, :, None])], axis=2)
