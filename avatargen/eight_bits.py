"""Pictures of more than 8 bits a channel, in 8: scaled. Pillow's own conversion clips them to white."""

import numpy as np
from PIL import Image

from avatargen.errors import InputError

DEEP = {"I": 65535.0, "F": 1.0}  # what is white in modes of Pillow that do not tell; of the others, `I;16...`


def eight_bits(picture: Image.Image) -> Image.Image:
    """The picture in 8 bits a channel: 16 bits over 257, fractions 0..1 times 255.

    Raises:
        InputError: it holds numbers beyond 16 bits, or fractions beyond 0..1.
    """
    if picture.mode not in DEEP and not picture.mode.startswith("I;16"):
        return picture
    values = np.asarray(picture).astype(np.float64)
    share = values / DEEP.get(picture.mode, 65535.0)
    if not ((share >= 0) & (share <= 1)).all():
        raise InputError(
            f"picture: it holds numbers from {values.min():g} to {values.max():g}, which are neither 16 bits "
            "nor fractions of 1; save it in 8 or 16 bits"
        )
    return Image.fromarray(np.rint(255 * share).astype(np.uint8))
