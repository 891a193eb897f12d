"""The nearest marked texel to every texel of a picture, exactly and in linear time.

First along columns, then along rows: there a column's nearest texel stands for a parabola of squared
distances, and the lowest of all parabolas is walked once (Felzenszwalb and Huttenlocher 2012). Whole numbers
up to the last comparison, so of texels at one distance always the same is found.

Letters: H rows, W columns.
"""

import numpy as np
from jaxtyping import Bool, Int64

from avatargen.compiled import compiled, inner

FAR = 1 << 20  # texels, more than a side has


def nearest_texels(
    marked: Bool[np.ndarray, "H W"],
) -> tuple[Int64[np.ndarray, "H W"], Int64[np.ndarray, "H W"]]:
    """The number (row * W + column) of the marked texel nearest to each, and the square of how far it is; of
    at least one marked texel."""
    nearest, squared = np.empty(marked.shape, np.int64), np.empty(marked.shape, np.int64)
    search_rows(search_columns(marked), nearest, squared)
    return nearest, squared


@compiled
def search_columns(marked):
    """[H W] the row of the nearest marked texel in the same column, the upper of two; `FAR` or minus that
    where the column has none. `marked` [H W] are truth values."""
    height, width = marked.shape
    row, last = np.empty((height, width), np.int64), np.empty(width, np.int64)
    for x in range(width):
        last[x] = -FAR
    for y in range(height):
        for x in range(width):
            last[x] = y if marked[y, x] else last[x]
            row[y, x] = last[x]
    for x in range(width):
        last[x] = FAR
    for y in range(height - 1, -1, -1):
        for x in range(width):
            last[x] = y if marked[y, x] else last[x]
            row[y, x] = last[x] if last[x] - y < y - row[y, x] else row[y, x]
    return row


@compiled
def search_rows(row, nearest, squared):
    """Fill in `nearest` and `squared` [H W], as `nearest_texels` returns them, from each column's nearest
    rows [H W]."""
    height, width = row.shape
    column, start = np.empty(width, np.int64), np.empty(width + 1)
    for y in range(height):
        count = lowest_parabolas(row[y], y, column, start)
        k = 0
        for x in range(width):
            while k + 1 < count and start[k + 1] < x:
                k += 1
            nearest[y, x] = row[y, column[k]] * width + column[k]
            squared[y, x] = (x - column[k]) ** 2 + (y - row[y, column[k]]) ** 2


@inner
def lowest_parabolas(row, y, column, start):
    """Fill in `column` [W], the columns whose parabolas are lowest somewhere along row y, and `start` [W],
    the x from which on each is; returns how many there are. `row` [W] are the columns' nearest rows."""
    count = 0
    for x in range(len(row)):
        if abs(row[x]) >= FAR:
            continue
        height, begin = (y - row[x]) ** 2 + x * x, -np.inf
        while count:
            other = column[count - 1]
            begin = (height - (y - row[other]) ** 2 - other * other) / (2.0 * (x - other))
            if begin > start[count - 1]:
                break
            count -= 1
        column[count] = x
        start[count] = begin if count else -np.inf
        count += 1
    return count
