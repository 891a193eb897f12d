"""A person's mask from a picture of it, in whatever form segmentations leave one.

Grey levels are coverage. An alpha channel that is not opaque is the mask, whatever the colours show. Of class
indices (whole numbers below 64, as human parsing writes them; 255 may mark what was left undecided) and of
coloured maps all but 0 and black are the person.

Letters: H W pixels.
"""

import numpy as np
from jaxtyping import Bool, Num, UInt8
from PIL import Image

from avatargen.eight_bits import eight_bits

MOST_CLASSES = 64
UNDECIDED = 255
COLOURED = 32  # of 255, between channels: what a JPEG's noise stays below


def mask_of(picture: Image.Image) -> UInt8[np.ndarray, "H W"]:
    """Coverage in 8 bits."""
    alpha = alpha_of(picture)
    if alpha is not None and alpha.min() < 255:
        return alpha
    if picture.mode == "P":
        picture = picture.convert("RGB")
    if picture.mode in ("L", "I") or picture.mode.startswith("I;16"):
        values = np.asarray(picture)
        if are_classes(values):
            return on(values > 0)
    colours = np.asarray(eight_bits(picture).convert("RGB")).astype(np.int16)
    if (colours.max(axis=2) - colours.min(axis=2)).max() > COLOURED:
        return on(colours.max(axis=2) > COLOURED)
    return np.asarray(eight_bits(picture).convert("L"))


def alpha_of(picture: Image.Image) -> UInt8[np.ndarray, "H W"] | None:
    """The alpha channel, if there is one."""
    return np.asarray(picture.convert("RGBA"))[..., 3] if picture.has_transparency_data else None


def are_classes(values: Num[np.ndarray, "H W"]) -> bool:
    """Whether these are indices of classes: of coverage the largest numbers are the most frequent."""
    small, undecided = (values > 0) & (values < MOST_CLASSES), values == UNDECIDED
    return bool((~(small | undecided | (values == 0))).sum() == 0 and small.sum() > undecided.sum())


def on(person: Bool[np.ndarray, "H W"]) -> UInt8[np.ndarray, "H W"]:
    return np.where(person, np.uint8(255), np.uint8(0))
