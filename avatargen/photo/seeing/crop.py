"""Turned squares of a picture: cut out for a network, and the way back.

Places are pixels of the picture, x to the right and y down; (0, 0) is its corner, so the first pixel's centre
is at (.5, .5). Letters: H, W the picture, S side of what is cut out, N points.
"""

from dataclasses import dataclass
from math import atan2, cos, hypot, pi, sin

import numpy as np
from jaxtyping import Float, Float32, UInt8
from PIL import Image


@dataclass(frozen=True, kw_only=True)
class Square:
    """A square of the picture: its middle and side in pixels, turned clockwise by `angle`, radians."""

    x: float
    y: float
    side: float
    angle: float = 0.0

    @property
    def axes(self) -> Float[np.ndarray, "2 2"]:
        """Columns: the square's own x and y in the picture."""
        c, s = cos(self.angle), sin(self.angle)
        return np.array([[c, -s], [s, c]])

    def to_picture(self, places: Float[np.ndarray, "N 2"]) -> Float[np.ndarray, "N 2"]:
        """Places in the square, 0..1, as pixels of the picture."""
        return (places - 0.5) * self.side @ self.axes.T + [self.x, self.y]

    def from_picture(self, places: Float[np.ndarray, "N 2"]) -> Float[np.ndarray, "N 2"]:
        """Pixels of the picture as places in the square, 0..1."""
        return (places - [self.x, self.y]) @ self.axes / self.side + 0.5


def upright(bottom: Float[np.ndarray, "2"], top: Float[np.ndarray, "2"], scale: float) -> Square:
    """The square about `bottom` in which `top` stands straight above it, `scale` times twice as wide as they
    are apart."""
    x, y = top - bottom
    return Square(
        x=float(bottom[0]),
        y=float(bottom[1]),
        side=max(scale * 2 * hypot(x, y), 1.0),
        angle=atan2(y, x) + pi / 2,
    )


def around(places: Float[np.ndarray, "N 2"], angle: float, scale: float) -> Square:
    """The square that holds all places, as they lie in a picture turned back by `angle`, times a scale."""
    turned = Square(x=0.0, y=0.0, side=1.0, angle=angle)
    own = places @ turned.axes
    low, high = own.min(axis=0), own.max(axis=0)
    x, y = turned.axes @ ((low + high) / 2)
    return Square(x=float(x), y=float(y), side=max(scale * float((high - low).max()), 1.0), angle=angle)


def cut(pixels: UInt8[np.ndarray, "H W 3"], square: Square, size: int) -> Float32[np.ndarray, "S S 3"]:
    """What the square holds, 0..1; black beyond the picture."""
    image, shrink = Image.fromarray(pixels), max(int(square.side / size), 1)
    if shrink > 1:
        image = image.reduce(shrink)
    step = square.side / size / shrink
    axes = square.axes * step
    corner = np.array([square.x, square.y]) / shrink - axes @ np.full(2, size / 2)
    data = (axes[0, 0], axes[0, 1], corner[0], axes[1, 0], axes[1, 1], corner[1])
    found = image.transform((size, size), Image.Transform.AFFINE, data, Image.Resampling.BILINEAR)
    return np.asarray(found, np.float32) / 255


def spread_back(
    values: Float[np.ndarray, "S S"], square: Square, width: int, height: int
) -> Float32[np.ndarray, "H W"]:
    """Values over a square, back in the picture; 0 beyond it."""
    axes = square.axes.T / square.side * len(values)
    corner = np.full(2, len(values) / 2) - axes @ [square.x, square.y]
    data = (axes[0, 0], axes[0, 1], corner[0], axes[1, 0], axes[1, 1], corner[1])
    image = Image.fromarray(values.astype(np.float32), mode=None)
    found = image.transform((width, height), Image.Transform.AFFINE, data, Image.Resampling.BILINEAR)
    return np.asarray(found, np.float32)
