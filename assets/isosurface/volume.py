"""scikit-image's marching cubes, for those who want that recipe: Lewiner's (2003), which decides what passes
through a cell whose corners alone leave it open.

It takes a whole volume, here filled at the corners of crossed cells alone, and a mask leaves the others out:
the field is asked no more than by `assets.isosurface.extract`, and the surface is that of the whole grid.
"""

from typing import Any

import numpy as np
from jaxtyping import Int64

from assets.isosurface.grid import CornerValues, unique_below
from assets.mesh.surface import Surface
from avatargen.errors import InputError

LARGEST_VOLUME = 1 << 29  # corners, of 5 bytes each
NEVER_ZERO = 2e-4  # of a cell: what single precision tells from a corner at coordinates up to 2048


def march_volume(values: CornerValues, cells: Int64[np.ndarray, "C 3"]) -> Surface:
    """The surface in crossed cells, closed and facing outward; values nearer to zero than `NEVER_ZERO`
    are moved there, so that no face is flat.

    Raises:
        InputError: a volume that is too large to hold.
    """
    from skimage.measure import marching_cubes

    grid = values.grid
    shape = tuple(int(count) for count in grid.shape + 1)
    if np.prod(shape, dtype=np.float64) > LARGEST_VOLUME:
        raise InputError(
            f"extract: marching cubes want a volume of {' x '.join(map(str, shape))} corners, more than "
            f"{LARGEST_VOLUME / 1e6:.0f} million; lower the resolution or choose the adaptive mesher"
        )
    slots = unique_below(values.slots_of_cells(cells).reshape(-1), len(values.values))
    volume, crossed = np.zeros(shape, dtype=np.float32), np.zeros(shape, dtype=bool)
    field = values.values[slots] / grid.cell_size
    field = np.copysign(np.maximum(np.abs(field), NEVER_ZERO), field)
    volume[tuple(values.corners(slots).T)] = field
    crossed[tuple((cells + 1).T)] = True  # scikit-image names a cell by its high corner
    found: Any = marching_cubes(volume, 0.0, mask=crossed)
    vertices, faces = grid.points(found[0].astype(np.float64)), found[1].astype(np.int64)
    return Surface(vertices=vertices, faces=np.ascontiguousarray(faces))
