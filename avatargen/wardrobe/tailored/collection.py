"""The garments that are sewn in code, by name: how each is cut, finished and painted.

They are made when somebody first asks for one, which takes seconds; what a draw needs to know of them is
known before.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np
from jaxtyping import Float64

from avatargen.wardrobe.makehuman.load import FittedGarment
from avatargen.wardrobe.tailored import cuts
from avatargen.wardrobe.tailored.bottoms import Bottom, bottom_paint, bottom_sheet
from avatargen.wardrobe.tailored.coats import Coat, coat_paint, coat_sheet
from avatargen.wardrobe.tailored.collars import Collar, collared
from avatargen.wardrobe.tailored.details import cords, dots, placket, pouch, ribs
from avatargen.wardrobe.tailored.dresses import Dress, dress_paint, dress_sheet
from avatargen.wardrobe.tailored.form import Sheet
from avatargen.wardrobe.tailored.hanging import Fall, carried, skirt
from avatargen.wardrobe.tailored.painting import Texels, within
from avatargen.wardrobe.tailored.sewing import sew
from avatargen.wardrobe.tailored.skirts import skirt_paint
from avatargen.wardrobe.tailored.tops import Top, top_paint, top_sheet

Color = tuple[float, float, float]
Colors = Float64[np.ndarray, "N 3"]
WOMEN, MEN = ("Female", "Tailored"), ("Male", "Tailored")


@dataclass(frozen=True, kw_only=True)
class Pattern:
    """What is known of a garment before it is made; `own_color` is its cloth's, sRGB 0..1."""

    name: str
    kind: str
    tags: tuple[str, ...]
    own_color: Color
    cloth: Callable[[], Sheet]
    paint: Callable[[Texels], Colors]


def top(
    name: str,
    tags: tuple[str, ...],
    cut: Top,
    collar: Collar | None = None,
    more: Callable[[Colors, Texels], Colors] | None = None,
) -> Pattern:
    """A top, with a collar and more paint where wanted."""

    def cloth() -> Sheet:
        sheet = top_sheet(cut)
        return sheet if collar is None else collared(sheet, collar, cut.ease)

    def paint(found: Texels) -> Colors:
        color = top_paint(cut, found)
        return color if more is None else more(color, found)

    return Pattern(name=name, kind="top", tags=tags, own_color=cut.base, cloth=cloth, paint=paint)


def bottom(name: str, tags: tuple[str, ...], cut: Bottom) -> Pattern:
    return Pattern(
        name=name,
        kind="bottom",
        tags=tags,
        own_color=cut.base,
        cloth=lambda: bottom_sheet(cut),
        paint=lambda found: bottom_paint(cut, found),
    )


def skirt_of(name: str, fall: Fall, base: Color) -> Pattern:
    return Pattern(
        name=name,
        kind="bottom",
        tags=WOMEN,
        own_color=base,
        cloth=lambda: carried(skirt(fall)),
        paint=lambda found: skirt_paint(fall, base, found),
    )


def dress_of(name: str, cut: Dress, more: Callable[[Colors, Texels], Colors] | None = None) -> Pattern:
    def paint(found: Texels) -> Colors:
        color = dress_paint(cut, found)
        return color if more is None else more(color, found)

    return Pattern(
        name=name,
        kind="dress",
        tags=WOMEN,
        own_color=cut.top.base,
        cloth=lambda: dress_sheet(cut),
        paint=paint,
    )


def coat_of(name: str, tags: tuple[str, ...], cut: Coat) -> Pattern:
    return Pattern(
        name=name,
        kind="outer",
        tags=tags,
        own_color=cut.dress.top.base,
        cloth=lambda: coat_sheet(cut),
        paint=lambda found: coat_paint(cut, found),
    )


def knitted(cut: Top) -> Callable[[Colors, Texels], Colors]:
    """Ribs at cuffs and hem."""

    def more(color: Colors, found: Texels) -> Colors:
        color = ribs(color, found.at, within(cut.ends(found.at), -1.0, 0.05), arm=True)
        return ribs(color, found.at, within(found.at[:, 1] - cut.hem, -1.0, 0.045), arm=False)

    return more


def dotted(color: Colors, found: Texels) -> Colors:
    return dots(color, found.flat, 0.05, 0.0085, np.array([0.93, 0.9, 0.86]))


def soft_hood(color: Colors, found: Texels) -> Colors:
    """A hoodie's ribs, its pouch and cords."""
    color = pouch(knitted(cuts.HOODIE)(color, found), found.at, 0.045)
    return cords(color, found.at, 0.32, 0.48)


PATTERNS = {
    pattern.name: pattern
    for pattern in (
        top("tailored-tshirt", WOMEN, cuts.TEE),
        top("tailored-tank", WOMEN, cuts.TANK),
        top(
            "tailored-blouse",
            WOMEN,
            cuts.BLOUSE,
            cuts.BLOUSE_COLLAR,
            lambda color, found: placket(color, found.at, -0.5, 8, 0.4),
        ),
        top("tailored-sweater", WOMEN, cuts.SWEATER, None, knitted(cuts.SWEATER)),
        top("tailored-hoodie", (*MEN, "Casual"), cuts.HOODIE, cuts.HOOD, soft_hood),
        top(
            "tailored-polo",
            MEN,
            cuts.POLO,
            cuts.POLO_COLLAR,
            lambda color, found: placket(color, found.at, 0.35, 3, 0.465),
        ),
        top(
            "tailored-shirt",
            (*MEN, "Casual"),
            cuts.SHIRT,
            cuts.SHIRT_COLLAR,
            lambda color, found: placket(color, found.at, -0.5, 7, 0.44),
        ),
        top("tailored-crew", (*MEN, "Casual"), cuts.CREW),
        top("tailored-pullover", MEN, cuts.PULLOVER, None, knitted(cuts.PULLOVER)),
        bottom("tailored-leggings", WOMEN, cuts.LEGGINGS),
        bottom("tailored-jeans", WOMEN, cuts.JEANS),
        bottom("tailored-shorts", WOMEN, cuts.SHORTS),
        bottom("tailored-chinos", MEN, cuts.CHINOS),
        skirt_of("tailored-skirt", cuts.SKIRT, (0.33, 0.25, 0.3)),
        skirt_of("tailored-pleated", cuts.PLEATED, (0.2, 0.23, 0.35)),
        dress_of("tailored-dress", cuts.DRESS),
        dress_of("tailored-dotted", cuts.DOTTED, dotted),
        dress_of("tailored-midi", cuts.MIDI),
        coat_of("tailored-coat", WOMEN, cuts.COAT),
        coat_of("tailored-peacoat", MEN, cuts.PEACOAT),
    )
}


@cache
def made(name: str) -> FittedGarment:
    """A garment of the collection."""
    pattern = PATTERNS[name]
    return sew(name, pattern.kind, pattern.tags, pattern.cloth(), pattern.paint)
