"""What the coding says of a person, in words that people use."""

from dataclasses import asdict, dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from avatargen.errors import InputError
from avatargen.wardrobe import garments
from avatargen.wardrobe.attributes import LATENT_SIZE, People
from avatargen.wardrobe.colour_names import colour_name
from avatargen.wardrobe.condition import MEN_HAIR, WOMEN_HAIR
from avatargen.wardrobe.person import wears_hat

YOUNG_AXIS, OLD_AXIS = 2 / 3, 1.0  # of the body's age, which says 25 and 90 years there
YOUNG_YEARS, OLD_YEARS = 25, 90
BEARDS = ("none", "stubble", "moustache", "full")
TOPS = ("t-shirt", "v-neck", "shirt", "turtleneck")
SHOES = ("sneakers", "boots", "flats", "leather")
PATTERNS = ("plain", "plain", "plain", "checks", "stripes", "stripes", "print", "blocks")


@dataclass(frozen=True, kw_only=True)
class Attributes:
    """One person in words. What is not worn has the value none, and its colour is None."""

    gender: str  # woman, man
    age_years: int  # about
    height_m: float  # crown of the head to the soles
    skin: str
    eyes: str
    hair: str
    hair_color: str | None
    beard: str
    hat: str
    hat_color: str | None
    top: str
    top_color: str
    sleeves: str
    pattern: str
    pattern_color: str | None
    bottom: str
    bottom_color: str
    outer: str
    outer_color: str | None
    shoes: str
    shoe_color: str

    def __post_init__(self) -> None:
        if not 0.1 < self.height_m < 10:  # also catches NaN
            raise InputError(f"attributes: a person of {self.height_m:g} m; heights are in metres")

    def facts(self) -> dict[str, str | int | float]:
        """Names and values, as reports and files hold them, without those that are None."""
        return {name: value for name, value in asdict(self).items() if value is not None}


def people_of(z: Float[Tensor, "B Z"]) -> People:
    """People of latents of this coding or an earlier one, which had fewer coordinates: those that it had not
    are at their means.

    Raises:
        InputError: more coordinates than the coding has.
    """
    return People(torch.nn.functional.pad(z, (0, max(0, LATENT_SIZE - z.shape[1]))))


def describe(people: People, height: float) -> Attributes:
    """One person in words; `people` holds one latent, and `height` is the body's in metres."""
    hair, hat, outer = hair_style(people), yes(wears_hat(people)), yes(people.choice("outer_a"))
    pattern = PATTERNS[number(people, "pattern_a", "pattern_b", "pattern_c")]
    woman = yes(people.choice("woman"))
    second = name_of(people.colour("second", chroma=0.2))
    skirt = yes(garments.has_skirt(people))
    return Attributes(
        gender="woman" if woman else "man",
        age_years=years(float(people.between("age", 0.62, 0.93))),
        height_m=round(height, 4),
        skin=between(
            rank(people, "skin_light"), ("light", 0.285), ("medium", 0.56), ("brown", 0.81), ("dark", 1.0)
        ),
        eyes=between(rank(people, "eye_hue"), ("brown", 0.5), ("green", 0.83), ("blue", 1.0)),
        hair=hair,
        hair_color=None if hair == "bald" else hair_color(people),
        beard="none" if woman else BEARDS[number(people, "beard_a", "beard_b")],
        hat="beanie" if hat else "none",
        hat_color=second if hat else None,
        top=TOPS[number(people, "collar_a", "collar_b")],
        top_color=name_of(people.colour("top")),
        sleeves=sleeves(people),
        pattern=pattern,
        pattern_color=None if pattern == "plain" else second,
        bottom=bottom(people),
        bottom_color=name_of(garments.skirt_colour(people) if skirt else garments.trouser_colour(people)),
        outer=("coat" if yes(people.choice("outer_b")) else "jacket") if outer else "none",
        outer_color=name_of(garments.outer_colour(people)) if outer else None,
        shoes=SHOES[number(people, "shoe_a", "shoe_b")],
        shoe_color=name_of(garments.shoe_colour(people)),
    )


def yes(choice: Tensor) -> bool:
    return bool(choice > 0.5)


def rank(people: People, name: str) -> float:
    return float(people.measure(name))


def number(people: People, *bits: str) -> int:
    return int(people.kind(*bits))


def name_of(color: Float[Tensor, "1 1 3"]) -> str:
    return colour_name(color[0, 0].double().numpy())


def between(value: float, *names: tuple[str, float]) -> str:
    """The first name whose upper end is not below the value."""
    return next(name for name, end in names if value <= end)


def years(axis: float) -> int:
    """Age in years of a place on the body's axis."""
    share = (axis - YOUNG_AXIS) / (OLD_AXIS - YOUNG_AXIS)
    return round(YOUNG_YEARS + share * (OLD_YEARS - YOUNG_YEARS)) if share > 0 else YOUNG_YEARS


def hair_style(people: People) -> str:
    """By the tables of codes of women's and men's hair."""
    codes = WOMEN_HAIR if yes(people.choice("woman")) else MEN_HAIR
    code = number(people, "hair_a", "hair_b", "hair_c")
    return next(style for style, numbers in codes.items() if code in numbers)


def hair_color(people: People) -> str:
    if rank(people, "age") > 0.9:
        return "grey"
    return between(rank(people, "hair"), ("black", 0.17), ("brown", 0.66), ("blond", 0.9), ("red", 1.0))


def sleeves(people: People) -> str:
    """By where the sleeve ends on the arm; knitwear has long ones."""
    knit = number(people, "collar_a", "collar_b") == 3 or rank(people, "thickness") > 0.75
    share = rank(people, "sleeve")
    return "long" if knit else between(share, ("none", 0.1), ("short", 0.5), ("long", 1.0))


def bottom(people: People) -> str:
    worn = (
        ("dress", garments.has_dress(people)),
        ("skirt", garments.has_skirt(people)),
        ("shorts", garments.has_shorts(people)),
        ("jeans", garments.has_jeans(people)),
    )
    return next((name for name, has in worn if yes(has)), "trousers")
