"""Where the lips meet on the default body, in its canonical space."""

import numpy as np
from jaxtyping import Float32, Float64

from avatargen.smoothstep import smoothstep

LIPS_Y, LIPS_HALF = 0.6508, 0.0255  # m: where they meet, and how far to the corners
LIPS_GAP = 0.0022  # m by which what is between them is filled: a slit thinner than a mesh's cells is torn


def between_lips(points: Float32[np.ndarray, "N 3"]) -> Float64[np.ndarray, " N"]:
    """Metres by which the skin stands out of the body where the lips meet."""
    found = np.zeros(len(points))
    near = np.flatnonzero((np.abs(points[:, 0]) < LIPS_HALF) & (points[:, 2] > 0.10))
    x, y, z = points[near].astype(np.float64).T
    across = smoothstep(LIPS_HALF - np.abs(x), 0.0, 0.01) * smoothstep(z, 0.10, 0.12)
    found[near] = LIPS_GAP * across * np.exp(-(((y - LIPS_Y) / 0.0045) ** 2))
    return found
