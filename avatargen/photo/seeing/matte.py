"""The person's outline, by closed-form matting between what is surely the person and what surely is not
(Levin et al., "A closed-form solution to natural image matting", 2008; by pymatting).
"""

import warnings

import numpy as np
from jaxtyping import Float32, UInt8
from PIL import Image
from scipy.ndimage import binary_dilation, binary_erosion, label

from avatargen.extras import require_extra

LARGEST = 420  # pixels of the longer side of what is matted
SURE, SURELY_NOT = 0.92, 0.08  # of the network's cover
BAND = 0.008  # of the person's height, that the outline may be off
MARGIN = 0.08  # of the person's height around the person


def matte(
    pixels: UInt8[np.ndarray, "H W 3"], cover: Float32[np.ndarray, "H W"]
) -> Float32[np.ndarray, "H W"]:
    """How much of each pixel is the person, 0..1, from how likely it is."""
    require_extra("pymatting")
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
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        from pymatting import estimate_alpha_cf
    band = max(round(BAND * len(pixels)), 1)
    sure = largest(binary_erosion(likely > SURE, iterations=band))
    possible = binary_dilation(largest(likely > SURELY_NOT), iterations=band)
    trimap = np.where(sure, 1.0, np.where(possible, 0.5, 0.0))
    if not (sure.any() and (trimap == 0).any() and (trimap == 0.5).any()):
        return likely
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        alpha = estimate_alpha_cf(pixels / 255.0, trimap)
    return alpha.astype(np.float32)


def largest(mask: np.ndarray) -> np.ndarray:
    """The mask's largest piece."""
    pieces, count = label(mask)
    if count < 2:
        return mask
    sizes = np.bincount(pieces.reshape(-1))
    sizes[0] = 0
    return pieces == sizes.argmax()
