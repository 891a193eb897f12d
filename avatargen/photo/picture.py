"""A photograph, read once: upright, sRGB, of a size that can be worked on, with its focal length."""

import io
import warnings
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from jaxtyping import Float32, UInt8
from PIL import Image, ImageCms, ImageOps, UnidentifiedImageError

from avatargen.errors import InputError

MOST_PIXELS = 100_000_000  # of a file
LEAST_SIDE = 64  # pixels
LARGEST_SIDE = 2048  # pixels, that are worked on: more adds nothing to a person's texture
FOCAL_35MM, FILM = 0x8827, (36.0, 24.0)  # EXIF's focal length for a film frame, and that frame, mm
EXIF_IFD = 0x8769
USUAL_FOCAL = 0.85  # of the longer side: between a telephone's main camera (.72) and a portrait (1.2)


@dataclass(frozen=True, kw_only=True)
class Picture:
    """Upright sRGB pixels, row 0 at the top, and the focal length in pixels."""

    name: str
    pixels: UInt8[np.ndarray, "H W 3"]
    focal: float
    focal_known: bool = False

    def __post_init__(self) -> None:
        if min(self.pixels.shape[:2]) < LEAST_SIDE:
            height, width = self.pixels.shape[:2]
            raise InputError(
                f"photo: {self.name} is {width} x {height} pixels; give one of {LEAST_SIDE} or more a side"
            )
        if not self.focal > 0:
            raise InputError(f"photo: {self.name} has a focal length of {self.focal} pixels; wanted more")

    @property
    def size(self) -> tuple[int, int]:
        """Width and height, pixels."""
        return self.pixels.shape[1], self.pixels.shape[0]


def read_picture(path: Path) -> Picture:
    """Read a photograph: turned as EXIF says, converted to sRGB, at most 2048 pixels a side.

    Raises:
        InputError: the file is missing, no picture, damaged, too small or of more than 100 megapixels.
    """
    try:
        data = path.read_bytes()
    except OSError as error:
        raise InputError(f"photo: cannot read {path} ({error.strerror}); check the path") from error
    return replace(picture_of(data, str(path)), name=path.name)


def picture_of(data: bytes, name: str) -> Picture:
    """The photograph that a file holds, as `read_picture` reads it. Raises InputError as that does."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of sizes, which are checked here
            image = Image.open(io.BytesIO(data))
            width, height = image.size
            if width * height > MOST_PIXELS:
                raise Image.DecompressionBombError
            focal = focal_of(image)
            image.draft("RGB", (LARGEST_SIDE, LARGEST_SIDE))  # JPEG decodes smaller at once
            upright = in_srgb(ImageOps.exif_transpose(image))
            upright.thumbnail((LARGEST_SIDE, LARGEST_SIDE), Image.Resampling.LANCZOS)
            pixels = np.asarray(upright)
    except Image.DecompressionBombError as error:
        raise InputError(
            f"photo: {name} has more than {MOST_PIXELS // 1_000_000} megapixels; make it smaller"
        ) from error
    except (UnidentifiedImageError, OSError, ValueError, SyntaxError) as error:
        raise InputError(f"photo: {name} is no picture that can be read; give a JPEG or PNG") from error
    return Picture(
        name=name,
        pixels=pixels,
        focal=(focal or USUAL_FOCAL) * max(pixels.shape[:2]),
        focal_known=focal is not None,
    )


def read_mask(path: Path, picture: Picture) -> Float32[np.ndarray, "H W"]:
    """A mask of a picture, 0..1: white where the person is.

    Raises:
        InputError: the file is no picture, or not of the photograph's shape.
    """
    try:
        image = ImageOps.exif_transpose(Image.open(path)).convert("L")
    except (UnidentifiedImageError, OSError, ValueError, SyntaxError, Image.DecompressionBombError) as error:
        raise InputError(f"photo: {path} is no mask that can be read; give a PNG, white on black") from error
    width, height = picture.size
    if abs(image.width * height - image.height * width) > 0.01 * image.width * height:
        raise InputError(
            f"photo: the mask {path} is {image.width} x {image.height} pixels, which is not the shape of "
            f"{picture.name} ({width} x {height}); give one of the photograph's size"
        )
    mask = np.asarray(image.resize((width, height), Image.Resampling.BOX), np.float32) / 255
    if (mask > 0.5).sum() < LEAST_SIDE:
        raise InputError(f"photo: the mask {path} is black; make it white where the person is")
    return mask


def focal_of(image: Image.Image) -> float | None:
    """The focal length by EXIF as a share of the longer side; None where it is not told."""
    exif = image.getexif().get_ifd(EXIF_IFD)
    try:
        focal = float(exif.get(FOCAL_35MM) or 0)
    except (TypeError, ValueError, ZeroDivisionError):
        return None
    return focal / FILM[0] if 8 <= focal <= 1000 else None


def in_srgb(image: Image.Image) -> Image.Image:
    """The picture's colours in sRGB, by its own profile where it has one; on white where transparent."""
    profile = image.info.get("icc_profile")
    if image.mode in ("RGBA", "LA", "PA") or "transparency" in image.info:
        image = image.convert("RGBA")
        white = Image.new("RGBA", image.size, "white")
        image = Image.alpha_composite(white, image)
    plain = image.convert("RGB")
    if not profile:
        return plain
    try:
        source = ImageCms.ImageCmsProfile(io.BytesIO(profile))
        found = ImageCms.profileToProfile(plain, source, ImageCms.createProfile("sRGB"))
    except (ImageCms.PyCMSError, OSError):
        return plain
    return found or plain
