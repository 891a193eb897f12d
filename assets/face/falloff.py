"""How much of a motion reaches a place: a curve from 1 to 0, of any array."""

import numpy as np


def bell(distance: np.ndarray, width: float) -> np.ndarray:
    """1 at no distance, 1/e at the width, soon nothing."""
    return np.exp(-((distance / width) ** 2))
