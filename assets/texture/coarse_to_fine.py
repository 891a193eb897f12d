"""Ask a texture's texels from coarse to fine, and leave out those of uniform blocks, which follow from their
corners.

    every fourth texel of every fourth row is asked, and the middles between these a block of 4 x 4 is uniform
    if its corners and its middle nearly agree, and so do those of all blocks around it: its other texels are
    interpolated what is left is asked at every second texel, and blocks of 2 x 2 are judged by their corners
    what is left then is asked

Cloth and skin of one colour are most of a person. What is smaller than a block and far from any other change
can be overlooked.

Letters: S texels along a side, N texels, B blocks along a side, K uniform blocks, C channels.
"""

from collections.abc import Callable

import numpy as np
from jaxtyping import Bool, Int64, UInt8
from scipy.ndimage import maximum_filter

LARGEST_BLOCK = 4  # texels along a side
CONTRAST = 3  # of 255, that the texels of a uniform block may differ by: no eye sees so little

AskTexels = Callable[[Int64[np.ndarray, " N"]], UInt8[np.ndarray, "N C"]]


def ask_coarse_to_fine(
    ask: AskTexels, wanted: Bool[np.ndarray, "S S"], channels: int
) -> UInt8[np.ndarray, "S S C"]:
    """Values of the wanted texels, asked by their numbers (row * S + column) or interpolated; 0 elsewhere."""
    texels = np.zeros((*wanted.shape, channels), dtype=np.uint8)
    missing = wanted.copy()

    def ask_missing(rows: slice, columns: slice) -> None:
        chosen = np.zeros_like(missing)
        chosen[rows, columns] = missing[rows, columns]
        numbers = np.flatnonzero(chosen)
        if len(numbers):
            texels.reshape(-1, channels)[numbers] = ask(numbers)
            missing[chosen] = False

    size = LARGEST_BLOCK
    while size > 1:
        ask_missing(slice(None, None, size), slice(None, None, size))
        seen = [0, size]
        if size == LARGEST_BLOCK:
            ask_missing(slice(size // 2, None, size), slice(size // 2, None, size))
            seen = [0, size // 2, size]
        fill(texels, missing, find_uniform(texels, wanted, size, seen), size)
        size //= 2
    ask_missing(slice(None), slice(None))
    return texels


def find_uniform(
    texels: UInt8[np.ndarray, "S S C"], wanted: Bool[np.ndarray, "S S"], size: int, seen: list[int]
) -> Int64[np.ndarray, "K 2"]:
    """Row and column of the first texel of each uniform block, of those whose texels are all wanted. A block
    is judged by its texels at `seen` along its diagonals, and shares its last row and column with the
    next."""
    count = (len(wanted) - 1) // size
    whole = blocks_of(wanted, size, count).all(axis=(2, 3))
    judged = np.stack(
        [
            texels[row : row + count * size : size, column : column + count * size : size]
            for row in seen
            for column in seen
            if row in (column, size - column)
        ]
    )
    contrast = (judged.max(axis=0) - judged.min(axis=0)).max(axis=2)
    varied = whole & (contrast > CONTRAST)
    return np.argwhere(whole & (maximum_filter(varied, size=3) == 0)) * size


def blocks_of(texels: Bool[np.ndarray, "S S"], size: int, count: int) -> Bool[np.ndarray, "B B n n"]:
    """The blocks with the first row and column of the next ones."""
    return np.lib.stride_tricks.sliding_window_view(texels, (size + 1, size + 1))[::size, ::size][
        :count, :count
    ]


def fill(
    texels: UInt8[np.ndarray, "S S C"],
    missing: Bool[np.ndarray, "S S"],
    uniform: Int64[np.ndarray, "K 2"],
    size: int,
) -> None:
    """Interpolate the missing texels of uniform blocks from their corners."""
    row, column = uniform.T
    corners = [[texels[row + i, column + j].astype(np.float32) for j in (0, size)] for i in (0, size)]
    for i in range(size + 1):
        low, high = (corners[0][side] * (1 - i / size) + corners[1][side] * (i / size) for side in (0, 1))
        for j in range(size + 1):
            new = missing[row + i, column + j]
            place = row[new] + i, column[new] + j
            texels[place] = np.rint(low[new] * (1 - j / size) + high[new] * (j / size))
            missing[place] = False
