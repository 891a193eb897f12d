"""Colours that clothes and shoes are dyed in: those that shops sell, each a little different on each person.

Bottoms leave out what looks like skin. sRGB 0..1.
"""

from dataclasses import dataclass

import numpy as np

from avatargen.wardrobe.appearance import rgb_of
from avatargen.wardrobe.colour_names import lab

Rgb = tuple[float, float, float]

LIGHTER, CLEARER = 5.0, 0.2  # L* and share of chroma that one standard deviation moves a dye


@dataclass(frozen=True, kw_only=True)
class Dyes:
    """Dyes with how many wear each."""

    colours: tuple[Rgb, ...]
    wearers: tuple[int, ...]

    def __post_init__(self) -> None:
        assert len(self.colours) == len(self.wearers) > 0 and min(self.wearers) > 0, self

    def dye(self, share: float, lighter: float, clearer: float) -> Rgb:
        """The dye at a share (0..1) of all wearers, moved by two numbers of the normal distribution."""
        ends = np.cumsum(self.wearers) / sum(self.wearers)
        place = min(int(np.searchsorted(ends, share, side="right")), len(ends) - 1)
        wanted = lab(np.array(self.colours[place])[None])
        wanted[:, 0] += LIGHTER * np.clip(lighter, -2, 2)
        wanted[:, 1:] *= 1 + CLEARER * np.clip(clearer, -2, 2)
        r, g, b = rgb_of(wanted).clip(0.02, 0.97)[0].tolist()
        return (r, g, b)


def dyes(*rows: tuple[int, Rgb]) -> Dyes:
    """From rows of wearers and colour."""
    return Dyes(colours=tuple(colour for _, colour in rows), wearers=tuple(count for count, _ in rows))


TOPS = dyes(
    (10, (0.93, 0.93, 0.92)),  # white
    (9, (0.11, 0.11, 0.12)),  # black
    (7, (0.62, 0.63, 0.64)),  # marl
    (5, (0.30, 0.31, 0.33)),  # charcoal
    (9, (0.13, 0.18, 0.33)),  # navy
    (6, (0.23, 0.38, 0.62)),  # blue
    (5, (0.62, 0.76, 0.88)),  # sky
    (4, (0.16, 0.42, 0.45)),  # petrol
    (3, (0.45, 0.72, 0.70)),  # mint
    (4, (0.18, 0.33, 0.22)),  # bottle green
    (4, (0.42, 0.44, 0.28)),  # olive
    (3, (0.60, 0.72, 0.50)),  # sage
    (6, (0.62, 0.13, 0.15)),  # red
    (4, (0.36, 0.11, 0.17)),  # burgundy
    (4, (0.90, 0.66, 0.71)),  # rose
    (2, (0.80, 0.36, 0.52)),  # fuchsia
    (3, (0.62, 0.53, 0.74)),  # lavender
    (2, (0.34, 0.22, 0.42)),  # plum
    (4, (0.86, 0.70, 0.30)),  # mustard
    (2, (0.93, 0.87, 0.55)),  # lemon
    (3, (0.80, 0.42, 0.20)),  # rust
    (4, (0.88, 0.82, 0.70)),  # cream
    (3, (0.42, 0.30, 0.22)),  # brown
)
BOTTOMS = dyes(
    (14, (0.14, 0.18, 0.30)),  # raw denim
    (12, (0.24, 0.34, 0.50)),  # denim
    (6, (0.47, 0.58, 0.72)),  # washed denim
    (14, (0.10, 0.10, 0.11)),  # black
    (9, (0.28, 0.29, 0.31)),  # charcoal
    (5, (0.50, 0.51, 0.52)),  # grey
    (7, (0.66, 0.61, 0.48)),  # khaki
    (4, (0.85, 0.83, 0.77)),  # stone
    (6, (0.34, 0.35, 0.24)),  # olive
    (4, (0.25, 0.19, 0.15)),  # brown
    (2, (0.93, 0.93, 0.91)),  # white
    (2, (0.33, 0.10, 0.14)),  # burgundy
    (2, (0.55, 0.13, 0.14)),  # red
    (2, (0.17, 0.31, 0.22)),  # green
    (1, (0.16, 0.40, 0.42)),  # teal
    (1, (0.34, 0.24, 0.42)),  # purple
    (1, (0.84, 0.68, 0.30)),  # mustard
    (1, (0.83, 0.53, 0.62)),  # rose
    (1, (0.78, 0.40, 0.18)),  # orange
)
COATS = dyes(
    (9, (0.10, 0.10, 0.11)),  # black
    (9, (0.14, 0.17, 0.28)),  # navy
    (8, (0.30, 0.31, 0.33)),  # charcoal
    (4, (0.52, 0.53, 0.54)),  # grey
    (6, (0.36, 0.37, 0.25)),  # olive
    (6, (0.67, 0.60, 0.46)),  # khaki
    (5, (0.34, 0.24, 0.17)),  # brown
    (4, (0.76, 0.64, 0.50)),  # camel
    (3, (0.35, 0.11, 0.16)),  # burgundy
    (3, (0.18, 0.32, 0.22)),  # bottle green
    (2, (0.58, 0.13, 0.15)),  # red
    (2, (0.17, 0.40, 0.43)),  # petrol
    (2, (0.23, 0.37, 0.60)),  # blue
    (1, (0.34, 0.23, 0.42)),  # purple
    (1, (0.85, 0.69, 0.30)),  # yellow
    (1, (0.85, 0.62, 0.68)),  # rose
    (2, (0.90, 0.89, 0.86)),  # white
)
SHOES = dyes(  # of leather
    (10, (0.09, 0.09, 0.10)),  # black
    (7, (0.25, 0.17, 0.12)),  # brown
    (5, (0.46, 0.31, 0.20)),  # tan
    (3, (0.13, 0.16, 0.25)),  # navy
    (3, (0.36, 0.36, 0.37)),  # grey
    (2, (0.33, 0.11, 0.14)),  # burgundy
    (1, (0.45, 0.11, 0.12)),  # red
    (2, (0.62, 0.54, 0.43)),  # sand
    (1, (0.24, 0.28, 0.20)),  # olive
)
SUITS = dyes(
    (10, (0.12, 0.14, 0.22)),  # navy
    (9, (0.25, 0.26, 0.28)),  # charcoal
    (7, (0.10, 0.10, 0.11)),  # black
    (5, (0.45, 0.46, 0.48)),  # grey
    (3, (0.22, 0.28, 0.42)),  # blue
    (3, (0.30, 0.23, 0.18)),  # brown
    (2, (0.62, 0.56, 0.45)),  # sand
    (1, (0.30, 0.11, 0.15)),  # burgundy
    (1, (0.18, 0.28, 0.22)),  # green
)
