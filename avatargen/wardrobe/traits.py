"""What meets the eye of a person, as numbers, written out where the coding hides it in several coordinates.

Whether somebody wears a full beard, say, is a matter of three coordinates of z; here it is one trait. A
mapping network that learns to say the traits has done the part of its work that pictures teach slowest.

Letters: B people, T traits. Every trait is near -1..1.
"""

import torch
from jaxtyping import Float
from torch import Tensor

from avatargen.wardrobe import garments, skin
from avatargen.wardrobe.attributes import CHOICES, FACE, MEASURES, People
from avatargen.wardrobe.hair import style
from avatargen.wardrobe.person import wears_hat


def traits(people: People) -> Float[Tensor, "B T"]:
    """All traits of every person."""
    columns = [
        *(2 * people.choice(name) - 1 for name in CHOICES),
        *(2 * people.measure(name) - 1 for name in MEASURES),
        *hair_traits(people),
        *worn_traits(people),
        *colour_traits(people),
        *(2 * people.measure(name) - 1 for name in FACE),
    ]
    return torch.cat(columns, dim=1)


def one_hot(kind: Float[Tensor, "B 1"], count: int) -> Float[Tensor, "B count"]:
    """1 in the column of each person's kind."""
    return (kind == torch.arange(count).to(kind)).to(kind)


def hair_traits(people: People) -> list[Float[Tensor, "B _"]]:
    """Hair style among all, with its thicknesses, the hat, the beard."""
    woman = people.choice("woman")
    side, top, curtain, knot = style(people)
    hair = one_hot(people.kind("hair_a", "hair_b", "hair_c") + 8 * woman, 16)
    shown = 1 - wears_hat(people)
    beard = one_hot(people.kind("beard_a", "beard_b"), 4) * (1 - woman)
    hanging = torch.cat([one_hot(curtain, 3), one_hot(knot, 3)], dim=1)
    return [hair, hair * shown, side * 30, top * 30, hanging, shown, beard]


def worn_traits(people: People) -> list[Float[Tensor, "B _"]]:
    """What is worn, of which kind, and where it ends."""
    skirt, dress, coat = garments.has_skirt(people), garments.has_dress(people), garments.has_coat(people)
    outer, short, jeans = people.choice("outer_a"), garments.has_shorts(people), garments.has_jeans(people)
    tucked = people.choice("tucked") * (1 - dress)
    pattern = one_hot(people.kind("pattern_a", "pattern_b", "pattern_c"), 8)
    collar = one_hot(people.kind("collar_a", "collar_b"), 4)
    shoe = one_hot(people.kind("shoe_a", "shoe_b"), 4)
    closed_belt = people.choice("belt") * tucked * (1 - skirt)
    ends = [
        people.measure("leg_length") * short,
        people.measure("leg_length") * (1 - short) * (1 - skirt),
        people.measure("skirt_length") * skirt,
        people.measure("flare") * skirt,
        people.measure("outer_length") * coat,
        people.measure("outer_length") * (outer - coat),
        people.measure("hem") * (1 - tucked),
    ]
    kinds = [pattern, pattern * (1 - outer), collar, collar * (1 - outer), shoe, shoe * skirt]
    return [skirt, dress, coat, outer - coat, short, jeans, tucked, closed_belt, *ends, *kinds]


def colour_traits(people: People) -> list[Float[Tensor, "B _"]]:
    """The colours that are seen, each where it is worn."""
    skirt, dress = garments.has_skirt(people), garments.has_dress(people)
    trousers = garments.trouser_colour(people)
    lower = torch.where(skirt[..., None] > 0.5, garments.skirt_colour(people), trousers)
    seen = [
        skin.skin_tone(people),
        skin.hair_tone(people),
        skin.eye_colour(people),
        people.colour("top"),
        people.colour("second", chroma=0.2),
        lower,
        garments.outer_colour(people),
        garments.shoe_colour(people),
    ]
    seen = [2 * color[:, 0] - 1 for color in seen]
    makeup = people.choice("makeup") * people.choice("woman")
    return [
        *seen,
        seen[6] * people.choice("outer_a"),
        seen[3] * dress,
        seen[1] * (1 - wears_hat(people)),
        makeup,
    ]
