"""Where the lips meet on the default body, in its canonical space."""

import numpy as np
from jaxtyping import Float32, Float64

LIPS_Y, LIPS_HALF = 0.6508, 0.0255  # m: where they meet, and how far to the corners
LIPS_GAP = 0.0022  # m by which what is between them is filled: a slit thinner than a mesh's cells is torn


def smooth(x: np.ndarray, low: float, high: float) -> np.ndarray:
    """Smoothstep from 0 at low to 1 at high."""
    t = np.clip((x - low) / (high - low), 0, 1)
    return t * t * (3 - 2 * t)


def between_lips(points: Float32[np.ndarray, "N 3"]) -> Float64[np.ndarray, " N"]:
    """Metres by which the skin stands out of the body where the lips meet."""
    found = np.zeros(len(points))
    near = np.flatnonzero((np.abs(points[:, 0]) < LIPS_HALF) & (points[:, 2] > 0.10))
    x, y, z = points[near].astype(np.float64).T
    across = smooth(LIPS_HALF - np.abs(x), 0.0, 0.01) * smooth(z, 0.10, 0.12)
    found[near] = LIPS_GAP * across * np.exp(-(((y - LIPS_Y) / 0.0045) ** 2))
    return found
