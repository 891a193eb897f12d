"""What a seed wears of a folder: the attributes of one person, and the draw that gives them.

The first 80 numbers of the latent are those that the procedural wardrobe reads, drawn as ever; what is new
comes after them, from the same generator, so the old ones stay what they are.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from math import erf
from typing import TypeVar

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from avatargen.wardrobe.attributes import LATENT_SIZE, People, coordinate
from avatargen.wardrobe.colour_names import colour_name
from avatargen.wardrobe.dyes import BOTTOMS, COATS, SHOES, SUITS, TOPS, Dyes
from avatargen.wardrobe.face_paint import FaceLines
from avatargen.wardrobe.makehuman.hairs import (
    HairWorn,
    beard_style,
    hair_style,
    hair_worn,
    natural_hair,
)
from avatargen.wardrobe.makehuman.outfit import Item, worn_by
from avatargen.wardrobe.makehuman.words import eye_word, garment_word, hair_color_word, hair_word

NEW = (
    "skin_photo",
    "skin_mix",
    "eyes",
    "brows",
    "lashes",
    "hair_style",
    "hair_colour",
    "top_item",
    "bottom_item",
    "outer_item",
    "shoes_item",
    "top_plain",
    "bottom_plain",
    "print_kind",
    "print_scale",
    "print_l",
    "print_a",
    "print_b",
    "spare",
    "spare_too",
    "hair_part",
    "hair_length",
    "hairline",
    "beard",
    "outfit",
    "borrows",
    "coat",
    "coat_item",
    "socks",
)
DRAWN_AT_ONCE = 20  # the first of them; those after are drawn one by one, so that none changes when more come
FULL_SIZE = LATENT_SIZE + len(NEW)
NATURAL_IRISES = ("brown", "brownlight", "green", "grey", "blue", "lightblue", "deepblue", "bluegreen")
DARK_IRISES = ("brown", "brown", "brown", "brownlight")
TONES = (("light", 0.285), ("medium", 0.56), ("brown", 0.81), ("dark", 1.0))  # by the measure of the skin
DRESS = "dress"
UNPRINTED = ("hoodie", "sweater")
SOCKS = ((0.88, 0.88, 0.88), (0.07, 0.07, 0.08), (0.45, 0.45, 0.47))  # white, black, grey
DYED = {  # kind: coordinates of its colour, the dyes, what decides whether it keeps its own, and how many do
    "top": ("top", TOPS, "top_plain", 0.2),
    "dress": ("top", TOPS, "top_plain", 0.2),
    "outer": ("outer", COATS, "top_plain", 0.2),
    "bottom": ("bottom", BOTTOMS, "bottom_plain", 0.4),
    "overall": ("bottom", BOTTOMS, "bottom_plain", 0.4),
    "hat": ("second", COATS, "bottom_plain", 0.5),
    "shoes": ("shoe", SHOES, "spare_too", 0.4),
}
STATURES = (("short", 0.16), ("average", 0.84), ("tall", 1.0))  # by the measure of the height
WORN = ("hat", "top", "bottom", "overall", "outer", "shoes")  # kinds in a person's description


T = TypeVar("T")


@dataclass(frozen=True, kw_only=True)
class Attributes:
    """One person of the artist-made wardrobe. Colours are sRGB in 0..1; names are those of the files."""

    sex: str  # woman or man
    age: str  # young, middleage or old
    tone: str  # of the skin: light, medium, brown or dark
    skin: tuple[str, str]  # two photographs
    skin_mix: float  # share of the second
    skin_tint: tuple[float, float, float]  # factors on the skin
    eyes: str
    face: FaceLines
    hair: str | None
    hair_colour: tuple[float, float, float]
    hair_worn: HairWorn
    beard: str  # one of BEARDS
    garments: tuple[str, ...]  # from the skin outward
    colours: tuple[tuple[float, float, float] | None, ...]  # of each garment; None: as the artist has it
    kinds: tuple[str, ...]  # of each garment: top, bottom, ...
    shades: tuple[tuple[float, float, float], ...]  # of each garment: how it looks on the whole
    prints: tuple[str, ...]  # of each garment: plain, across, down or checks
    print_colour: tuple[float, float, float]
    print_width: float  # m
    figure: str = "average"  # slim, average, heavy or muscular
    stature: str = "average"  # for the sex: short, average or tall

    def facts(self) -> dict[str, str | int | float]:
        """Names and values, as reports and files hold them; what is not worn is none."""
        found: dict[str, str | int | float] = {
            "gender": self.sex,
            "age": self.age,
            "figure": self.figure,
            "stature": self.stature,
            "skin": self.tone,
            "eyes": eye_word(self.eyes),
            "hair": hair_word(self.hair),
        }
        if self.hair:
            found["hair_color"] = hair_color_word(self.hair_colour)
        found["beard"] = self.beard
        for kind in WORN:
            place = self.kinds.index(kind) if kind in self.kinds else None
            found[kind] = "none" if place is None else garment_word(self.garments[place], kind)
            if place is not None:
                found[f"{kind}_color"] = colour_name(np.array(self.shades[place]))
        if DRESS in self.kinds:  # it is both
            found["top"] = found["bottom"] = DRESS
            found["top_color"] = colour_name(np.array(self.shades[self.kinds.index(DRESS)]))
        covering = [i for i, kind in enumerate(self.kinds) if kind in ("top", "overall", DRESS)]
        found["pattern"] = self.prints[covering[-1]] if covering else "plain"
        if found["pattern"] != "plain":
            found["pattern_color"] = colour_name(np.array(self.print_colour))
        found["garments"] = ", ".join(self.garments)
        return found


def draw_latent(seed: int) -> Float[Tensor, "1 Z"]:
    """The latent of a seed: the procedural wardrobe's 80 numbers, then the new ones."""
    draw = torch.Generator().manual_seed(seed)
    old = torch.randn(1, LATENT_SIZE, generator=draw)
    new = [torch.randn(1, DRAWN_AT_ONCE, generator=draw)]
    new += [torch.randn(1, 1, generator=draw) for _ in NEW[DRAWN_AT_ONCE:]]
    return torch.cat([old, *new], dim=1)


class Draw:
    """One latent, read by name."""

    def __init__(self, z: Float[Tensor, "1 Z"]) -> None:
        self.people = People(z[:, :LATENT_SIZE])
        self.new = dict(zip(NEW, z[0, LATENT_SIZE:].tolist(), strict=True))

    def share(self, name: str) -> float:
        """Uniform in 0..1, from a new number or one of the old measures."""
        if name in self.new:
            return 0.5 * (1 + erf(self.new[name] / 2**0.5))
        return float(self.people.measure(name))

    def one_of(self, name: str, options: tuple[T, ...]) -> T:
        """One of the options, all as likely."""
        return options[min(int(self.share(name) * len(options)), len(options) - 1)]

    def dye(self, name: str, among: Dyes) -> tuple[float, float, float]:
        """One of the dyes, by a colour's three coordinates."""
        first = coordinate(name)
        lighter, clearer = self.people.z[0, first + 1 : first + 3].tolist()
        return among.dye(self.share(name), lighter, clearer)


def skin_names(names: list[str], age: str, tone: str, sex: str) -> list[str]:
    """The photographs of an age, tone and sex; of the nearest age where there is none."""
    for each in (age, "middleage", "young", "old"):
        if found := [n for n in names if n.startswith(f"{each}_{tone}skinned_{sex}_")]:
            return found
    return names


def skin_of(depth: float) -> tuple[float, float]:
    """The share of a dark skin in the mixture, and a factor on it, by the measure of the skin."""
    dark = min(max((depth - 0.5) / 0.3, 0.0), 1.0)
    return dark, 1.05 - 0.16 * min(depth / 0.5, 1.0) if dark == 0 else 0.95 + 0.1 * (1 - dark)


def choose(draw: Draw, garments: Mapping[str, Item], skins: list[str], irises: list[str]) -> Attributes:
    """The person of a draw, out of what a folder holds."""
    woman = float(draw.people.choice("woman")) > 0.5
    sex, years, depth = ("female" if woman else "male"), draw.share("age"), draw.share("skin_light")
    age = "young" if years < 0.6 else "middleage" if years < 0.85 else "old"
    dark, shade = skin_of(depth)
    light = skin_names(skins, age, "light", sex)
    deep = skin_names(skins, age, "dark", sex)
    first = draw.one_of("skin_photo", tuple(light))
    if dark > 0:
        second, mixed = draw.one_of("skin_photo", tuple(deep)), dark
    else:
        second, mixed = draw.one_of("skin_mix", tuple(light)), 0.5 * draw.share("skin_mix")
    warm = draw.share("skin_warm") - 0.5
    tint = (shade * (1 + 0.03 * warm), shade, shade * (1 - 0.07 * warm))
    options = [name for name in (DARK_IRISES if dark > 0.2 else NATURAL_IRISES) if name in irises] or irises
    worn, colours, prints = outfit(draw, garments, woman)
    shades = [garments[n].own_color if c is None else c for n, c in zip(worn, colours, strict=True)]
    styles = {g.name: g.tags for g in garments.values() if g.kind == "hair"}
    hair = hair_style(draw.share("hair_style"), styles, woman, dark)
    return Attributes(
        sex="woman" if woman else "man",
        age=age,
        tone=next(name for name, end in TONES if depth <= end),
        skin=(str(first), str(second)),
        skin_mix=mixed,
        skin_tint=tint,
        eyes=str(draw.one_of("eyes", tuple(options))),
        face=face_lines(draw, woman),
        hair=hair,
        hair_colour=natural_hair(draw.share("hair_colour"), dark, years, draw.share("wear")),
        hair_worn=hair_worn(draw.share, woman, years),
        beard=beard_style(draw.share("beard"), woman),
        garments=tuple(worn),
        colours=tuple(colours),
        kinds=tuple(garments[name].kind for name in worn),
        shades=tuple(shades),
        prints=tuple(prints),
        print_colour=draw.dye("second", TOPS),
        print_width=0.006 + 0.03 * draw.share("print_scale"),
        figure=figure_word(draw.share("weight"), draw.share("muscle")),
        stature=next(word for word, end in STATURES if draw.share("height") <= end),
    )


def face_lines(draw: Draw, woman: bool) -> FaceLines:
    """Women's brows are finer and higher, and their lashes longer."""
    width, arch = draw.share("brows"), draw.share("lashes")
    return FaceLines(
        brow_width=0.3 + 0.4 * width if woman else 0.5 + 0.5 * width,
        brow_arch=0.5 + 0.5 * arch if woman else 0.1 + 0.5 * arch,
        lashes=1.0 if woman else 0.2,
    )


def figure_word(weight: float, muscle: float) -> str:
    """What a figure is called, by the shares of people who weigh less and who are less muscular."""
    if weight > 0.8:
        return "heavy"
    if muscle > 0.8:
        return "muscular"
    return "slim" if weight < 0.2 else "average"


def outfit(
    draw: Draw, garments: Mapping[str, Item], woman: bool
) -> tuple[list[str], list[tuple[float, float, float] | None], list[str]]:
    """What is worn from the skin outward, its colours and prints."""
    worn = worn_by(draw, garments, woman)
    colours, prints = [], []
    for garment in worn:
        socks = draw.one_of("socks", SOCKS) if garment.kind == "socks" else None
        colours.append(socks or garment_colour(draw, garment))
        plain = "elegant" in garment.name or garment_word(garment.name, garment.kind) in UNPRINTED
        printed = garment.kind == "top" and not plain and colours[-1] is not None
        prints.append(print_kind(draw) if printed else "plain")
    return [g.name for g in worn], colours, prints


def garment_colour(draw: Draw, garment: Item) -> tuple[float, float, float] | None:
    """The colour that a garment is dyed, None for the artist's own."""
    if garment.kind not in DYED or garment_word(garment.name, garment.kind) == "sneakers":
        return None  # sneakers are of several colours
    name, among, plain, own = DYED[garment.kind]
    if draw.share(plain) < own:
        return None
    if garment.kind != "shoes" and {"Elegant", "Male"} <= set(garment.tags):
        return draw.dye("outer", SUITS)
    return draw.dye(name, among)


def print_kind(draw: Draw) -> str:
    """A third wear stripes or checks."""
    share = draw.share("print_kind")
    return "across" if share < 0.14 else "down" if share < 0.24 else "checks" if share < 0.36 else "plain"
