"""Pictures as PNG. Same pixels, same bytes."""

import io

import numpy as np
from jaxtyping import UInt8
from PIL import Image

LEVEL = 3  # zlib's; above it the file shrinks by a few percent and the time doubles


def encode_png(pixels: UInt8[np.ndarray, "H W *C"]) -> bytes:
    """Rows from the top: grey, or sRGB, where a fourth channel is coverage."""
    stream = io.BytesIO()
    Image.fromarray(pixels).save(stream, format="PNG", compress_level=LEVEL)
    return stream.getvalue()
