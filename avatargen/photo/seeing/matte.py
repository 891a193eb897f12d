"""The person's outline, by closed-form matting between what is surely the person and what surely is not
(Levin et al., "A closed-form solution to natural image matting", 2008).

Letters: H W pixels.
"""

from typing import Any

import numpy as np
from jaxtyping import Bool, Float32, Float64, UInt8
from PIL import Image
from scipy.ndimage import binary_dilation, binary_erosion, label
from scipy.sparse import csr_matrix, identity
from scipy.sparse.linalg import spsolve

LARGEST = 420  # pixels of the longer side of what is matted
SURE, SURELY_NOT = 0.92, 0.08  # of the network's cover
BAND = 0.008  # of the person's height, that the outline may be off
EVEN = 1e-5  # squared brightness: windows that vary less are even
WEAK = 1e-6  # pull to nothing of pixels that no window ties to others
MARGIN = 0.08  # of the person's height around the person


def matte(
    pixels: UInt8[np.ndarray, "H W 3"], cover: Float32[np.ndarray, "H W"]
) -> Float32[np.ndarray, "H W"]:
    """How much of each pixel is the person, 0..1, from how likely it is."""
    rows, columns = np.flatnonzero((cover > 0.5).any(axis=1)), np.flatnonzero((cover > 0.5).any(axis=0))
    if not len(rows):
        return cover
    height, width = cover.shape
    margin = round(MARGIN * len(rows)) + 4
    top, bottom = max(rows[0] - margin, 0), min(rows[-1] + 1 + margin, height)
    left, right = max(columns[0] - margin, 0), min(columns[-1] + 1 + margin, width)
    small, likely = (shrunk(each[top:bottom, left:right]) for each in (pixels, cover))
    found = np.zeros_like(cover)
    size = (right - left, bottom - top)
    alpha = Image.fromarray(solve(small, likely)).resize(size, Image.Resampling.BICUBIC)
    found[top:bottom, left:right] = np.asarray(alpha).clip(0, 1)
    return found


def shrunk(picture: np.ndarray) -> np.ndarray:
    """The picture, of a size that can be matted in a second."""
    height, width = picture.shape[:2]
    share = min(LARGEST / max(height, width), 1.0)
    size = (max(round(width * share), 1), max(round(height * share), 1))
    return np.asarray(Image.fromarray(picture).resize(size, Image.Resampling.BOX if share < 1 else None))


def solve(
    pixels: UInt8[np.ndarray, "H W 3"], likely: Float32[np.ndarray, "H W"]
) -> Float32[np.ndarray, "H W"]:
    """The matte of a small picture. Only the largest piece counts."""
    band = max(round(BAND * len(pixels)), 1)
    sure = largest(binary_erosion(likely > SURE, iterations=band))
    possible = np.asarray(binary_dilation(largest(likely > SURELY_NOT), iterations=band), dtype=bool)
    unknown = possible & ~sure
    if not (sure.any() and (~possible).any() and unknown.any()):
        return likely
    matting = laplacian(pixels / 255.0, unknown)
    known, free = np.flatnonzero(~unknown), np.flatnonzero(unknown)
    rows = matting[free]
    right = -rows[:, known] @ sure.reshape(-1)[known].astype(np.float64)
    alpha = sure.reshape(-1).astype(np.float64)
    alpha[free] = np.asarray(spsolve((rows[:, free] + WEAK * identity(len(free))).tocsc(), right))
    return alpha.reshape(sure.shape).clip(0, 1).astype(np.float32)


def laplacian(pixels: Float64[np.ndarray, "H W 3"], unknown: Bool[np.ndarray, "H W"]) -> csr_matrix:
    """The matting Laplacian (the paper's equation 12) of all windows that reach an unknown pixel."""
    height, width = unknown.shape
    middles = np.argwhere(binary_dilation(unknown, np.ones((3, 3)))[1:-1, 1:-1]) + 1
    steps = np.stack(np.meshgrid([-1, 0, 1], [-1, 0, 1], indexing="ij"), axis=-1).reshape(-1, 2)
    places = middles[:, None] + steps  # windows, nine pixels, row and column
    numbers = places @ [width, 1]
    colors = pixels.reshape(-1, 3)[numbers]
    apart = colors - colors.mean(axis=1, keepdims=True)
    spread = np.einsum("wid,wie->wde", apart, apart) / 9 + EVEN / 9 * np.eye(3)
    alike = (1 + np.einsum("wid,wde,wje->wij", apart, np.linalg.inv(spread), apart)) / 9
    values = np.eye(9) - alike
    row, column = (np.broadcast_to(each, values.shape) for each in (numbers[:, :, None], numbers[:, None]))
    size = height * width
    return csr_matrix((values.reshape(-1), (row.reshape(-1), column.reshape(-1))), shape=(size, size))


def largest(mask: np.ndarray) -> np.ndarray:
    """The mask's largest piece."""
    labelled: Any = label(mask)
    pieces, count = labelled
    if count < 2:
        return mask
    sizes = np.bincount(pieces.reshape(-1))
    sizes[0] = 0
    return pieces == sizes.argmax()
