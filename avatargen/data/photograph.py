"""One photograph of a person to pictures of a data set: cut out, checked, cropped, mirrored.

What cannot be used raises InputError, whose first words say what was wrong: picture, mask, keypoints, label,
partial body, or disagreement between the label and what is seen.

Letters: H W pixels of a photograph, S of a picture, J joints.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float64, UInt8
from PIL import Image, ImageOps, UnidentifiedImageError

from avatargen.body.model import Body
from avatargen.data.conventions import Convention, Label, estimate, to_ours
from avatargen.data.crop import agreement, check_mask, cropped_camera, cut, share_inside, square_around
from avatargen.data.folder import png
from avatargen.data.joints import projected_joints
from avatargen.data.keypoints import LIMBS, Keypoints, keypoints_of
from avatargen.data.mask import alpha_of, mask_of
from avatargen.data.mirror import mirrored
from avatargen.data.pickles import Row
from avatargen.eight_bits import eight_bits
from avatargen.errors import InputError

Segment = Callable[[UInt8[np.ndarray, "H W 3"]], np.ndarray]
FARTHEST = 0.12  # mean distance of joints from keypoints, as a share of their span: estimates reach 0.05
FEWEST_INSIDE = 0.6  # share of the joints that lie on the mask


@dataclass(frozen=True, kw_only=True)
class Settings:
    """How photographs are read and what pictures are made."""

    convention: Convention
    size: int = 256  # pixels a side
    fill: float = 0.63  # of the picture, that the keypoints span; about what `data synth` shows
    mirror: bool = True
    balance: bool = True  # show sides that few pictures have more often
    keep_betas: bool = True  # else everybody has the mean shape: for a body whose betas mean something else
    focal: float | None = None  # share of the height, where the convention tells none

    def __post_init__(self) -> None:
        if not 8 <= self.size <= 2048 or not 0.1 <= self.fill <= 0.95:
            raise InputError(
                f"data prepare: size {self.size}, fill {self.fill}; choose 8..2048 pixels and 0.1..0.95"
            )
        if self.focal is not None and not 0.1 <= self.focal <= 1000:
            raise InputError(f"data prepare: focal {self.focal}; it is a share of the height, 0.1..1000")
        if self.focal is not None and self.convention in ("eg3d", "ag3d"):
            raise InputError(f"data prepare: {self.convention} tells the focal length; leave focal out")


@dataclass(frozen=True, kw_only=True)
class Photograph:
    """A photograph and what is known of it, not yet looked at."""

    name: str
    file: Path
    mask: Path | None
    row: Row
    people: list[Any] | str | None  # keypoints of those found, or why there are none; None: nobody looked


@dataclass(frozen=True, kw_only=True)
class Taken:
    """A picture of the data set: PNG of image and mask, and the label."""

    image: bytes
    mask: bytes
    label: Label


class Studio:
    """Makes pictures of photographs."""

    def __init__(self, body: Body, settings: Settings, segment: Segment | None) -> None:
        self.body, self.settings, self.segment = body, settings, segment

    def take(self, photograph: Photograph) -> list[Taken]:
        """The picture, and the mirrored one where wanted.

        Raises:
            InputError: the photograph, its label or its keypoints cannot be used.
        """
        settings = self.settings
        photo, mask = self.read(photograph)
        if isinstance(photograph.row, str):
            raise InputError(photograph.row)
        H, W = mask.shape
        found = estimate(settings.convention, photograph.row, W / H, settings.focal)
        label = to_ours(found, self.body, keep_betas=settings.keep_betas)
        joints = projected_joints(self.body, label.camera, label.pose, label.betas) * [W, H]
        points = self.points(photograph, joints, (W, H))
        points.check_whole()
        check_mask(mask)
        self.check_label(joints, points, mask)
        square = square_around(points, mask, settings.fill)
        image, cover = cut(photo, mask, square, settings.size)
        label = Label(camera=cropped_camera(label.camera, W, H, square), pose=label.pose, betas=label.betas)
        taken = [Taken(image=png(image), mask=png(cover), label=label)]
        if settings.mirror:
            turned = mirrored(label, self.body.joint_names)
            image, cover = (np.ascontiguousarray(pixels[:, ::-1]) for pixels in (image, cover))
            taken.append(Taken(image=png(image), mask=png(cover), label=turned))
        return taken

    def read(self, photograph: Photograph) -> tuple[UInt8[np.ndarray, "H W 3"], UInt8[np.ndarray, "H W"]]:
        """Colours and coverage, the right way up.

        Raises:
            InputError: a file is broken, or the mask is none of this photograph.
        """
        picture = open_whole(photograph.file, "picture")
        photo = np.asarray(eight_bits(picture).convert("RGB"))
        if photograph.mask is not None:
            mask = mask_of(open_whole(photograph.mask, "mask"))
        elif self.segment is not None:
            mask = coverage(self.segment(photo))
        elif (alpha := alpha_of(picture)) is not None:
            if alpha.min() == 255:
                raise InputError("mask: the alpha channel is opaque all over; give masks or a segmentation")
            mask = alpha
        else:
            raise InputError("mask: there is none; give masks, an alpha channel or a segmentation")
        if mask.shape != photo.shape[:2]:
            raise InputError(f"mask: it has shape {mask.shape}, the photograph {photo.shape[:2]}")
        return photo, mask

    def points(
        self, photograph: Photograph, joints: Float64[np.ndarray, "J 2"], size: tuple[int, int]
    ) -> Keypoints:
        """The photograph's keypoints; without any, the label's joints that lie in the picture."""
        if photograph.people is not None:
            if isinstance(photograph.people, str):
                raise InputError(photograph.people)
            return keypoints_of(photograph.people)
        named = zip(self.body.joint_names, joints, strict=True)
        inside = {name: place for name, place in named if ((place >= 0) & (place <= size)).all()}
        return Keypoints(places=inside)

    def check_label(
        self, joints: Float64[np.ndarray, "J 2"], points: Keypoints, mask: UInt8[np.ndarray, "H W"]
    ) -> None:
        """Raises InputError where the label's person is somewhere else than the one that is seen."""
        apart = agreement(dict(zip(self.body.joint_names, joints, strict=True)), points, LIMBS)
        if not apart < FARTHEST:
            raise InputError(
                f"disagreement: the label's joints lie {100 * apart:.0f} % of the person's size from the "
                f"keypoints, at most {100 * FARTHEST:.0f} % is taken; check the convention and the label"
            )
        inside = share_inside(joints, mask)
        if not inside >= FEWEST_INSIDE:
            raise InputError(
                f"disagreement: {100 * inside:.0f} % of the label's joints lie on the mask, "
                f"{100 * FEWEST_INSIDE:.0f} % are needed; check the convention and the label"
            )


def open_whole(path: Path, what: str) -> Image.Image:
    """A picture, turned as its camera says. Raises InputError where there is no whole one."""
    try:
        with Image.open(path) as picture:
            return ImageOps.exif_transpose(picture)
    except (OSError, UnidentifiedImageError, SyntaxError, ValueError, Image.DecompressionBombError) as error:
        raise InputError(f"{what}: {path} is no whole picture ({error})") from error


def coverage(found: np.ndarray) -> UInt8[np.ndarray, "H W"]:
    """What a segmentation returned, in 8 bits. Raises InputError where it is no mask."""
    found = np.asarray(found)
    if found.ndim != 2 or found.dtype.kind not in "fbu":
        raise InputError(f"mask: the segmentation gave {found.dtype} {found.shape}; [H W] is wanted")
    if found.dtype == np.uint8:
        return found
    share = found.astype(np.float32)
    if not ((share >= 0) & (share <= 1)).all():
        raise InputError("mask: the segmentation gave numbers beyond 0..1, or NaN")
    return np.rint(255 * share).astype(np.uint8)
