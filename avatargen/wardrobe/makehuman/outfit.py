"""What goes together: the garments of one person, drawn among those there are, from the skin outward.

Women mostly wear women's garments, a third of them a dress or a skirt. An artist's outer garment comes with
the top that is cut for it; a tailored one is worn over what fits closely. Bare legs go without socks, but in
sneakers.
"""

from collections.abc import Mapping
from typing import Protocol, TypeVar, runtime_checkable

from avatargen.wardrobe.makehuman.words import garment_word

T = TypeVar("T")
TAILORED = "Tailored"  # the tag of what is sewn in code, each piece by itself
HATS = 0.08  # share of people who wear one
DRESSES, SKIRTS = 0.2, 0.36  # of women: up to the first in a dress, up to the second in a skirt
BORROWS = 0.35  # of women: those who may wear men's casual clothes
COATS = 0.3  # of those who wear what a coat goes over
CLOSE = (  # what a tailored coat goes over
    "female_casualsuit01-bottom",
    "female_casualsuit01-top",
    "female_casualsuit02-top",
    "female_sportsuit01-bottom",
    "female_sportsuit01-top",
    "male_casualsuit02-bottom",
    "male_casualsuit02-top",
    "male_casualsuit03-bottom",
    "male_casualsuit04-bottom",
    "male_casualsuit04-top",
    "male_casualsuit05-bottom",
    "male_casualsuit06-bottom",
    "male_casualsuit06-top",
    "male_elegantsuit01-bottom",
    "tailored-crew",
    "tailored-jeans",
    "tailored-leggings",
    "tailored-tank",
    "tailored-tshirt",
)
SKIRTED = ("skirt", "dress")
BARE = ("skirt", "shorts", "dress")  # words of what leaves the legs bare


@runtime_checkable
class Item(Protocol):
    """What can be chosen: a garment or hair. `own_color` is its artist's, on the whole, sRGB."""

    @property
    def name(self) -> str: ...

    @property
    def kind(self) -> str: ...

    @property
    def tags(self) -> tuple[str, ...]: ...

    @property
    def own_color(self) -> tuple[float, float, float]: ...


@runtime_checkable
class Shares(Protocol):
    """A draw, read by name."""

    def share(self, name: str) -> float: ...

    def one_of(self, name: str, options: tuple[T, ...]) -> T: ...


def outfit_of(garment: Item) -> str:
    """The name of the file that a garment comes from; a tailored one is by itself."""
    return garment.name if TAILORED in garment.tags else garment.name.split("-")[0]


def word(garment: Item) -> str:
    return garment_word(garment.name, garment.kind)


class Wearable:
    """The garments that one sex wears, by kind. Women who borrow wear men's casual clothes, too."""

    def __init__(self, garments: Mapping[str, Item], woman: bool, borrows: bool) -> None:
        self.all = tuple(sorted(garments.values(), key=lambda each: each.name))
        self.woman, self.borrows = woman, borrows

    def of(self, kind: str) -> tuple[Item, ...]:
        """Those of a kind that suit; all of them where none does."""
        all_of = tuple(each for each in self.all if each.kind == kind)
        return tuple(each for each in all_of if self.suits(each)) or all_of

    def suits(self, garment: Item) -> bool:
        sexes = {"Male", "Female"} & set(garment.tags)
        own = not sexes or ("Female" if self.woman else "Male") in sexes
        return own or (self.woman and self.borrows and "Casual" in garment.tags)

    def with_it(self, kind: str, garment: Item) -> list[Item]:
        """What of a kind comes with a garment."""
        return [each for each in self.all if each.kind == kind and outfit_of(each) == outfit_of(garment)]

    @property
    def uppers(self) -> tuple[Item, ...]:
        """What is worn above: tops that are cut to be worn alone, artists' outer garments, and overalls."""
        outer = [each for each in self.of("outer") if TAILORED not in each.tags and self.suits(each)]
        over = {outfit_of(each) for each in self.all if each.kind in ("outer", "overall")}
        tops = [each for each in self.of("top") if outfit_of(each) not in over]
        overalls = [] if self.woman else list(self.of("overall"))
        others = [each for each in self.of("outer") if TAILORED not in each.tags]  # where nothing suits
        return tuple(sorted([*tops, *outer, *overalls] or others, key=lambda each: each.name))


def worn_by(draw: Shares, garments: Mapping[str, Item], woman: bool) -> list[Item]:
    """What is worn from the skin outward."""
    wearable = Wearable(garments, woman, draw.share("borrows") < BORROWS)
    clothes = clothes_of(draw, wearable, woman)
    worn = footwear(draw, wearable, clothes) + clothes
    if wearable.of("hat") and draw.share("spare") < HATS:
        worn.append(draw.one_of("spare_too", wearable.of("hat")))
    return worn


def clothes_of(draw: Shares, wearable: Wearable, woman: bool) -> list[Item]:
    """All but shoes and hats."""
    style = draw.share("outfit") if woman else 1.0
    uppers, dresses = wearable.uppers, wearable.of("dress")
    if dresses and (style < DRESSES or not (uppers or wearable.of("bottom"))):
        return [draw.one_of("top_item", dresses)]
    upper = draw.one_of("top_item", uppers) if uppers else None
    clothes: list[Item] = []
    if upper is None or upper.kind != "overall":
        bottoms = wearable.of("bottom")
        skirts = tuple(each for each in bottoms if word(each) == "skirt")
        skirts = tuple(each for each in skirts if TAILORED in each.tags) or skirts  # these hang level
        short = () if upper is None or word(upper) != "suit" else ("shorts",)  # no shorts under a jacket
        legs = tuple(each for each in bottoms if word(each) not in ("skirt", *short))
        if among := (skirts if style < SKIRTS else legs) or skirts or bottoms:
            clothes.append(draw.one_of("bottom_item", among))
    if upper is None:
        return clothes
    if upper.kind in ("outer", "overall"):
        clothes += wearable.with_it("top", upper)
    clothes.append(upper)
    coats = [each for each in wearable.of("outer") if TAILORED in each.tags and wearable.suits(each)]
    if coats and all(each.name in CLOSE for each in clothes) and draw.share("coat") < COATS:
        clothes.append(draw.one_of("coat_item", tuple(coats)))
    return clothes


def footwear(draw: Shares, wearable: Wearable, clothes: list[Item]) -> list[Item]:
    """Shoes with their socks; none on bare legs, but in sneakers."""
    if not wearable.of("shoes"):
        return []
    among = wearable.of("shoes")
    if any(word(each) in SKIRTED for each in clothes):
        among = tuple(each for each in among if word(each) != "boots") or among
    shoes = draw.one_of("shoes_item", among)
    bare = any(word(each) in BARE for each in clothes) and word(shoes) != "sneakers"
    return [*([] if bare else wearable.with_it("socks", shoes)), shoes]
