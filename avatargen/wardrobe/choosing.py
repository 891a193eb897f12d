"""What one may choose of a person, in words: the names of traits, their values, and what cannot be together.

    Traits(gender="woman", hair="long", bottom="dress", top_color="navy", height=1.70)

`VALUES` are those that procedural people of the package's other weights show, `SHOWN` those of the default
ones, whose colours may be any. The standard library alone, so that a command can refuse a word before torch
loads.
"""

import difflib
import json
from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path

from avatargen.errors import InputError
from avatargen.wardrobe.named_colours import is_colour

SHORTEST, TALLEST = 1.40, 2.10  # m: taller or shorter than that bodies stop looking like people's
VALUES: dict[str, tuple[str, ...]] = {
    "gender": ("woman", "man"),
    "age": ("young", "old"),
    "skin": ("light", "medium", "brown", "dark"),
    "hair": ("bald", "cropped", "short", "bob", "long", "bun", "ponytail", "afro"),
    "hair_color": ("black", "brown", "blond", "grey"),
    "beard": ("none", "stubble", "full"),
    "hat": ("none", "beanie"),
    "top": ("t-shirt", "v-neck", "shirt", "turtleneck"),
    "top_color": ("black", "grey", "white", "brown", "beige", "green", "teal", "blue", "purple", "pink"),
    "sleeves": ("none", "short", "long"),
    "bottom": ("trousers", "jeans", "shorts", "skirt", "dress"),
    "bottom_color": ("black", "grey", "brown"),
    "outer": ("none", "jacket", "coat"),
    "outer_color": ("black", "grey", "brown", "beige", "green", "purple"),
    "shoes": ("sneakers", "boots", "flats", "leather"),
}
CLOTH = (
    *("black", "grey", "white", "red", "pink", "brown", "beige", "orange", "yellow", "green", "teal", "blue"),
    "purple",
)
SHOWN: dict[str, tuple[str, ...]] = {  # by the people that are drawn by default
    "gender": ("woman", "man"),
    "age": ("young", "middleage", "old"),
    "figure": ("slim", "average", "heavy", "muscular"),
    "stature": ("short", "average", "tall"),
    "skin": ("light", "medium", "brown", "dark"),
    "eyes": ("brown", "blue", "green", "grey"),
    "hair": ("bald", "short", "bob", "long", "ponytail", "afro"),
    "hair_color": ("black", "brown", "blond", "red", "grey", "white"),
    "beard": ("none", "stubble", "moustache", "goatee", "full"),
    "hat": ("none", "hat"),
    "hat_color": CLOTH,
    "top": (
        *("t-shirt", "shirt", "suit", "tank top", "blouse", "sweater", "hoodie", "polo shirt"),
        "dress",
    ),
    "top_color": CLOTH,
    "pattern": ("plain", "across", "down", "checks"),
    "pattern_color": CLOTH,
    "bottom": ("trousers", "jeans", "shorts", "leggings", "skirt", "dress"),
    "bottom_color": CLOTH,
    "overall": ("none", "overall"),
    "overall_color": CLOTH,
    "outer": ("none", "jacket", "coat"),
    "outer_color": CLOTH,
    "shoes": ("none", "sneakers", "boots", "leather"),
    "shoes_color": CLOTH,
}
ANY = tuple(name for name in SHOWN if name.endswith("_color"))  # traits that may be any colour
NOTHING = "there is nothing to colour"
HEIGHT = "height"  # the one trait that is a number


@dataclass(frozen=True, kw_only=True)
class Traits:
    """What was chosen of a person; None leaves it as the seed has it. `height` is in metres, 1.40 to 2.10.

    Raises InputError for an unknown value, and for choices that contradict each other.
    """

    gender: str | None = None
    age: str | None = None
    height: float | None = None
    figure: str | None = None
    stature: str | None = None
    skin: str | None = None
    eyes: str | None = None
    hair: str | None = None
    hair_color: str | None = None
    beard: str | None = None
    hat: str | None = None
    hat_color: str | None = None
    top: str | None = None
    top_color: str | None = None
    pattern: str | None = None  # of what is worn on the upper body
    pattern_color: str | None = None
    sleeves: str | None = None
    bottom: str | None = None
    bottom_color: str | None = None
    overall: str | None = None
    overall_color: str | None = None
    outer: str | None = None
    outer_color: str | None = None
    shoes: str | None = None
    shoes_color: str | None = None

    def __post_init__(self) -> None:
        for name, value in self.given().items():
            if name != HEIGHT and value not in values_of(name) and not (name in ANY and any_colour(value)):
                raise InputError(f"{shown(name)}: found {value!r}, wanted {wanted(name)}")
        check_height(self.height)
        for first, second, why in self.contradictions():
            raise InputError(f"{self.told(first)} and {self.told(second)}: {why}; leave out one of them")

    def given(self) -> dict[str, str | float]:
        """The traits that were chosen, in order."""
        named = {field.name: getattr(self, field.name) for field in fields(self)}
        return {name: value for name, value in named.items() if value is not None}

    def told(self, name: str) -> str:
        """A trait and its value in words."""
        return f"{shown(name)} {getattr(self, name)}"

    def contradictions(self) -> list[tuple[str, str, str]]:
        """Pairs of chosen traits that nobody can have at once, and why."""
        pairs = [
            (self.hair == "bald" and self.hair_color, "hair", "hair_color", "there is no hair to colour"),
            (self.pattern == "plain" and self.pattern_color, "pattern", "pattern_color", NOTHING),
            (self.height and self.stature, "height", "stature", "both say how tall"),
            *(
                (
                    getattr(self, worn) == "none" and getattr(self, f"{worn}_color"),
                    worn,
                    f"{worn}_color",
                    NOTHING,
                )
                for worn in ("hat", "overall", "outer", "shoes")
            ),
        ]
        return [(first, second, why) for found, first, second, why in pairs if found]


def traits_of(found: Mapping[str, object]) -> Traits:
    """Traits from names and values, as in a JSON file; names may have dashes.

    Raises:
        InputError: a name is none of a trait's, or a value is none of its values.
    """
    known = {field.name for field in fields(Traits)}
    chosen: dict[str, str | float] = {}
    for key, value in found.items():
        name = str(key).replace("-", "_")
        if name not in known:
            near = difflib.get_close_matches(name, known, 1)
            hint = f"did you mean {near[0]}?" if near else "avatargen traits lists them"
            raise InputError(f"traits: found {key!r}, which is no trait; {hint}")
        if name == HEIGHT and isinstance(value, int | float) and not isinstance(value, bool):
            chosen[name] = float(value)
        elif name != HEIGHT and isinstance(value, str):
            chosen[name] = value
        else:
            raise InputError(f"{shown(name)}: found {value!r}, wanted {wanted(name)}")
    return Traits(**chosen)  # pyright: ignore[reportArgumentType]


def read_traits(path: Path) -> Traits:
    """Traits of a JSON file: one object of names and values, heights in metres.

    Raises:
        InputError: the file is missing or no such object.
    """
    try:
        found = json.loads(path.read_text())
    except (OSError, ValueError, RecursionError) as error:
        raise InputError(
            f"traits: {path} cannot be read as JSON ({error}); give a file of names and values"
        ) from error
    if not isinstance(found, dict):
        raise InputError(f'traits: {path} holds no object; write names and values, as in {{"hair": "long"}}')
    return traits_of(found)


def check_height(metres: float | None) -> None:
    """Raises InputError for a height that no body is given."""
    if metres is not None and not SHORTEST <= metres <= TALLEST:  # also catches NaN
        raise InputError(f"height: found {metres:g} m, wanted {SHORTEST:.2f} to {TALLEST:.2f} m")


def shown(name: str) -> str:
    """A trait's name as an option has it."""
    return name.replace("_", "-")


def any_colour(value: str | float) -> bool:
    """Whether it is the name of a colour, a plain one or another, or #rrggbb."""
    return value in CLOTH or is_colour(str(value))


def values_of(name: str) -> tuple[str, ...]:
    """A trait's values, those of the default people and what others have besides."""
    return tuple(dict.fromkeys((*SHOWN.get(name, ()), *VALUES.get(name, ()))))


def wanted(name: str) -> str:
    """A trait's values in words."""
    if name == HEIGHT:
        return f"metres from {SHORTEST:.2f} to {TALLEST:.2f}"
    return f"one of {', '.join(values_of(name))}" + (
        " or another colour's name or #rrggbb" if name in ANY else ""
    )
