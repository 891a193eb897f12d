"""Signs and values at the corners of the grid's cells, looked up by compiled loops.

Coordinates are whole numbers of fine cells, as in `assets.isosurface.grid`. A cell is named by its low
corner, the one with the least coordinates, and has a size of 1 or 2 fine cells along a side.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float64, Int32, Int64

from assets.isosurface.grid import BITS, BRICK, CornerValues
from avatargen.compiled import inner

WITHIN_BRICK, LAST_CORNER = 3 * BITS, BRICK**3 - 1  # the bits of a code that tell corners of a brick apart


class CornerLookup(NamedTuple):
    """The arrays of `CornerValues`, which compiled loops can read."""

    x_code: Int64[np.ndarray, " X"]  # what each coordinate adds to its corner's code
    y_code: Int64[np.ndarray, " Y"]
    z_code: Int64[np.ndarray, " Z"]
    opened: Int32[np.ndarray, " B"]  # by brick, from 1: its place among the values; 0 for none
    values: Float64[np.ndarray, " M"]  # of the field, by slot; never 0 where it has been asked


def corner_lookup(values: CornerValues) -> CornerLookup:
    """For corners that have been asked; not for later ones, which may move the arrays."""
    x_code, y_code, z_code = values.shares
    return CornerLookup(x_code, y_code, z_code, values.opened, values.values)


@inner(forceinline=True)
def offset(x, y, z, axis, along, i, j):
    """The place `along` cells from this one along an axis, and i and j along the two axes after it."""
    if axis == 0:
        return x + along, y + i, z + j
    if axis == 1:
        return x + j, y + along, z + i
    return x + i, y + j, z + along


@inner(forceinline=True)
def slot_of(lookup, x, y, z):
    """Where the value of a corner lies; -1 where none does."""
    x_code, y_code, z_code, opened, _ = lookup
    if min(x, y, z) < 0 or x >= len(x_code) or y >= len(y_code) or z >= len(z_code):
        return -1
    code = x_code[x] + y_code[y] + z_code[z]
    brick = opened[code >> WITHIN_BRICK]
    return -1 if brick == 0 else (brick - 1 << WITHIN_BRICK) + (code & LAST_CORNER)


@inner(forceinline=True)
def number_at(lookup, numbers, x, y, z):
    """Of `numbers` by slot, the one of the cell with this low corner; 0 where there is none."""
    slot = slot_of(lookup, x, y, z)
    return 0 if slot < 0 else numbers[slot]


@inner(forceinline=True)
def case_of(lookup, x, y, z, size):
    """Which corners of a cell are inside, one bit each (see `assets.isosurface.cell`)."""
    case = 0
    for corner in range(8):
        i, j, k = corner & 1, corner >> 1 & 1, corner >> 2
        slot = slot_of(lookup, x + size * i, y + size * j, z + size * k)
        case |= (lookup.values[slot] < 0) << corner
    return case


@inner(forceinline=True)
def gradient_of(lookup, x, y, z, size):
    """The field's gradient in a cell, from its eight corners: metres of distance a fine cell."""
    dx = dy = dz = 0.0
    for corner in range(8):
        i, j, k = corner & 1, corner >> 1 & 1, corner >> 2
        value = lookup.values[slot_of(lookup, x + size * i, y + size * j, z + size * k)]
        dx += value if i else -value
        dy += value if j else -value
        dz += value if k else -value
    return dx / (4.0 * size), dy / (4.0 * size), dz / (4.0 * size)
