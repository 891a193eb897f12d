"""How compact the files of an export are. What the defaults write opens everywhere."""

import io
from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import UInt8
from PIL import Image

from exporters.png import encode_png

PictureFormat = Literal["png", "jpeg", "webp"]
SUFFIXES: dict[PictureFormat, str] = {"png": ".png", "jpeg": ".jpg", "webp": ".webp"}
QUALITY = 90  # of 100, for colours: differences are not seen
NORMAL_QUALITY = 95  # for directions, where the smallest blocks would shine


@dataclass(frozen=True, kw_only=True)
class Encoding:
    """How pictures are stored, whether a mesh's numbers are rounded to 8 and 16 bits, and whether a mesh is
    written as slicers read it, in millimetres and z up."""

    pictures: PictureFormat = "png"
    quantize: bool = False
    for_slicers: bool = False

    @property
    def axes(self) -> str:
        """Unit and upward axis, for formats that have no place for them but a comment."""
        return "millimetres, z up" if self.for_slicers else "metres, y up"

    @property
    def mime_type(self) -> str:
        return f"image/{self.pictures}"

    def picture(self, name: str, pixels: UInt8[np.ndarray, "H W *C"]) -> bytes:
        """A picture's bytes, the same for the same pixels. Directions ("normal") keep their full colour
        resolution, in WebP every bit."""
        if self.pictures == "png":
            return encode_png(pixels)
        stream, image, directions = io.BytesIO(), Image.fromarray(pixels), name == "normal"
        if self.pictures == "jpeg":
            quality = NORMAL_QUALITY if directions else QUALITY
            image.save(stream, format="JPEG", quality=quality, subsampling=0, optimize=True)
        else:
            image.save(stream, format="WEBP", quality=QUALITY, lossless=directions, method=4)
        return stream.getvalue()


PLAIN = Encoding()
