"""Colours that were said of hair, skin, eyes and cloth, as traits have them."""

import numpy as np

from avatargen.wardrobe.appearance import rgb_of
from avatargen.wardrobe.choosing import CLOTH
from avatargen.wardrobe.colour_names import colour_name, lab
from avatargen.wardrobe.makehuman.painted import CLOTH as SHADES
from avatargen.wardrobe.named_colours import Rgb, named_rgb

TONES = {  # of a colour that has no name with it: lightness, and a factor on the chroma, CIELAB
    "dark": (-18.0, 1.0),
    "light": (20.0, 0.8),
    "bright": (4.0, 1.3),
}
HAIR = {  # words that say another colour of hair than of cloth
    "blond": ("golden", "gold", "sand", "sandy", "straw", "honey", "yellow", "beige", "wheat", "light brown"),
    "red": ("red", "orange", "copper", "rust", "russet", "auburn", "mahogany", "ginger"),
    "brown": ("brown", "chestnut", "chocolate", "hazel", "coffee", "dark brown", "caramel", "mocha"),
    "black": ("black", "jet black", "ebony", "raven"),
    "grey": ("grey", "silver", "ash grey", "slate grey", "dark grey", "light grey", "steel grey"),
    "white": ("white", "snow white", "snow", "off white", "ivory"),
}
EYES = {"hazel": "brown", "amber": "brown", "black": "brown", "beige": "brown", "teal": "green"}
SKIN = {
    "black": "dark",
    "ebony": "dark",
    "chocolate": "dark",
    "white": "light",
    "olive": "medium",
    "tan": "medium",
}
SKIN_FROM = (("light", 72.0), ("medium", 58.0), ("brown", 38.0), ("dark", -1.0))  # L*, at least


def rgb(name: str) -> Rgb:
    """sRGB of a plain word or of another colour's name."""
    found = SHADES[name][1] if name in SHADES else named_rgb(name)
    assert found is not None, name  # items know colours alone
    return found


def plain(name: str) -> str:
    """The plain word for a colour."""
    return name if name in CLOTH else colour_name(np.array(rgb(name)))


def toned(name: str, tone: str | None) -> str:
    """A colour made dark, light or bright, as #rrggbb; or its name."""
    if tone not in TONES:
        return name
    more, factor = TONES[tone]
    values = lab(np.array([rgb(name)])) * (1.0, factor, factor) + (more, 0.0, 0.0)
    return "#" + "".join(
        f"{round(255 * float(each)):02x}" for each in rgb_of(values.clip((4, -128, -128), (97, 128, 128)))[0]
    )


def hair_word(name: str, tone: str | None) -> str:
    """A colour of hair: a natural one, or any that it is dyed."""
    for word, names in HAIR.items():
        if name in names:
            return "black" if (word, tone) == ("brown", "dark") else word
    return name


def eye_word(name: str) -> str:
    """A colour of eyes."""
    return EYES.get(name, EYES.get(plain(name), plain(name)))


def skin_word(name: str) -> str:
    """A tone of skin."""
    if name in SKIN:
        return SKIN[name]
    if name == "brown":
        return "brown"
    lightness = float(lab(np.array([rgb(name)]))[0, 0])
    return next(word for word, least in SKIN_FROM if lightness >= least)
