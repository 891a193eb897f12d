"""From which side people are seen, and how often a picture is shown so that all sides are learned.

Photographs show people from the front; a generator that is shown little else learns no backs. The circle
around the person is cut into equal parts, and a picture's weight is that of an even spread over those parts
that any picture shows, over its part's share; no more than `MOST` times the mean.

Letters: N pictures.
"""

import numpy as np
from jaxtyping import Float, Float32, Float64, Int64

PARTS = 12  # of the circle
MOST = 5.0


def azimuths(cameras: Float[np.ndarray, "N 25"]) -> Float64[np.ndarray, " N"]:
    """Where each camera stands around the person: 0 before, +pi/2 at the person's left, radians."""
    place = cameras[:, :16].reshape(-1, 4, 4)[:, :3, 3].astype(np.float64)
    return np.arctan2(place[:, 0], place[:, 2])


def parts_of(cameras: Float[np.ndarray, "N 25"]) -> Int64[np.ndarray, " N"]:
    """The part of the circle of each camera; the first is centred before the person."""
    return np.floor(azimuths(cameras) / (2 * np.pi / PARTS) + 0.5).astype(np.int64) % PARTS


def view_weights(cameras: Float[np.ndarray, "N 25"]) -> Float32[np.ndarray, " N"]:
    """How often each picture is shown, of mean 1."""
    parts = parts_of(cameras)
    counts = np.bincount(parts, minlength=PARTS)
    even = len(parts) / np.count_nonzero(counts)
    weights = np.minimum(even / counts[parts], MOST)
    return (weights / weights.mean()).astype(np.float32)
