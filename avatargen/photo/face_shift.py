"""Where a photograph has each feature of a face that the fitted head has elsewhere.

The face network looks at the photograph and at the person as built, in the photograph's camera. Its landmarks
are the same places of both faces; between them their ways are averaged, and beside the face they fade out.

Letters: M landmarks, T places, H W pixels.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64
from scipy.spatial import KDTree

NEAREST = 12  # landmarks that a place goes by
FADING = (0.12, 0.45)  # of the face's size, from its landmarks, between which ways fade out
FARTHEST = 0.5  # of the face's size: faces farther apart are not the same one


@dataclass(frozen=True, kw_only=True, eq=False)
class FaceShift:
    """Landmarks of the built face, pixels, and how far those of the photograph lie from them."""

    places: Float64[np.ndarray, "M 2"]
    ways: Float64[np.ndarray, "M 2"]
    size: float

    def at(self, places: Float64[np.ndarray, "T 2"]) -> Float64[np.ndarray, "T 2"]:
        """How far from places of the picture the photograph has what belongs there, pixels."""
        found = np.zeros_like(places)
        low, high = self.places.min(axis=0) - self.size, self.places.max(axis=0) + self.size
        near = np.flatnonzero(((places > low) & (places < high)).all(axis=1))
        if not len(near):
            return found
        apart, rows = KDTree(self.places).query(places[near], k=NEAREST)
        soft = np.maximum(apart[:, -1:] / 2, 1e-6)
        weights = np.exp(-((apart / soft) ** 2))
        ways = np.einsum("tk,tkd->td", weights, self.ways[rows]) / weights.sum(axis=1, keepdims=True)
        found[near] = ways * self.fading(apart[:, 0])[:, None]
        return found

    def fading(self, apart: Float64[np.ndarray, " T"]) -> Float64[np.ndarray, " T"]:
        """1 at the face's landmarks, less and less beside it, by pixels from the nearest one."""
        left = 1 - np.clip((apart / self.size - FADING[0]) / (FADING[1] - FADING[0]), 0, 1)
        return left * left * (3 - 2 * left)

    def cover(self, height: int, width: int) -> Float64[np.ndarray, "H W"]:
        """Where the photograph has the face, 0..1."""
        found = np.zeros((height, width))
        places = self.places + self.ways
        margin = FADING[1] * self.size
        low = np.maximum(np.floor(places.min(axis=0) - margin), 0).astype(int)
        high = np.minimum(np.ceil(places.max(axis=0) + margin), [width, height]).astype(int)
        if (high <= low).any():
            return found
        y, x = np.mgrid[low[1] : high[1], low[0] : high[0]]
        apart, _ = KDTree(places).query(np.stack([x, y], axis=-1).reshape(-1, 2) + 0.5)
        found[low[1] : high[1], low[0] : high[0]] = self.fading(apart).reshape(x.shape)
        return found


def face_shift(
    built: Float64[np.ndarray, "M 2"] | None, photographed: Float64[np.ndarray, "M 2"] | None
) -> FaceShift | None:
    """The shift from one face's landmarks to the other's; None where one has none, or they are far apart."""
    if built is None or photographed is None:
        return None
    size = float(np.ptp(built, axis=0).max())
    ways = photographed - built
    if size < 4 or np.linalg.norm(np.median(ways, axis=0)) > FARTHEST * size:
        return None
    return FaceShift(places=built, ways=ways, size=size)
