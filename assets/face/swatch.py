"""Where the inside of a mouth and of lids has its colours: a small square of the texture that no chart uses,
a row of it for each kind of thing, darker towards the throat; and another square for an eye.

Letters: S texels along a side, I vertices of the mouth's own.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int64, Shaped, UInt8
from scipy.ndimage import distance_transform_edt

from assets.asset.asset import Asset
from assets.errors import GeometryError
from assets.texture.raster import rasterise

MOUTH = np.array([(124, 54, 54), (208, 198, 180), (204, 194, 176), (156, 70, 72)])  # sRGB, as the kinds are
KINDS = len(MOUTH) + 1  # the last one the rims of the lids and what is behind them
DARKEST = 0.15  # of a colour's value at the back of the mouth
BACK, FRONT = 0.108, 0.138  # m: depths, canonical
LEAST, MOST = 3, 24  # texels on either side of the square's middle
MOST_OF_EYE = 64
GUTTER = 2  # texels around it that charts' filtering may read


@dataclass(frozen=True, kw_only=True)
class Swatch:
    """A square of whole texels: its top left corner and its side, in parts of the texture's."""

    corner: tuple[float, float]
    side: float

    def rows(self, size: int) -> tuple[slice, slice]:
        """The square's rows and columns in a picture of so many texels along a side."""
        first = [round(each * size) for each in self.corner]
        many = max(round(self.side * size), 1)
        return slice(first[1], first[1] + many), slice(first[0], first[0] + many)

    def texels(self, size: int) -> int:
        """Along a side, in such a picture."""
        return self.rows(size)[0].stop - self.rows(size)[0].start

    def shown(
        self, picture: UInt8[np.ndarray, "S S 3"], part: UInt8[np.ndarray, "K K 3"]
    ) -> UInt8[np.ndarray, "S S 3"]:
        """The picture with another one in the square."""
        found = picture.copy()
        found[self.rows(len(picture))] = part
        return found

    def uv(
        self, kinds: Int64[np.ndarray, " I"], places: Float64[np.ndarray, "I 3"]
    ) -> Float64[np.ndarray, "I 2"]:
        """Where each vertex reads: its kind's row, its depth's column."""
        depth = np.clip((places[:, 2] - BACK) / (FRONT - BACK), 0, 1)
        across = 0.08 + 0.84 * depth
        # a little up and down, so that no face is without area in the texture
        sway = 0.05 * np.clip(places[:, 1] - places[:, 1].mean(), -0.02, 0.02) / 0.02
        down = (kinds + 0.5) / KINDS + sway + 0.02 * np.clip(places[:, 0] / 0.04, -1, 1)
        return np.array(self.corner) + self.side * np.stack([across, down], axis=1)

    def painted(
        self, picture: UInt8[np.ndarray, "S S *C"], colours: Shaped[np.ndarray, "K *C"]
    ) -> np.ndarray:
        """The picture with rows of colours in the square, darker on the left; of one colour as it is."""
        rows, columns = self.rows(len(picture))
        height, width = rows.stop - rows.start, columns.stop - columns.start
        kind = np.minimum(np.arange(height) * len(colours) // height, len(colours) - 1)
        light = np.linspace(DARKEST, 1, width) if len(colours) > 1 else np.ones(width)
        fade = light.reshape(1, -1, *[1] * (colours.ndim - 1))
        found = picture.copy()
        found[rows, columns] = np.rint(colours[kind][:, None] * fade).astype(np.uint8)
        return found


def free_squares(asset: Asset) -> tuple[Swatch, Swatch]:
    """The two largest squares that charts leave free, up to a limit: for an eye and for the mouth.

    Raises:
        GeometryError: there is none.
    """
    size = len(asset.texture)
    covered = np.zeros(size * size, dtype=bool)
    for fragments in rasterise(asset.uv[asset.faces].astype(np.float64) * size, size, size):
        covered[fragments.pixel] = True
    free = np.pad(~covered.reshape(size, size), 1)
    distance = np.asarray(distance_transform_edt(free))[1:-1, 1:-1]
    eye, (row, column), half = largest_square(distance, MOST_OF_EYE)
    rows, columns = (np.abs(np.arange(size) - middle) for middle in (row, column))
    beside = np.maximum(np.maximum(rows[:, None], columns) - half, 0)
    return eye, largest_square(np.minimum(distance, beside), MOST)[0]


def largest_square(distance: Float64[np.ndarray, "S S"], most: int) -> tuple[Swatch, tuple[int, int], int]:
    """The largest square of free texels, by their distances to what is not free, its middle and half its
    side."""
    size = len(distance)
    row, column = divmod(int(distance.argmax()), size)
    half = int(min((distance[row, column] - GUTTER) / np.sqrt(2), most))
    if half < LEAST:
        raise GeometryError("face: the texture has no room for eyes and a mouth; ask for a larger one")
    corner = ((column - half + 1) / size, (row - half + 1) / size)
    return Swatch(corner=corner, side=(2 * half - 1) / size), (row, column), half
