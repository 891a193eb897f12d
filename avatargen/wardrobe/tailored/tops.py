"""Tops: cut from the form between neck, arms and hem."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from avatargen.smoothstep import smoothstep
from avatargen.wardrobe.tailored.curves import Places, Values, above, armscye, neckline, sleeve
from avatargen.wardrobe.tailored.cutting import cut, parted
from avatargen.wardrobe.tailored.draping import draped, moved_out
from avatargen.wardrobe.tailored.folds import of_top
from avatargen.wardrobe.tailored.form import Sheet, to_front, whole_form
from avatargen.wardrobe.tailored.painting import Texels, cloth, line, shaded, within

ROUGH, FINE = 26, 3  # rounds of draping
LOOSE = 120  # of them for what hangs from the shoulders: it spans what is hollow
CLOSER = 0.4  # share of ease that edges have less
OVER = 0.005  # m more below the waist, over what is worn there
AROUND = 0.03  # m of the form beyond a pattern's curves that is draped with it

Curve = Callable[[Places], Values]


def sewn(curves: tuple[Curve, ...], ease: Curve, rough: int = ROUGH, fine: int = FINE) -> Sheet:
    """The form between curves, draped at an ease."""
    form = whole_form()
    inside = np.min([curve(form.at) for curve in curves], axis=0)
    sheet = form.kept((inside[form.faces] > -AROUND).all(axis=1)).finer()
    sheet = draped(sheet, ease(sheet.at), rough)
    for curve in curves:
        sheet = cut(sheet, curve(sheet.at))
    return draped(sheet, ease(sheet.at), fine, held=True)


def panelled(sheet: Sheet) -> Sheet:
    """A top's pattern pieces: front and back, and sleeves."""
    sheet = parted(sheet, to_front(sheet.at))
    return parted(sheet, armscye(sheet.at))


@dataclass(frozen=True, kw_only=True)
class Top:
    """How a top is cut and finished. Metres."""

    neck: tuple[float, float, float, float]  # width, depth in front and behind, power
    sleeve: float | None  # its end from the middle; without one, an arm hole
    hem: float  # height
    ease: float = 0.006
    waist: float = 0.004  # more of it at the waist
    cuff: float = 0.008  # more of it at a sleeve's end
    rib: float = 0.016  # width of the band around the neck
    folded: float = 0.003  # how far folds stand out
    base: tuple[float, float, float] = (0.8, 0.8, 0.8)

    def neckline(self, at: Places) -> Values:
        return neckline(at, *self.neck)

    def ends(self, at: Places) -> Values:
        """Inward of the sleeves' ends or of the arm holes."""
        return hole(at) if self.sleeve is None else sleeve(at, self.sleeve)

    def eased(self, at: Places) -> Values:
        """How far it stays off the skin: less at the neck, and at arm holes."""
        edge = self.neckline(at) if self.sleeve else np.minimum(self.neckline(at), hole(at))
        close = 1 - CLOSER * smoothstep(1 - edge / 0.03)
        waist = smoothstep(1 - np.abs(at[:, 1] - 0.17) / 0.16)
        over = OVER * smoothstep((0.13 - at[:, 1]) / 0.08)
        end = self.sleeve or np.inf
        arm = smoothstep((np.abs(at[:, 0]) - 0.17) / max(end - 0.17, 0.02))
        return self.ease * close + over + self.waist * waist * (1 - arm) + self.cuff * arm


def hole(at: Places) -> Values:
    """Inward of a sleeveless garment's arm hole."""
    return armscye(at, top=0.112, under=0.166)


def top_sheet(top: Top, *, ends_below: bool = True) -> Sheet:
    """A top's cloth, with raised bands around its neck and at its ends; at the hem where it `ends_below`."""
    sheet = sewn((top.neckline, lambda at: above(at, top.hem), top.ends), top.eased, LOOSE)
    sheet = panelled(sheet)
    fold = of_top(sheet.at, top.sleeve, top.hem)
    band = within(top.neckline(sheet.at), -1.0, top.rib, 0.003) + within(
        top.ends(sheet.at), -1.0, 0.018, 0.003
    )
    hem = within(sheet.at[:, 1] - top.hem, -1.0, 0.02, 0.003) * ends_below
    return moved_out(sheet, 0.0012 * np.maximum(band, hem) + top.folded * fold * (1 - band.clip(0, 1)))


def top_paint(top: Top, found: Texels) -> Float64[np.ndarray, "N 3"]:
    """Its cloth, seams, the rib of its neck, and hems with their stitching."""
    at = found.at
    color = cloth(found, top.base)
    neck, ends, hem = top.neckline(at), top.ends(at), at[:, 1] - top.hem
    color = shaded(color, within(neck, -1.0, top.rib), 0.93)
    for value, place in ((neck, top.rib), (ends, 0.02), (hem, 0.022)):
        color = shaded(color, line(value - place, 0.003), 0.86)
    for value in (neck, ends):
        color = shaded(color, within(value, -1.0, 0.003), 0.9)
    side = line(to_front(at), 0.0028) * (np.abs(at[:, 0]) > 0.09) * (hem > 0)
    color = shaded(color, side, 0.9)
    return shaded(color, line(armscye(at), 0.003) * (at[:, 1] > 0.385), 0.86)
