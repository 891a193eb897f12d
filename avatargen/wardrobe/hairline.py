"""Where hair grows on the default body's head: a line around it, and how far within the line skin is.

The head is unrolled about an upright axis: u metres round from the middle of the forehead, y upward. The line
goes over the forehead and the temple, down before the ear, over it and round behind it to the nape.

Letters: N points, K corners of the line. Metres, canonical space.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float64

from avatargen.compiled import compiled, inner

AXIS_Z, AROUND = 0.045, 0.085  # m: where the axis stands, and the radius that angles are measured at
LINE = np.array(
    [
        [-0.02, 0.7900],
        [0.015, 0.7895],  # forehead
        [0.038, 0.7930],
        [0.056, 0.7960],  # temple
        [0.074, 0.7800],
        [0.086, 0.7560],
        [0.093, 0.7300],
        [0.096, 0.7040],
        [0.099, 0.6990],  # sideburn
        [0.108, 0.6990],
        [0.111, 0.7040],
        [0.114, 0.7320],
        [0.134, 0.7390],  # over the ear
        [0.154, 0.7320],
        [0.164, 0.7000],
        [0.172, 0.6600],
        [0.190, 0.6390],
        [0.230, 0.6320],
        [0.300, 0.6300],  # nape
    ]
)
FOREHEAD, TEMPLE = (0.0, 0.075), (0.058, 0.028)  # m round the head: where and how wide the line recedes
HIGHEST = 0.83  # m that no line reaches
WIDE = 0.16  # m from the axis, beyond which there is no head


@dataclass(frozen=True, kw_only=True)
class Hairline:
    """One person's line. It lies `raised` metres higher on the forehead than usual, and `receded` metres more
    on the temples."""

    raised: float = 0.0
    receded: float = 0.0

    @cached_property
    def corners(self) -> Float64[np.ndarray, "K 2"]:
        """Its corners, (u, y)."""
        line = LINE.copy()
        front = line[:, 0] < 0.09
        up = self.raised * np.exp(-((line[:, 0] / FOREHEAD[1]) ** 2))
        up += self.receded * np.exp(-(((line[:, 0] - TEMPLE[0]) / TEMPLE[1]) ** 2))
        line[front, 1] = np.minimum(line[front, 1] + up[front], HIGHEST)
        return line

    def within(self, points: Float64[np.ndarray, "N 3"]) -> Float64[np.ndarray, " N"]:
        """How far within the line points of the skin are, m, negative outside."""
        found = np.empty(len(points))
        fill_within(np.ascontiguousarray(points, dtype=np.float64), self.corners, found)
        return found


@inner
def way_within(x, y, z, line):
    """How far a point lies within a line [K 2], m, negative outside."""
    if x * x + (z - AXIS_Z) ** 2 > WIDE * WIDE:
        return -1.0
    u = AROUND * abs(np.arctan2(x, z - AXIS_Z))
    nearest, inside = 1.0, False
    for k in range(len(line) - 1):
        across, up = line[k + 1, 0] - line[k, 0], line[k + 1, 1] - line[k, 1]
        off, over = u - line[k, 0], y - line[k, 1]
        share = min(max((off * across + over * up) / (across * across + up * up), 0.0), 1.0)
        nearest = min(nearest, (off - share * across) ** 2 + (over - share * up) ** 2)
        if line[k, 0] <= u < line[k + 1, 0]:
            inside = over > up * off / across
    return np.sqrt(nearest) if inside else -np.sqrt(nearest)


@compiled
def fill_within(points, line, found):
    """Fill in how far points [N 3] lie within a line [K 2]."""
    for i in range(len(points)):
        found[i] = way_within(points[i, 0], points[i, 1], points[i, 2], line)
