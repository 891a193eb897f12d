"""Moves a draw to what was chosen, and no further: coordinates that say what was named are drawn again until
it is so, the rest stays.
"""

from collections.abc import Callable, Collection, Mapping

import torch
from jaxtyping import Float
from torch import Tensor

from avatargen.errors import InputError
from avatargen.wardrobe.attributes import LATENT_SIZE, coordinate
from avatargen.wardrobe.choosing import HEIGHT, Traits, shown
from avatargen.wardrobe.makehuman.choose import NEW, Attributes

TRIES = 300
# Traits, the coordinates that say what they are, and those that are drawn again with them where these alone
# do not help: what only women or only men wear decides the sex. Those before stay as wished.
SAYING = (
    (("gender",), ("woman",), ()),
    (("age",), ("age",), ()),
    (("skin",), ("skin_light",), ()),
    (("hair",), ("hair_style",), ("woman", "skin_light")),
    (("hair_color",), ("hair_colour", "wear"), ("age", "skin_light", "hair_style")),
    (("top", "outer"), ("top_item", "outfit", "borrows", "coat", "coat_item"), ("woman",)),
    (("bottom",), ("bottom_item", "top_item", "outfit", "borrows"), ("woman",)),
    (("shoes",), ("shoes_item",), ("woman",)),
    (("hat",), ("spare", "spare_too"), ()),
    (("top_color",), ("top", "top_plain", "print_kind"), ("top_item",)),
    (("outer_color",), ("outer", "top_plain"), ("top_item",)),
    (("bottom_color",), ("bottom", "bottom_plain"), ("bottom_item", "top_item", "outfit")),
)
SOMETHING = "something"  # is worn, whatever it is
SEED = 17  # of what is drawn again


def condition(
    z: Float[Tensor, "1 Z"],
    traits: Traits,
    choose: Callable[[Tensor], Attributes],
    had: Mapping[str, Collection[str]],
) -> Float[Tensor, "1 Z"]:
    """The draw nearest at hand whose person has the traits; height is not the draw's. `had` are the words of
    what there is to wear.

    Raises:
        InputError: no person of these garments, hair and skins has them.
    """
    wanted = {name: value for name, value in traits.given().items() if name != HEIGHT}
    known = {name for names, _, _ in SAYING for name in names}
    if unknown := [name for name in wanted if name not in known]:
        raise InputError(f"{traits.told(unknown[0])}: these weights do not say; leave it out")
    random = torch.Generator().manual_seed(SEED)
    for name in wanted:
        if name in had and wanted[name] not in ("none", *had[name]):
            words = ", ".join(sorted(had[name])) or "none at all"
            raise InputError(f"{traits.told(name)}: these weights have {words}; choose among them")
    worn = {name.removesuffix("_color") for name in wanted if name.endswith("_color")} - {"hair"}
    wanted = dict.fromkeys(worn, SOMETHING) | wanted
    settled: dict[str, str | float] = {}
    for names, own, wider in SAYING:
        of_group = {name: wanted[name] for name in names if name in wanted}
        if not of_group:
            continue
        settled |= of_group
        found = drawn_until(z, own, settled, choose, random)
        if found is None:
            found = drawn_until(z, own + wider, settled, choose, random)
        if found is None:
            told = " and ".join(f"{shown(name)} {value}" for name, value in settled.items())
            raise InputError(f"{told}: nobody of these weights is like that; leave something out")
        z = found
    return z


def drawn_until(
    z: Float[Tensor, "1 Z"],
    coordinates: tuple[str, ...],
    wanted: Mapping[str, str | float],
    choose: Callable[[Tensor], Attributes],
    random: torch.Generator,
) -> Float[Tensor, "1 Z"] | None:
    """The draw, or one that differs at these coordinates, whose person is as wanted."""
    places = [place for name in coordinates for place in places_of(name)]
    for _ in range(TRIES):
        facts = choose(z).facts()
        if all(is_as_wanted(facts.get(name, "none"), value) for name, value in wanted.items()):
            return z
        z = z.clone()
        z[0, places] = torch.randn(len(places), generator=random)
    return None


def is_as_wanted(found: str | float, wanted: str | float) -> bool:
    return found != "none" if wanted == SOMETHING else found == wanted


def places_of(name: str) -> list[int]:
    """Where in z a coordinate is; a colour has three."""
    if name in NEW:
        return [LATENT_SIZE + NEW.index(name)]
    first = coordinate(name)
    return [first, first + 1, first + 2] if name in ("top", "outer", "bottom") else [first]
