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

from avatargen.wardrobe.attributes import LATENT_SIZE, People
from avatargen.wardrobe.colour_names import colour_name
from avatargen.wardrobe.makehuman.outfit import Item, worn_by
from avatargen.wardrobe.makehuman.words import garment_word, hair_color_word, hair_word
from avatargen.wardrobe.skin import HAIR_TONES

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
    "outfit",
    "borrows",
    "coat",
    "coat_item",
    "socks",
)
FIRST_NEW = 20  # of these were drawn before there were more, and stay what they are
FULL_SIZE = LATENT_SIZE + len(NEW)
NATURAL_IRISES = ("brown", "brownlight", "green", "grey", "blue", "lightblue", "deepblue", "bluegreen")
THIN = ("long01",)  # sheets of hair that meshes of usual size tear down the back
BROWS = {  # of MakeHuman's, those that frown least
    "woman": ("eyebrow001", "eyebrow004", "eyebrow006", "eyebrow008", "eyebrow011"),
    "man": ("eyebrow001", "eyebrow004", "eyebrow008", "eyebrow010", "eyebrow012"),
}
DARK_IRISES = ("brown", "brown", "brownlight")
TONES = (("light", 0.285), ("medium", 0.56), ("brown", 0.81), ("dark", 1.0))  # by the measure of the skin
DRESS = "dress"
UNPRINTED = ("hoodie", "sweater")
SOCKS = ((0.88, 0.88, 0.88), (0.07, 0.07, 0.08), (0.45, 0.45, 0.47))  # white, black, grey
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
    brows: str
    lashes: str
    hair: str | None
    hair_colour: tuple[float, float, float]
    garments: tuple[str, ...]  # from the skin outward
    colours: tuple[tuple[float, float, float] | None, ...]  # of each garment; None: as the artist has it
    kinds: tuple[str, ...]  # of each garment: top, bottom, ...
    shades: tuple[tuple[float, float, float], ...]  # of each garment: how it looks on the whole
    prints: tuple[str, ...]  # of each garment: plain, across, down or checks
    print_colour: tuple[float, float, float]
    print_width: float  # m

    def facts(self) -> dict[str, str | int | float]:
        """Names and values, as reports and files hold them; what is not worn is none."""
        found: dict[str, str | int | float] = {
            "gender": self.sex,
            "age": self.age,
            "skin": self.tone,
            "eyes": self.eyes,
            "hair": hair_word(self.hair),
        }
        if self.hair:
            found["hair_color"] = hair_color_word(self.hair_colour)
        for kind in WORN:
            place = self.kinds.index(kind) if kind in self.kinds else None
            found[kind] = "none" if place is None else garment_word(self.garments[place], kind)
            if place is not None and kind != "shoes":
                found[f"{kind}_color"] = colour_name(np.array(self.shades[place]))
        if DRESS in self.kinds:  # it is both
            found["top"] = found["bottom"] = DRESS
            found["top_color"] = colour_name(np.array(self.shades[self.kinds.index(DRESS)]))
        covering = [i for i, kind in enumerate(self.kinds) if kind in ("top", "overall", DRESS)]
        found["pattern"] = self.prints[covering[-1]] if covering else "plain"
        found["garments"] = ", ".join(self.garments)
        return found


def draw_latent(seed: int) -> Float[Tensor, "1 Z"]:
    """The latent of a seed: the procedural wardrobe's 80 numbers, then the new ones."""
    draw = torch.Generator().manual_seed(seed)
    old = torch.randn(1, LATENT_SIZE, generator=draw)
    new = [torch.randn(1, count, generator=draw) for count in (FIRST_NEW, len(NEW) - FIRST_NEW)]
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

    def colour(
        self, name: str, low: float = 0.06, high: float = 0.92, chroma: float = 0.2
    ) -> tuple[float, float, float]:
        """A colour of the procedural coding."""
        r, g, b = self.people.colour(name, low, high, chroma=chroma)[0, 0].tolist()
        return (r, g, b)


def natural_hair(share: float, dark: float, age: float, grey: float) -> tuple[float, float, float]:
    """Hair colours that go with a skin (dark 0..1), greyer with age."""
    place = share * (1 - 0.93 * dark) * (len(HAIR_TONES) - 1.001)
    if 3.2 < place < 4.4 and dark > 0.25:
        place = 1.5
    low = int(place)
    tone = HAIR_TONES[low] + (HAIR_TONES[low + 1] - HAIR_TONES[low]) * (place - low)
    white = max(0.0, min(1.0, (age - 0.72) / 0.28)) * grey
    r, g, b = (tone + (0.66 - tone) * white).tolist()
    return (r, g, b)


def skin_names(names: list[str], age: str, tone: str, sex: str) -> list[str]:
    """The photographs of an age, tone and sex; of the nearest age where there is none."""
    for each in (age, "middleage", "young", "old"):
        if found := [n for n in names if n.startswith(f"{each}_{tone}skinned_{sex}_")]:
            return found
    return names


def choose(draw: Draw, garments: Mapping[str, Item], skins: list[str], irises: list[str]) -> Attributes:
    """The person of a draw, out of what a folder holds."""
    woman = float(draw.people.choice("woman")) > 0.5
    sex, years, depth = ("female" if woman else "male"), draw.share("age"), draw.share("skin_light")
    age = "young" if years < 0.6 else "middleage" if years < 0.85 else "old"
    dark = min(max((depth - 0.5) / 0.3, 0.0), 1.0)
    light = skin_names(skins, age, "light", sex)
    deep = skin_names(skins, age, "dark", sex)
    first = draw.one_of("skin_photo", tuple(light))
    if dark > 0:
        second, mixed = draw.one_of("skin_photo", tuple(deep)), dark
    else:
        second, mixed = draw.one_of("skin_mix", tuple(light)), 0.5 * draw.share("skin_mix")
    warm = draw.share("skin_warm") - 0.5
    shade = 1.05 - 0.16 * min(depth / 0.5, 1.0) if dark == 0 else 0.95 + 0.1 * (1 - dark)
    tint = (shade * (1 + 0.03 * warm), shade, shade * (1 - 0.07 * warm))
    options = [name for name in (DARK_IRISES if dark > 0.2 else NATURAL_IRISES) if name in irises] or irises
    worn, colours, prints = outfit(draw, garments, woman)
    shades = [garments[n].own_color if c is None else c for n, c in zip(worn, colours, strict=True)]
    hair = hair_style(draw, garments, woman, dark)
    brows = [g.name for g in garments.values() if g.kind == "brows"]
    brows = [name for name in brows if name in BROWS["woman" if woman else "man"]] or brows
    lashes = [g.name for g in garments.values() if g.kind == "lashes"]
    return Attributes(
        sex="woman" if woman else "man",
        age=age,
        tone=next(name for name, end in TONES if depth <= end),
        skin=(str(first), str(second)),
        skin_mix=mixed,
        skin_tint=tint,
        eyes=str(draw.one_of("eyes", tuple(options))),
        brows=str(draw.one_of("brows", tuple(sorted(brows)))) if brows else "",
        lashes=str(draw.one_of("lashes", tuple(sorted(lashes)))) if lashes else "",
        hair=hair,
        hair_colour=natural_hair(draw.share("hair_colour"), dark, years, draw.share("wear")),
        garments=tuple(worn),
        colours=tuple(colours),
        kinds=tuple(garments[name].kind for name in worn),
        shades=tuple(shades),
        prints=tuple(prints),
        print_colour=draw.colour("second"),
        print_width=0.006 + 0.03 * draw.share("print_scale"),
    )


def hair_style(draw: Draw, garments: Mapping[str, Item], woman: bool, dark: float) -> str | None:
    """A style for the sex; afro hair on dark skins."""
    if not woman and draw.share("hair_style") > 0.93:
        return None
    styles = [g for g in garments.values() if g.kind == "hair" and g.name not in THIN]
    fitting = [g for g in styles if ("Female" in g.tags) == woman or not {"Male", "Female"} & set(g.tags)]
    fitting = [g for g in fitting if "Afro" not in g.tags or dark > 0.7]
    return str(draw.one_of("hair_style", tuple(sorted(g.name for g in fitting)))) if fitting else None


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
    if "Elegant" in garment.tags and "Male" in garment.tags:  # suits are worn in dark colours
        return draw.colour("outer", 0.05, 0.35, chroma=0.05) if draw.share("top_plain") > 0.4 else None
    if garment.kind in ("top", "dress", "outer"):
        return (
            draw.colour("outer" if garment.kind == "outer" else "top")
            if draw.share("top_plain") > 0.2
            else None
        )
    if garment.kind == "hat":
        return draw.colour("second", 0.05, 0.6) if draw.share("bottom_plain") > 0.5 else None
    if garment.kind in ("bottom", "overall"):
        return draw.colour("bottom", 0.06, 0.5) if draw.share("bottom_plain") > 0.4 else None
    return None


def print_kind(draw: Draw) -> str:
    """A third wear stripes or checks."""
    share = draw.share("print_kind")
    return "across" if share < 0.14 else "down" if share < 0.24 else "checks" if share < 0.36 else "plain"
