"""How strands of hair lie: streaks along the way that they are combed, computed from a point in space.

Hair falls from a parting, or from a whorl where that has no length, over the head and straight down; tied
hair runs to a knot behind; curls have no direction. Across the strands the pattern is random, along them it
changes slowly.

Letters: N points. Metres, canonical space.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Float64

from avatargen.compiled import compiled, inner

COMBED, TIED, CURLED = 0, 1, 2
RADIUS = 0.085  # m, about a head's: an angle times this is a way across strands
KNOT_Y, KNOT_Z = 0.745, -0.085  # m: where tied hair runs to, and what hangs behind
FINE, MIDDLE, CLUMP = 0.0017, 0.0042, 0.0105  # m across strands, tufts and locks
LONG = (0.030, 0.055, 0.110)  # m along them
CURL = (0.0045, 0.0095)  # m of curls
CENTRE = (0.0, 0.735, 0.045)  # m, of the skull
WAVE = 0.0014  # m that strands wave to and fro


@dataclass(frozen=True, kw_only=True)
class Flow:
    """How hair is combed: `kind` is one of the above; the parting lies at `x` from `back` to `front` (z)."""

    kind: int = COMBED
    x: float = 0.0
    back: float = 0.0
    front: float = 0.0

    def pattern(self, points: Float[np.ndarray, "N 3"]) -> Float64[np.ndarray, "N 3"]:
        """Strands, locks and gloss: the first two in -1..1, the last in 0..1."""
        found = np.empty((len(points), 3))
        at = np.ascontiguousarray(points, dtype=np.float64)
        fill_pattern(at, self.kind, self.x, self.back, self.front, found)
        return found


@inner
def hashed(i, j, k):
    """A random number in -1..1 for whole numbers."""
    n = (i * 374761393 + j * 668265263 + k * 974711) & 0xFFFFFFFF
    n = ((n ^ (n >> 13)) * 1274126177) & 0xFFFFFFFF
    return ((n ^ (n >> 16)) & 0xFFFF) / 32767.5 - 1.0


@inner
def noise(x, y, row):
    """Smooth random numbers in -1..1 on a plane."""
    i, j = int(np.floor(x)), int(np.floor(y))
    u, v = x - i, y - j
    u, v = u * u * (3 - 2 * u), v * v * (3 - 2 * v)
    low = hashed(i, j, row) * (1 - u) + hashed(i + 1, j, row) * u
    high = hashed(i, j + 1, row) * (1 - u) + hashed(i + 1, j + 1, row) * u
    return low * (1 - v) + high * v


@inner
def noise_in_space(x, y, z):
    """Smooth random numbers in -1..1 in space."""
    k = int(np.floor(z))
    w = z - k
    w = w * w * (3 - 2 * w)
    return noise(x, y, 7 * k) * (1 - w) + noise(x, y, 7 * k + 7) * w


@inner
def combed(x, y, z, parting, back, front):
    """Metres across the strands, along them, and the side of the parting."""
    off = z - min(max(z, back), front)
    turn = np.arctan2(abs(x - parting), off)
    across = min(max(z, back), front) + RADIUS * (0.5 * np.pi - turn)
    along = np.sqrt((x - parting) ** 2 + off * off + (y - CENTRE[1]) ** 2)
    return across, along, 1 if x > parting else 2


@inner
def tied(x, y, z):
    """The same of hair that runs to a knot behind."""
    if z < KNOT_Z or y < 0.62:
        return x - 0.3, y, 3
    return RADIUS * np.arctan2(x, y - KNOT_Y), z, 4


@compiled
def fill_pattern(points, kind, parting, back, front, found):
    """Fill in strands, locks and gloss [N 3] at points [N 3]."""
    for n in range(len(points)):
        x, y, z = points[n, 0], points[n, 1], points[n, 2]
        if kind == CURLED:
            small = noise_in_space(x / CURL[0], y / CURL[0], z / CURL[0])
            large = noise_in_space(x / CURL[1] + 9, y / CURL[1], z / CURL[1])
            found[n, 0], found[n, 1], found[n, 2] = small, large, 0.0
            continue
        if kind == TIED:
            across, along, row = tied(x, y, z)
        else:
            across, along, row = combed(x, y, z, parting, back, front)
        across += WAVE * noise(along / 0.045, across / 0.03, row + 40)
        fine = noise(across / FINE, along / LONG[0], row)
        tuft = noise(across / MIDDLE + 0.5, along / LONG[1], row + 10)
        lock = noise(across / CLUMP + 0.25, along / LONG[2], row + 20)
        found[n, 0] = 0.55 * fine + 0.45 * tuft
        found[n, 1] = lock
        up = (y - CENTRE[1]) / np.sqrt(
            (x - CENTRE[0]) ** 2 + (y - CENTRE[1]) ** 2 + (z - CENTRE[2]) ** 2 + 1e-9
        )
        ring = (up - 0.68 - 0.05 * tuft) / 0.16
        found[n, 2] = np.exp(-ring * ring)
