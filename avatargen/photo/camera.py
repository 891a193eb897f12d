"""A pinhole camera at the origin of its own space: x right, y up, looking along -z; metres and pixels.

Whoever faces the camera upright has the body's own axes. Letters: N points.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Float64

NEAREST = 0.05  # m before the camera, from where points are seen


@dataclass(frozen=True, kw_only=True)
class Pinhole:
    """Width, height and focal length in pixels. What is straight ahead is `right` and `down` of the picture's
    middle, pixels: 0 but for a part of a picture."""

    width: int
    height: int
    focal: float
    right: float = 0.0
    down: float = 0.0

    def see(
        self, points: Float[np.ndarray, "N 3"]
    ) -> tuple[Float64[np.ndarray, "N 2"], Float64[np.ndarray, " N"]]:
        """Places in the picture, pixels, and metres away along the view."""
        points = np.asarray(points, dtype=np.float64)
        away = np.maximum(-points[:, 2], NEAREST)
        places = points[:, :2] * [1, -1] * (self.focal / away)[:, None]
        middle = np.array([self.width / 2 + self.right, self.height / 2 + self.down])
        return places + middle, away

    def resized(self, share: float) -> "Pinhole":
        """The same view with fewer or more pixels."""
        return Pinhole(
            width=max(round(self.width * share), 1),
            height=max(round(self.height * share), 1),
            focal=self.focal * share,
            right=self.right * share,
            down=self.down * share,
        )

    def part(self, low: tuple[int, int], high: tuple[int, int]) -> "Pinhole":
        """What lies between two corners of the picture, pixels."""
        return Pinhole(
            width=high[0] - low[0],
            height=high[1] - low[1],
            focal=self.focal,
            right=self.right + (self.width - low[0] - high[0]) / 2,
            down=self.down + (self.height - low[1] - high[1]) / 2,
        )
