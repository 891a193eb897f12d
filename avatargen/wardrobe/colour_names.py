"""Colours in plain words: the name of the nearest of a few known colours, in CIE L*a*b* (D65).

The wardrobe's colours are muted, and so are these. Letters: N colours, K known ones.
"""

import numpy as np
from jaxtyping import Float, Float64, Int64

KNOWN = {  # sRGB 0..1
    "black": ((0.04, 0.04, 0.04), (0.12, 0.12, 0.12)),
    "grey": ((0.28, 0.28, 0.28), (0.45, 0.45, 0.45), (0.62, 0.62, 0.62), (0.75, 0.75, 0.75)),
    "white": ((0.92, 0.92, 0.92), (1.0, 1.0, 1.0)),
    "red": ((0.42, 0.12, 0.12), (0.60, 0.20, 0.20), (0.75, 0.30, 0.28)),
    "pink": ((0.72, 0.42, 0.52), (0.88, 0.62, 0.70), (0.95, 0.80, 0.84)),
    "brown": ((0.22, 0.13, 0.07), (0.38, 0.24, 0.15), (0.52, 0.36, 0.24)),
    "beige": ((0.80, 0.71, 0.58), (0.92, 0.86, 0.76)),
    "orange": ((0.80, 0.48, 0.24), (0.90, 0.62, 0.40)),
    "yellow": ((0.72, 0.66, 0.32), (0.88, 0.84, 0.52)),
    "green": ((0.10, 0.24, 0.10), (0.25, 0.42, 0.22), (0.40, 0.56, 0.32), (0.60, 0.76, 0.54)),
    "teal": ((0.10, 0.34, 0.34), (0.30, 0.56, 0.56), (0.55, 0.78, 0.78)),
    "blue": (
        (0.08, 0.12, 0.28),
        (0.14, 0.24, 0.62),
        (0.20, 0.28, 0.46),
        (0.32, 0.46, 0.66),
        (0.60, 0.74, 0.88),
    ),
    "purple": ((0.20, 0.10, 0.26), (0.38, 0.24, 0.46), (0.56, 0.42, 0.64), (0.76, 0.64, 0.84)),
}
NAMES = tuple(KNOWN)
ANCHORS = np.array([color for colors in KNOWN.values() for color in colors])
NAME_OF_ANCHOR = np.array([i for i, colors in enumerate(KNOWN.values()) for _ in colors])
WHITE = np.array([0.95047, 1.0, 1.08883])  # XYZ of D65
XYZ_FROM_RGB = np.array(
    [[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.0721750], [0.0193339, 0.1191920, 0.9503041]]
)


def lab(rgb: Float[np.ndarray, "N 3"]) -> Float64[np.ndarray, "N 3"]:
    """CIE L*a*b* of sRGB colours in 0..1 (IEC 61966-2-1, CIE 15)."""
    rgb = np.asarray(rgb, dtype=np.float64)
    linear = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb.clip(0) + 0.055) / 1.055) ** 2.4)
    ratio = linear @ XYZ_FROM_RGB.T / WHITE
    f = np.where(ratio > (6 / 29) ** 3, np.cbrt(ratio), ratio / (3 * (6 / 29) ** 2) + 4 / 29)
    x, y, z = f.T
    return np.stack([116 * y - 16, 500 * (x - y), 200 * (y - z)], axis=1)


LAB_OF_ANCHORS = lab(ANCHORS)


def distances(rgb: Float[np.ndarray, "N 3"]) -> Float64[np.ndarray, "N K"]:
    """How far each colour is from each name's nearest known colour, in L*a*b*."""
    apart = np.linalg.norm(lab(rgb)[:, None] - LAB_OF_ANCHORS[None], axis=2)
    return np.stack([apart[:, i == NAME_OF_ANCHOR].min(axis=1) for i in range(len(NAMES))], axis=1)


def nearest_names(rgb: Float[np.ndarray, "N 3"]) -> Int64[np.ndarray, " N"]:
    """Numbers in `NAMES` of the colours' names."""
    return distances(rgb).argmin(axis=1)


def colour_name(rgb: Float[np.ndarray, "3"]) -> str:
    """The colour's name."""
    return NAMES[int(nearest_names(np.asarray(rgb)[None])[0])]
