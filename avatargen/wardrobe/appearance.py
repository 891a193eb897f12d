"""How a garment looks on one person: dyed and printed.

Colours change in CIELAB: the garment's median becomes the one asked for and what differs from it stays, so
folds, seams and wear are kept. Prints are laid on the cloth by its size in metres.

Letters: N points. sRGB 0..1.
"""

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float

from avatargen.wardrobe.colour_names import lab

TRIM = 0.7  # of an artist's contrast of hue that stays under a dye of a clear colour
CLEAR = 40.0  # chroma of such a dye; under a grey one little of it stays: washed denim is not brown
INK = 0.9  # how much of the cloth's colour a print covers

Rgb = tuple[float, float, float]


@runtime_checkable
class Appearance(Protocol):
    """Colours on one person from the artist's own."""

    def color(
        self, own: Float[np.ndarray, "N c"], places: Float[np.ndarray, "N 2"]
    ) -> Float[np.ndarray, "N 3"]:
        """`own` is the artist's colour and, where trim keeps its own, how far a dye takes; `places` the
        places along and across the cloth, m."""
        ...


@dataclass(frozen=True, kw_only=True)
class Dye:
    """Of cloth. `middle` is the median of the artist's colours (CIELAB), `dye` the one asked for; without one
    they stay. `kind` is plain, across, down or checks; `width` metres of a stripe.
    """

    middle: tuple[float, float, float]
    dye: Rgb | None
    kind: str
    ink: Rgb
    width: float

    def color(
        self, own: Float[np.ndarray, "N c"], places: Float[np.ndarray, "N 2"]
    ) -> Float[np.ndarray, "N 3"]:
        colour = own[:, :3]
        if self.dye is not None:
            takes = own[:, 3:].clip(0, 1) if own.shape[1] > 3 else np.float32(1)
            colour = colour + (dyed(colour, self.middle, self.dye) - colour) * takes
        if self.kind == "plain":
            return colour
        usual = rgb_of(np.array(self.middle)[None])[0] if self.dye is None else np.array(self.dye)
        return printed(colour, places, self.kind, self.ink, self.width, float(usual.mean()))


def dyed(own: Float[np.ndarray, "N 3"], middle: tuple[float, float, float], dye: Rgb) -> np.ndarray:
    """Colours whose median `middle` (CIELAB) was, with `dye` in its place."""
    wanted = lab(np.array(dye)[None])[0]
    # dark cloth shows less of its folds, light cloth no more than white allows
    contrast = np.clip(0.35 + wanted[0] / max(middle[0], 25.0), 0.4, 1.2)
    trim = TRIM * min(0.3 + float(np.hypot(*wanted[1:])) / CLEAR, 1.0)
    new = wanted + (lab(np.asarray(own, dtype=np.float64).clip(0, 1)) - middle) * (contrast, trim, trim)
    return rgb_of(new)


def rgb_of(values: Float[np.ndarray, "N 3"]) -> Float[np.ndarray, "N 3"]:
    """sRGB of CIELAB (D65), clipped to what sRGB has."""
    y = (values[:, :1] + 16) / 116
    xyz = np.concatenate([y + values[:, 1:2] / 500, y, y - values[:, 2:3] / 200], axis=1)
    xyz = np.where(xyz > 6 / 29, xyz**3, (xyz - 16 / 116) / 7.787) * (0.95047, 1.0, 1.08883)
    linear = (xyz @ FROM_XYZ.T).clip(0, 1)
    return np.where(linear > 0.0031308, 1.055 * linear ** (1 / 2.4) - 0.055, 12.92 * linear)


FROM_XYZ = np.array(
    [
        [3.2404813432, -1.5371515163, -0.4985363262],
        [-0.9692549500, 1.8759900015, 0.0415559266],
        [0.0556466391, -0.2040413384, 1.0573110696],
    ]
)


def printed(
    colour: Float[np.ndarray, "N 3"],
    place: Float[np.ndarray, "N 2"],
    kind: str,
    ink: Rgb,
    width: float,
    usual: float,
) -> Float[np.ndarray, "N 3"]:
    """Colours with a print over them at places in metres (along the garment, across it). `usual` is the
    cloth's median brightness: the ink takes its folds over."""
    bands = [stripe(place[:, axis], width) for axis in (0, 1)]
    share = {"across": bands[0], "down": bands[1], "checks": 0.5 * bands[0] + 0.5 * bands[1]}[kind]
    shade = colour.mean(axis=1, keepdims=True) / max(usual, 0.05)
    return colour + (np.array(ink) * shade.clip(0.5, 1.4) - colour) * (INK * share)[:, None]


def stripe(x: Float[np.ndarray, " N"], width: float) -> Float[np.ndarray, " N"]:
    """1 on stripes of a width, 0 on gaps of twice that, with edges of a millimetre."""
    phase = np.abs((x / (3 * width)) % 1 - 0.5) * 3 * width  # m from the middle of a stripe
    return 1 - np.clip((phase - width / 2) / 0.001 + 0.5, 0, 1)
