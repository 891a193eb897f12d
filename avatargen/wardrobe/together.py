"""What the procedural wardrobe's people cannot have at once, and what only women or only men of it have."""

from avatargen.errors import InputError
from avatargen.wardrobe.choosing import VALUES, Traits

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


def check_together(traits: Traits) -> None:
    """Raises InputError for values that these people do not have, and for traits of which one hides or
    excludes another."""
    for name, value in traits.given().items():
        if name != "height" and value not in VALUES.get(name, ()):
            raise InputError(f"{traits.told(name)}: these weights do not say; leave it out")
    check_one_sex(traits)
    for first, second, why in excluded(traits):
        raise InputError(f"{traits.told(first)} and {traits.told(second)}: {why}; leave out one of them")


def excluded(traits: Traits) -> list[tuple[str, str, str]]:
    """Pairs of chosen traits that cannot both be seen, and why."""
    hidden = traits.hat == "beanie" and traits.hair not in SEEN_UNDER_A_HAT
    over = "outer" if traits.outer not in (None, "none") else "outer_color"
    jacket = getattr(traits, over) is not None
    closed = traits.top is not None and traits.top not in SEEN_UNDER_A_JACKET
    age, grey = traits.age and traits.hair_color, traits.hair_color == "grey"
    pairs = [
        (hidden and traits.hair, "hair", "hat", "the hat hides the hair"),
        (hidden and traits.hair_color, "hair_color", "hat", "the hat hides the hair"),
        (age and (traits.age == "old") != grey, "age", "hair_color", "hair goes grey with age"),
        (traits.bottom == "dress" and traits.bottom_color, "bottom", "bottom_color", "a dress has top_color"),
        (traits.bottom == "jeans" and traits.bottom_color, "bottom", "bottom_color", "jeans are blue"),
        (jacket and closed, "top", over, "the outer garment hides the neck"),
        (jacket and traits.sleeves, "sleeves", over, "the outer garment hides the sleeves"),
        (
            traits.top == "turtleneck" and traits.sleeves in ("none", "short"),
            "top",
            "sleeves",
            "a turtleneck has long sleeves",
        ),
    ]
    return [(first, second, why) for found, first, second, why in pairs if found]


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
