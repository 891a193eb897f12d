"""The step with level ends by which one thing fades into another."""

import numpy as np


def smoothstep(x: np.ndarray, low: float = 0.0, high: float = 1.0) -> np.ndarray:
    """From 0 at `low` to 1 at `high`, level at both and beyond."""
    t = np.clip((x - low) / (high - low), 0, 1)
    return t * t * (3 - 2 * t)
