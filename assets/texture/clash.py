"""Whether triangles in the plane lie over each other, exactly, by compiled loops."""

import numpy as np

from avatargen.compiled import inner


@inner
def apart(one, other, least):
    """Whether a line along an edge of one of two triangles [3 2] parts them by at least so much."""
    for which in range(2):
        a, b = (one, other) if which == 0 else (other, one)
        for i in range(3):
            j = (i + 1) % 3
            nx, ny = a[j, 1] - a[i, 1], a[i, 0] - a[j, 0]  # outward, counter-clockwise as they are
            length = max(np.sqrt(nx * nx + ny * ny), 1e-30)
            gap = np.inf
            for k in range(3):
                gap = min(gap, (nx * (b[k, 0] - a[i, 0]) + ny * (b[k, 1] - a[i, 1])) / length)
            if gap >= least:
                return True
    return False


@inner
def boxes(corners):
    """[N 4] the least x and y, and the largest, of triangles [N 3 2]."""
    found = np.empty((len(corners), 4))
    for n in range(len(corners)):
        for k in range(2):
            a, b, c = corners[n, 0, k], corners[n, 1, k], corners[n, 2, k]
            found[n, k], found[n, 2 + k] = min(a, b, c), max(a, b, c)
    return found


@inner
def clash(corners, others, own, clear, touching):
    """Whether one of the first triangles [N 3 2], `own`, comes nearer than `clear` to one of others [N 3 2],
    or one of the rest nearer than `touching`, or one of them all so near to another."""
    box, beyond, count = boxes(corners), boxes(others), len(corners)
    left, low, right, high = np.inf, np.inf, -np.inf, -np.inf
    for n in range(count):
        left, low = min(left, box[n, 0] - clear), min(low, box[n, 1] - clear)
        right, high = max(right, box[n, 2] + clear), max(high, box[n, 3] + clear)
    for m in range(count + len(others)):
        other, there = (corners[m], box[m]) if m < count else (others[m - count], beyond[m - count])
        x, y, u, v = there[0] - clear, there[1] - clear, there[2] + clear, there[3] + clear
        if x > right or y > high or u < left or v < low:
            continue
        near = False
        for n in range(min(m, count)):
            if box[n, 0] <= u and box[n, 2] >= x and box[n, 1] <= v and box[n, 3] >= y:
                near |= not apart(corners[n], other, clear if m >= count and n < own else touching)
        if near:
            return True
    return False
