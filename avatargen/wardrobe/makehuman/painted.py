"""Chosen colours and prints, laid over what somebody wears; nothing else changes.

A plain word is one of its shades, by how light the person's own draw is; a name such as navy is that colour.
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from avatargen.wardrobe.colour_names import lab
from avatargen.wardrobe.makehuman.borrow import Worn, wearing, worn_by
from avatargen.wardrobe.makehuman.choose import DRESS, Attributes, Draw
from avatargen.wardrobe.makehuman.words import eye_word, hair_color_word
from avatargen.wardrobe.named_colours import Rgb, named_rgb

CLOTH = {  # sRGB 0..1, dark first: colours that cloth of that name usually has
    "black": ((0.05, 0.05, 0.055), (0.07, 0.07, 0.07), (0.09, 0.09, 0.095)),
    "grey": ((0.32, 0.32, 0.33), (0.44, 0.44, 0.45), (0.58, 0.58, 0.58)),
    "white": ((0.92, 0.92, 0.91), (0.95, 0.95, 0.94), (0.97, 0.97, 0.97)),
    "red": ((0.52, 0.07, 0.08), (0.62, 0.09, 0.10), (0.70, 0.13, 0.13)),
    "pink": ((0.82, 0.42, 0.55), (0.88, 0.55, 0.65), (0.93, 0.68, 0.76)),
    "brown": ((0.26, 0.15, 0.09), (0.34, 0.21, 0.12), (0.43, 0.28, 0.17)),
    "beige": ((0.78, 0.69, 0.56), (0.83, 0.75, 0.63), (0.88, 0.81, 0.70)),
    "orange": ((0.80, 0.40, 0.12), (0.86, 0.46, 0.15), (0.90, 0.54, 0.24)),
    "yellow": ((0.84, 0.72, 0.20), (0.89, 0.79, 0.26), (0.92, 0.84, 0.40)),
    "green": ((0.11, 0.30, 0.14), (0.17, 0.40, 0.20), (0.26, 0.50, 0.27)),
    "teal": ((0.06, 0.34, 0.34), (0.10, 0.43, 0.42), (0.22, 0.53, 0.52)),
    "blue": ((0.10, 0.17, 0.40), (0.14, 0.26, 0.55), (0.26, 0.42, 0.68)),
    "purple": ((0.26, 0.12, 0.36), (0.36, 0.19, 0.48), (0.47, 0.30, 0.60)),
}
HAIR = {
    "black": ((0.05, 0.045, 0.045), (0.08, 0.065, 0.06)),
    "brown": ((0.20, 0.125, 0.08), (0.28, 0.17, 0.10), (0.36, 0.23, 0.135)),
    "blond": ((0.62, 0.46, 0.26), (0.70, 0.54, 0.32), (0.80, 0.66, 0.42)),
    "red": ((0.42, 0.16, 0.07), (0.52, 0.20, 0.09), (0.60, 0.26, 0.12)),
    "grey": ((0.42, 0.42, 0.42), (0.52, 0.52, 0.52), (0.62, 0.62, 0.62)),
    "white": ((0.84, 0.84, 0.83), (0.88, 0.88, 0.87)),
}
RANKS = {  # kinds whose colour can be chosen, and the coordinate that says how light it is
    "top": "top",
    "overall": "bottom",
    "bottom": "bottom",
    "outer": "outer",
    "shoes": "shoe",
    "hat": "second",
}
DYED = tuple(RANKS)
PAINTED = ("eyes", "hair_color", "pattern", "pattern_color", *(f"{kind}_color" for kind in DYED))
LIKE = 10.0  # L*a*b* from a word's shades, within which a garment keeps its own colour
COVERING = ("top", "overall", DRESS)  # kinds, the outermost of which takes a print
SEEN = 30.0  # L*a*b* between a print and its cloth, at least, where a print is wished
LIGHT = 55.0  # L* of cloth from which its print is dark


def painted(
    person: Attributes, wanted: Mapping[str, object], draw: Draw, irises: tuple[str, ...]
) -> Attributes:
    """The person with the colours, prints and eyes that are wanted, by trait."""
    worn = worn_by(person)
    names = {kind: str(wanted[f"{kind}_color"]) for kind in DYED if f"{kind}_color" in wanted}
    for kind, name in names.items():
        first = next(other for other in DYED if names.get(other) == name)  # a suit is of one shade
        alike = list(names.values()).count(name) > 1
        worn = [
            dyed(each, name, draw.share(RANKS[first]), alike) if speaks_of(kind, each) else each
            for each in worn
        ]
    worn = printed(worn, wanted)
    person = wearing(person, worn)
    if "pattern" in wanted or "pattern_color" in wanted:
        person = replace(person, print_colour=ink(person, wanted.get("pattern_color"), draw))
    if (name := wanted.get("hair_color")) is not None and hair_color_word(person.hair_colour) != name:
        person = replace(person, hair_colour=shade(str(name), HAIR, draw.share("hair_colour")))
    if (name := wanted.get("eyes")) is not None and eye_word(person.eyes) != name:
        irises = tuple(each for each in irises if eye_word(each) == name) or irises
        person = replace(person, eyes=draw.one_of("eyes", irises))
    return person


def printed(worn: list[Worn], wanted: Mapping[str, object]) -> list[Worn]:
    """Garments with the print that is wanted on the upper body; a print's colour alone is of stripes, where
    there is no print."""
    covering = [i for i, each in enumerate(worn) if each.kind in COVERING]
    if not covering or not {"pattern", "pattern_color"} & set(wanted):
        return worn
    last = worn[covering[-1]]
    pattern = str(wanted.get("pattern", "across" if last.printed == "plain" else last.printed))
    return [replace(each, printed=pattern) if i == covering[-1] else each for i, each in enumerate(worn)]


def speaks_of(kind: str, worn: Worn) -> bool:
    """Whether a trait of a kind is of a garment; a dress takes the colour of a top."""
    return worn.kind == kind or (worn.kind == DRESS and kind == "top")


def dyed(worn: Worn, name: str, rank: float, alike: bool) -> Worn:
    """A garment in a colour; one that has it already keeps its own, unless it is to be like another's."""
    if not alike and is_like(worn.shade, name):
        return worn
    colour = shade(name, CLOTH, rank)
    return replace(worn, colour=colour, shade=colour)


def is_like(colour: Rgb, name: str) -> bool:
    """Whether a colour is near to a shade of the plain word."""
    apart = lab(np.array(CLOTH.get(name, ()), dtype=float).reshape(-1, 3)) - lab(np.array([colour]))
    return bool((np.linalg.norm(apart, axis=1) < LIKE).any())


def shade(name: str, table: Mapping[str, tuple[Rgb, ...]], rank: float) -> Rgb:
    """A colour's own place among the shades of its name, 0 the darkest to 1; or what the name says."""
    if name in table:
        return table[name][min(int(rank * len(table[name])), len(table[name]) - 1)]
    if name in CLOTH:
        return CLOTH[name][-1]
    found = named_rgb(name)
    assert found is not None, name  # traits have been checked
    return found


def ink(person: Attributes, name: object, draw: Draw) -> Rgb:
    """The print's colour: as wished, or the person's own where it can be told from the cloth."""
    if name is not None:
        return shade(str(name), CLOTH, draw.share("second"))
    covering = [i for i, kind in enumerate(person.kinds) if kind in COVERING]
    cloth = lab(np.array([person.shades[covering[-1]]]))[0]
    if np.linalg.norm(lab(np.array([person.print_colour]))[0] - cloth) >= SEEN:
        return person.print_colour
    return CLOTH["black" if cloth[0] > LIGHT else "white"][0]
