"""Which faces of a flat chart lie over each other, as the texels of a picture see it.

Letters: F faces, C charts, N pairs of faces, T texels.
"""

import numpy as np
from jaxtyping import Float64, Int64

from avatargen.compiled import compiled

INSIDE = 1e-3  # barycentric: how far inside two faces a texel's centre is that they share
NONE = -1


def find_overlaps(
    triangles: Float64[np.ndarray, "F 3 2"], chart: Int64[np.ndarray, " F"]
) -> Int64[np.ndarray, "N 2"]:
    """Pairs of faces (texels) of one chart that both lie over a texel's centre; not all of them where there
    are more pairs than faces. Each chart is looked at alone."""
    if len(triangles) == 0:
        return np.zeros((0, 2), dtype=np.int64)
    count = int(chart.max()) + 1
    low, high = np.full((count, 2), np.inf), np.full((count, 2), -np.inf)
    find_boxes(triangles, chart, low, high)
    present = np.isfinite(low[:, 0])
    chart, low, high = (np.cumsum(present) - 1)[chart], low[present], high[present]
    width, height = (np.ceil(high - low) + 1).astype(np.int64).T
    texels = width * height
    above = np.full(int(texels.sum()), NONE, dtype=np.int32)
    pairs = np.empty((len(triangles), 2), dtype=np.int64)
    found = look(triangles, chart, low, np.cumsum(texels) - texels, width, height, above, pairs)
    return np.stack(np.divmod(np.unique(pairs[:found] @ [len(triangles), 1]), len(triangles)), axis=1)


@compiled
def find_boxes(triangles, chart, low, high):
    """Write the least and the largest corner of each chart of triangles [F 3 2] into `low`, `high` [C 2]."""
    for t in range(len(triangles)):
        for i in range(3):
            for k in range(2):
                low[chart[t], k] = min(low[chart[t], k], triangles[t, i, k])
                high[chart[t], k] = max(high[chart[t], k], triangles[t, i, k])


@compiled
def look(triangles, chart, low, begin, width, height, above, pairs):
    """Write the triangles [F 3 2], one after the other, over the texels [T] whose centres they hold, where
    those of their charts `begin` [C], so many wide and high [C], with the corner `low` [C 2], and each pair
    of a triangle and another above it into `pairs` [N 2]; returns how many there are."""
    count = 0
    for t in range(len(triangles)):
        ax, ay = triangles[t, 0, 0], triangles[t, 0, 1]
        ux, uy = triangles[t, 1, 0] - ax, triangles[t, 1, 1] - ay
        vx, vy = triangles[t, 2, 0] - ax, triangles[t, 2, 1] - ay
        one = chart[t]
        ax, ay = ax - low[one, 0], ay - low[one, 1]
        area = ux * vy - uy * vx
        if area == 0:
            continue
        top, bottom = ay + min(0.0, uy, vy), ay + max(0.0, uy, vy)
        left, right = ax + min(0.0, ux, vx), ax + max(0.0, ux, vx)
        last = NONE
        for row in range(int(top), min(int(bottom) + 1, height[one])):
            y = row + 0.5 - ay
            first, end = left - ax, right - ax  # where b, c and 1 - b - c are more than a little, from x to x
            for slope, rest in ((vy, -y * vx), (-uy, y * ux), (uy - vy, area - y * (ux - vx))):
                rest = rest / area - INSIDE
                if slope / area > 0:
                    first = max(first, -rest * area / slope)
                elif slope / area < 0:
                    end = min(end, -rest * area / slope)
                elif rest <= 0:
                    end = first - 1
            for column in range(int(np.ceil(first + ax - 0.5)), int(np.floor(end + ax - 0.5)) + 1):
                texel = begin[one] + row * width[one] + column
                other = above[texel]
                if other != NONE and other != last and count < len(pairs):
                    pairs[count, 0], pairs[count, 1] = other, t
                    count += 1
                    last = other
                above[texel] = t
    return count
