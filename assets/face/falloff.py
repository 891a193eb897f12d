"""How much of a motion reaches a place: curves from 1 to 0. Standard shapes, of any array."""

import numpy as np


def smooth(x: np.ndarray, low: float, high: float) -> np.ndarray:
    """Smoothstep from 0 at low to 1 at high."""
    t = np.clip((x - low) / (high - low), 0, 1)
    return t * t * (3 - 2 * t)


def bell(distance: np.ndarray, width: float) -> np.ndarray:
    """1 at no distance, 1/e at the width, soon nothing."""
    return np.exp(-((distance / width) ** 2))
