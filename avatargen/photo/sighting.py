"""What was seen in a photograph: the person's landmarks and where the person covers the picture.

Letters: H W pixels, K = 33 landmarks (`seeing.pose.NAMES`), M landmarks of a face.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float32, Float64

from avatargen.errors import InputError
from avatargen.photo.camera import Pinhole
from avatargen.photo.picture import Picture
from avatargen.photo.seeing.pose import NAMES


@dataclass(frozen=True, kw_only=True)
class Sighting:
    """One person in one photograph.

    `metres` are the landmarks' places from between the hips, in our axes: x right in the picture, y up,
    z towards the camera; `people` counts everybody that was found.
    """

    picture: Picture
    mask: Float32[np.ndarray, "H W"]
    pixels: Float64[np.ndarray, "K 2"]
    metres: Float64[np.ndarray, "K 3"]
    visibility: Float64[np.ndarray, " K"]
    face: Float64[np.ndarray, "M 2"] | None = None
    people: int = 1

    def __post_init__(self) -> None:
        width, height = self.picture.size
        if self.mask.shape != (height, width):
            rows, columns = self.mask.shape
            raise InputError(
                f"photo: the mask is {columns} x {rows} pixels and {self.picture.name} {width} x {height}; "
                "give one of the photograph's size"
            )
        if not len(self.pixels) == len(self.metres) == len(self.visibility) == len(NAMES):
            raise InputError(f"photo: {len(self.pixels)} landmarks; {len(NAMES)} are needed")

    @property
    def camera(self) -> Pinhole:
        width, height = self.picture.size
        return Pinhole(width=width, height=height, focal=self.picture.focal)
