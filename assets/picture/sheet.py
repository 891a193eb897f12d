"""Pictures in rows on one sheet.

Letters: H height of a picture and L length of the longest in pixels, R rows, C columns, K height of a word.
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import UInt8
from PIL import Image, ImageDraw, ImageFont

EMPTY = 238  # grey of places without a picture
INK = (60, 60, 60)
WORD, LETTER = 20, 13  # pixels, height of the strip and of the letters


def contact_sheet(
    pictures: Sequence[UInt8[np.ndarray, "H _ 3"]], columns: int, words: Sequence[str] = ()
) -> UInt8[np.ndarray, "M N 3"]:
    """Pictures of one height, each centred in a cell as wide as the widest, with its word under it where
    there are words. [R * (H + K), C * L, 3]
    """
    width = max(picture.shape[1] for picture in pictures)
    cells = [in_cell(picture, width, WORD if words else 0) for picture in pictures]
    cells += [np.full_like(cells[0], EMPTY)] * (-len(cells) % columns)
    rows = [np.concatenate(cells[i : i + columns], axis=1) for i in range(0, len(cells), columns)]
    sheet = np.concatenate(rows, axis=0)
    return with_words(sheet, words, columns, cells[0].shape) if words else sheet


def in_cell(picture: UInt8[np.ndarray, "H _ 3"], width: int, below: int) -> UInt8[np.ndarray, "M L 3"]:
    """The picture in the middle of a cell; its rim goes on to the sides and below."""
    left = (width - picture.shape[1]) // 2
    return np.pad(picture, ((0, below), (left, width - picture.shape[1] - left), (0, 0)), mode="edge")


def with_words(
    sheet: UInt8[np.ndarray, "M N 3"], words: Sequence[str], columns: int, cell: tuple[int, ...]
) -> UInt8[np.ndarray, "M N 3"]:
    """The sheet with a word at the foot of each cell."""
    image = Image.fromarray(sheet)
    pen, font = ImageDraw.Draw(image), ImageFont.load_default(LETTER)
    height, width = cell[:2]
    for i, word in enumerate(words):
        foot = (i % columns * width + width // 2, (i // columns + 1) * height - WORD // 2)
        pen.text(foot, word, fill=INK, font=font, anchor="mm")
    return np.asarray(image)
