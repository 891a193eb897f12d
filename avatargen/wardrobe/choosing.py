"""What one may choose of a person, in words: the names of traits, their values, and what cannot be together.

    Traits(gender="woman", hair="long", bottom="dress", height=1.70)

Values that some weights of the package show are here; `SHOWN` are those of the default ones. The standard
library alone, so that a command can refuse a word before torch loads.
"""

import difflib
import json
from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path

from avatargen.errors import InputError

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
SHOWN: dict[str, tuple[str, ...]] = {  # by the people that are drawn by default
    "gender": ("woman", "man"),
    "age": ("young", "old"),
    "skin": ("light", "medium", "brown", "dark"),
    "hair": ("bald", "short", "bob", "long", "ponytail", "afro"),
    "hair_color": ("black", "brown", "blond", "grey"),
    "top": ("t-shirt", "shirt"),
    "top_color": VALUES["top_color"],
    "bottom": ("trousers", "jeans", "shorts", "skirt", "dress"),
    "bottom_color": VALUES["bottom_color"],
    "outer": ("none", "jacket", "coat"),
    "outer_color": VALUES["outer_color"],
    "shoes": ("sneakers", "boots", "leather"),
}
HEIGHT = "height"  # the one trait that is a number
WORN_BY: dict[tuple[str, str | float], str] = {  # what only women or only men have in this wardrobe
    ("hair", "bald"): "man",
    ("hair", "cropped"): "man",
    ("hair", "bob"): "woman",
    ("hair", "bun"): "woman",
    ("hair", "ponytail"): "woman",
    ("beard", "stubble"): "man",
    ("beard", "full"): "man",
    ("bottom", "shorts"): "man",
    ("bottom", "skirt"): "woman",
    ("bottom", "dress"): "woman",
}
SEEN_UNDER_A_HAT = ("bob", "long")
SEEN_UNDER_A_JACKET = ("shirt", "turtleneck")


@dataclass(frozen=True, kw_only=True)
class Traits:
    """What was chosen of a person; None leaves it as the seed has it. `height` is in metres, 1.40 to 2.10.

    Raises InputError for an unknown value, and for choices that contradict each other.
    """

    gender: str | None = None
    age: str | None = None
    height: float | None = None
    skin: str | None = None
    hair: str | None = None
    hair_color: str | None = None
    beard: str | None = None
    hat: str | None = None
    top: str | None = None
    top_color: str | None = None
    sleeves: str | None = None
    bottom: str | None = None
    bottom_color: str | None = None
    outer: str | None = None
    outer_color: str | None = None
    shoes: str | None = None

    def __post_init__(self) -> None:
        for name, value in self.given().items():
            if name != HEIGHT and value not in VALUES[name]:
                raise InputError(f"{shown(name)}: found {value!r}, wanted one of {', '.join(VALUES[name])}")
        check_height(self.height)
        check_one_sex(self)
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
        """Pairs of chosen traits that cannot both be seen, and why."""
        hidden = self.hat == "beanie" and self.hair not in SEEN_UNDER_A_HAT
        over = "outer" if self.outer not in (None, "none") else "outer_color"
        jacket = getattr(self, over) is not None
        closed = self.top is not None and self.top not in SEEN_UNDER_A_JACKET
        pairs = [
            (hidden and self.hair, "hair", "hat", "the hat hides the hair"),
            (hidden and self.hair_color, "hair_color", "hat", "the hat hides the hair"),
            (self.hair == "bald" and self.hair_color, "hair", "hair_color", "there is no hair to colour"),
            (
                self.age and self.hair_color and (self.age == "old") != (self.hair_color == "grey"),
                "age",
                "hair_color",
                "hair goes grey with age",
            ),
            (self.bottom == "dress" and self.bottom_color, "bottom", "bottom_color", "a dress has top_color"),
            (self.bottom == "jeans" and self.bottom_color, "bottom", "bottom_color", "jeans are blue"),
            (self.outer == "none" and self.outer_color, "outer", "outer_color", "there is nothing to colour"),
            (jacket and closed, "top", over, "the outer garment hides the neck"),
            (jacket and self.sleeves, "sleeves", over, "the outer garment hides the sleeves"),
            (
                self.top == "turtleneck" and self.sleeves in ("none", "short"),
                "top",
                "sleeves",
                "a turtleneck has long sleeves",
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


def check_one_sex(traits: Traits) -> None:
    """Raises InputError where what was chosen is worn by women alone and by men alone."""
    given = traits.given()
    worn = {name: WORN_BY[name, value] for name, value in given.items() if (name, value) in WORN_BY}
    if traits.gender is not None:
        worn = {"gender": traits.gender} | worn
    for first, second in zip(worn, list(worn)[1:], strict=False):
        if worn[first] != worn[second]:
            only = second if first == "gender" else first
            sex = {"woman": "women", "man": "men"}[worn[only]]
            raise InputError(
                f"{traits.told(first)} and {traits.told(second)}: {traits.told(only)} is for {sex} alone; "
                "leave out one of them"
            )


def shown(name: str) -> str:
    """A trait's name as an option has it."""
    return name.replace("_", "-")


def wanted(name: str) -> str:
    """A trait's values in words."""
    return (
        f"metres from {SHORTEST:.2f} to {TALLEST:.2f}"
        if name == HEIGHT
        else f"one of {', '.join(VALUES[name])}"
    )
