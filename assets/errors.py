"""The geometry half's own errors."""

import numpy as np
from jaxtyping import Bool

from avatargen.errors import AvatarGenError


class GeometryError(AvatarGenError):
    """A mesh or field has no usable surface, or a stage cannot keep its promise about the mesh."""


class BoundsError(GeometryError):
    """A surface leaves the bounds it was sought in, through these sides: low and high ones, by axis."""

    def __init__(self, sides: Bool[np.ndarray, "2 3"]) -> None:
        super().__init__("extract: the surface touches the bounds and would stay open; give larger bounds")
        self.sides = sides
