"""Contact sheets: every picture is there, whole, in its place."""

import numpy as np
import pytest

from assets.picture.sheet import EMPTY, WORD, contact_sheet

PICTURES = [np.full((6, width, 3), shade, np.uint8) for shade, width in enumerate((4, 8, 5, 8, 3), start=1)]


@pytest.mark.parametrize("columns", [1, 2, 4, 7])
def test_a_sheet_holds_every_picture_whole_in_rows(columns: int) -> None:
    sheet = contact_sheet(PICTURES, columns)
    rows = -(-5 // columns)

    assert sheet.shape == (6 * rows, 8 * columns, 3)
    for i in range(rows * columns):
        row, column = divmod(i, columns)
        cell = sheet[row * 6 : row * 6 + 6, column * 8 : column * 8 + 8]
        assert (cell == (i + 1 if i < 5 else EMPTY)).all()


def test_each_word_stands_under_its_picture_and_covers_none() -> None:
    pictures = [np.full((40, width, 3), 200, np.uint8) for width in (50, 60, 55)]
    sheet = contact_sheet(pictures, 2, ["3", "", "31415"])

    assert sheet.shape == (2 * (40 + WORD), 120, 3)
    cells = [
        sheet[60 * row : 60 * row + 60, 60 * column : 60 * column + 60]
        for row, column in ((0, 0), (0, 1), (1, 0))
    ]
    assert all((cell[:40] == 200).all() for cell in cells)
    inked = [(cell[40:] < 150).any(axis=2) for cell in cells]
    assert [bool(each.any()) for each in inked] == [True, False, True]
    assert inked[2].sum() > 3 * inked[0].sum()
    across = np.flatnonzero(inked[2].any(axis=0))
    assert abs(across.mean() - 29.5) < 2  # in the middle
