"""Leggings, trousers and shorts: cut from the form between waist and hem."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from avatargen.smoothstep import smoothstep
from avatargen.wardrobe.tailored.curves import Places, Values, above, below
from avatargen.wardrobe.tailored.cutting import parted
from avatargen.wardrobe.tailored.draping import moved_out
from avatargen.wardrobe.tailored.folds import of_bottom
from avatargen.wardrobe.tailored.form import Sheet, to_front
from avatargen.wardrobe.tailored.painting import Texels, cloth, line, shaded, within
from avatargen.wardrobe.tailored.tops import sewn

CROTCH = -0.115  # m


@dataclass(frozen=True, kw_only=True)
class Bottom:
    """How legs are cut and finished. Metres."""

    waist: float  # height
    dip: float  # of the waist in front
    hem: float
    ease: float = 0.004
    wide: float = 0.0  # more of it at the hem
    band: float = 0.035  # of the waist
    folded: float = 0.003  # how far folds stand out
    fly: bool = False  # with pockets
    base: tuple[float, float, float] = (0.3, 0.3, 0.32)

    def belt(self, at: Places) -> Values:
        return below(at, self.waist, self.dip)

    def eased(self, at: Places) -> Values:
        """How far it stays off the skin."""
        return self.ease + self.wide * smoothstep((0.0 - at[:, 1]) / (0.0 - self.hem))


def bottom_sheet(bottom: Bottom) -> Sheet:
    """The cloth of both legs, with a raised band around the waist."""
    sheet = sewn((bottom.belt, lambda at: above(at, bottom.hem)), bottom.eased)
    sheet = parted(sheet, to_front(sheet.at))
    sheet = parted(sheet, sheet.at[:, 0])
    band = within(bottom.belt(sheet.at), -1.0, bottom.band, 0.003)
    cuff = within(sheet.at[:, 1] - bottom.hem, -1.0, 0.02, 0.003)
    fold = of_bottom(sheet.at, bottom.hem) * (1 - band.clip(0, 1))
    return moved_out(sheet, 0.0014 * np.maximum(band, cuff) + bottom.folded * fold)


def bottom_paint(bottom: Bottom, found: Texels) -> Float64[np.ndarray, "N 3"]:
    """Its cloth, waistband, seams and hems; with a fly, also pockets."""
    at = found.at
    color = cloth(found, bottom.base)
    belt, hem, front = bottom.belt(at), at[:, 1] - bottom.hem, to_front(at)
    outer = line(front, 0.003) * (np.abs(at[:, 0]) > 0.1)
    inner = line(front, 0.003) * (np.abs(at[:, 0]) < 0.1) * (at[:, 1] < CROTCH)
    centre = line(at[:, 0], 0.003) * (at[:, 1] > CROTCH - 0.04)
    for seam in (outer, inner, centre):
        color = shaded(color, seam, 0.86)
    color = shaded(color, line(belt - bottom.band, 0.003), 0.8)
    color = shaded(color, line(hem - 0.022, 0.003), 0.84)
    if bottom.fly:
        color = pockets(color, bottom, at)
    return shaded(color, within(belt, -1.0, 0.003), 0.9)


def pockets(color: Float64[np.ndarray, "N 3"], bottom: Bottom, at: Places) -> Float64[np.ndarray, "N 3"]:
    """Slanted ones in front, patches behind, the fly's stitching and a button."""
    front, x, y = to_front(at) > 0, np.abs(at[:, 0]), bottom.waist - bottom.dip - at[:, 1]
    slant = (x - 0.075) * 0.62 - (y - bottom.band) * 0.5
    on = front & (y > bottom.band) & (y < bottom.band + 0.11)
    color = shaded(color, line(slant, 0.0035) * on, 0.78)
    curve = np.hypot(at[:, 0] + 0.004, (y - 0.11).clip(0) * 0.7) - 0.03
    color = shaded(
        color, line(curve, 0.003) * front * (at[:, 0] > -0.004) * (y > bottom.band) * (y < 0.16), 0.8
    )
    button = np.hypot(at[:, 0], y - 0.5 * bottom.band)
    color = shaded(color, within(button, -1.0, 0.008, 0.002) * front, 0.6)
    across, down = np.abs(x - 0.085), bottom.waist - at[:, 1] - bottom.band - 0.035
    patch = np.maximum(across - 0.052, np.abs(down - 0.06) - 0.06 + 0.25 * across)
    return shaded(color, line(patch, 0.0035) * ~front * (down > -0.02), 0.78)
