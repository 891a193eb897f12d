"""From a draw to the person of that draw who has what was chosen, and is otherwise as drawn.

    z, traits --condition--> z --choose, out of what is left--> who has them --painted--> in these colours

Coordinates that say what somebody is are drawn again until it is so; garments and hair are chosen as ever,
out of those that are as wished; colours are laid on.
"""

from collections.abc import Callable, Collection, Mapping
from dataclasses import replace
from functools import partial
from typing import Protocol, runtime_checkable

import torch
from jaxtyping import Float
from torch import Tensor

from avatargen.errors import InputError
from avatargen.wardrobe.attributes import LATENT_SIZE, coordinate
from avatargen.wardrobe.choosing import ANY, HEIGHT, Traits, shown
from avatargen.wardrobe.makehuman.borrow import wearing, worn_by
from avatargen.wardrobe.makehuman.choose import DRESS, NEW, Attributes, Draw
from avatargen.wardrobe.makehuman.left import SEXED, SOMETHING, left, word_of
from avatargen.wardrobe.makehuman.outfit import Item
from avatargen.wardrobe.makehuman.painted import DYED, PAINTED, painted
from avatargen.wardrobe.makehuman.words import garment_word, hair_word
from avatargen.wardrobe.stature import MEN, SPREAD, WOMEN

TRIES = 300
# Traits, and the coordinates that say what they are
SAYING = {
    "gender": ("woman",),
    "age": ("age",),
    "figure": ("weight", "muscle"),
    "stature": ("height",),
    "skin": ("skin_light",),
    "beard": ("beard",),
    "hair": ("hair_style",),
    "hat": ("spare", "spare_too"),
    "outer": ("coat",),
}
WORN = ("hair", "hat", "top", "overall", "outer", "bottom", "shoes")  # traits that are kinds of items
SEED = 17  # of what is drawn again


@runtime_checkable
class Wardrobe(Protocol):
    """What people choose from."""

    @property
    def items(self) -> Mapping[str, Item]:
        """What there is to choose among, by name."""
        ...

    @property
    def irises(self) -> tuple[str, ...]: ...

    def had(self) -> Mapping[str, Collection[str]]:
        """Words of what there is to wear, by kind."""
        ...

    def choose(self, draw: Draw, items: Mapping[str, Item] | None = None) -> Attributes:
        """The person of a draw, out of all items or of these."""
        ...


def condition(
    z: Float[Tensor, "1 Z"], traits: Traits, wardrobe: Wardrobe
) -> tuple[Float[Tensor, "1 Z"], Attributes]:
    """The draw nearest at hand, and its person, who has the traits. A height in metres is not the draw's.

    Raises:
        InputError: no person of these garments, hair and skins has them.
    """
    own, wanted = wardrobe.choose(Draw(z)), traits.given()
    words = {name: str(value) for name, value in wanted.items() if name in WORN}
    require_had(traits, wardrobe)
    for name in DYED:
        if f"{name}_color" in wanted:
            words = {name: SOMETHING} | words
    if "pattern" in wanted or "pattern_color" in wanted:
        words = {"top": SOMETHING} | words
    sex = str(wanted.get("gender", sex_that_wears(words, wardrobe.items, own.sex)))
    wanted = {"gender": sex} | wanted
    items = left(wardrobe.items, words, own, sex)
    random = torch.Generator().manual_seed(SEED)
    for name, coordinates in SAYING.items():
        value = words.get(name) if name in WORN else wanted.get(name)
        if value is not None:
            # what else is worn is as ever, but a coat goes over some things alone
            few = {n: each for n, each in items.items() if name in (each.kind, "outer")}
            z = drawn_until(z, coordinates, name, str(value), partial(chosen_of, wardrobe, few), random)
    person = wardrobe.choose(Draw(z), items)
    person = lent(person, z, words, own, wardrobe)
    person = painted(person, wanted, Draw(z), wardrobe.irises)
    if traits.height is not None:
        person = replace(person, stature=stature_word(traits.height, person.sex))
    require_as_wanted(
        person, {name: value for name, value in wanted.items() if name not in (HEIGHT, *ANY)} | words
    )
    return z, person


def sex_that_wears(words: Mapping[str, str], items: Mapping[str, Item], own: str) -> str:
    """Women where something is wished that only they wear, and of which nothing is for both; else `own`."""
    for kind, word in words.items():
        sexes = [
            SEXED & set(each.tags) for each in items.values() if is_of(each, kind) and word_of(each) == word
        ]
        if kind != "hair" and sexes and all(each == {"Female"} for each in sexes):
            return "woman"
    return own


def is_of(item: Item, kind: str) -> bool:
    """Whether a trait speaks of an item; a dress is both top and bottom."""
    return item.kind == kind or (item.kind == DRESS and kind in ("top", "bottom"))


def require_had(traits: Traits, wardrobe: Wardrobe) -> None:
    """Raises InputError for a trait that these weights do not say, or a word of what they do not have."""
    had = wardrobe.had()
    for name, value in traits.given().items():
        if name not in (HEIGHT, *SAYING, *WORN, *PAINTED):
            raise InputError(f"{traits.told(name)}: these weights do not say; leave it out")
        if name in had and value not in ("none", *had[name]):
            words = ", ".join(sorted(had[name])) or "none at all"
            raise InputError(f"{traits.told(name)}: these weights have {words}; choose among them")


def drawn_until(
    z: Float[Tensor, "1 Z"],
    coordinates: tuple[str, ...],
    name: str,
    wanted: str,
    choose: Callable[[Tensor], Attributes],
    random: torch.Generator,
) -> Float[Tensor, "1 Z"]:
    """The draw, or one that differs at these coordinates, of whose person the trait is as wanted.

    Raises:
        InputError: nobody has it.
    """
    places = [coordinate(each) if each not in NEW else LATENT_SIZE + NEW.index(each) for each in coordinates]
    for _ in range(TRIES):
        if is_as_wanted(said(choose(z), name), wanted):
            return z
        z = z.clone()
        z[0, places] = torch.randn(len(places), generator=random)
    raise InputError(f"{shown(name)} {wanted}: nobody of these weights is like that; leave it out")


def said(person: Attributes, name: str) -> str:
    """What somebody is, of the traits that are drawn again."""
    if name == "hair":
        return hair_word(person.hair)
    if name in ("hat", "outer"):
        place = person.kinds.index(name) if name in person.kinds else None
        return "none" if place is None else garment_word(person.garments[place], name)
    return {
        "gender": person.sex,
        "age": person.age,
        "figure": person.figure,
        "stature": person.stature,
        "skin": person.tone,
        "beard": person.beard,
    }[name]


def chosen_of(wardrobe: Wardrobe, items: Mapping[str, Item], z: Float[Tensor, "1 Z"]) -> Attributes:
    """The person of a latent, out of these items."""
    return wardrobe.choose(Draw(z), items)


def is_as_wanted(found: str | float, wanted: str) -> bool:
    return found != "none" if wanted == SOMETHING else found == wanted


def lent(
    person: Attributes, z: Float[Tensor, "1 Z"], words: Mapping[str, str], own: Attributes, wardrobe: Wardrobe
) -> Attributes:
    """The person with what no draw has at once: another top than its own under an outer, and an overall on a
    woman."""
    facts, outer, top = person.facts(), words.get("outer", "none"), words.get("top", SOMETHING)
    if outer != "none" and top not in ("none", SOMETHING, facts["top"]):
        without = {name: word for name, word in words.items() if name != "outer"}
        other = wardrobe.choose(Draw(z), left(wardrobe.items, without, own, person.sex))
        return exchanged(person, other, ("top",))
    if words.get("overall", "none") != "none" and facts["overall"] == "none":
        turned = z.clone()
        turned[0, coordinate("woman")] *= -1
        sex = {"woman": "man", "man": "woman"}[person.sex]
        other = wardrobe.choose(Draw(turned), left(wardrobe.items, words, own, sex))
        return exchanged(person, other, ("bottom", "top", "overall"))
    return person


def exchanged(person: Attributes, other: Attributes, kinds: tuple[str, ...]) -> Attributes:
    """The person in the other's garments of these kinds, where the first of its own was."""
    mine, theirs = worn_by(person), [each for each in worn_by(other) if each.kind in kinds]
    place = next((i for i, each in enumerate(mine) if each.kind in kinds), len(mine))
    kept = [[each for each in part if each.kind not in kinds] for part in (mine[:place], mine[place:])]
    return wearing(person, [*kept[0], *theirs, *kept[1]])


def stature_word(metres: float, sex: str) -> str:
    """What a height is called."""
    above = (metres - (WOMEN if sex == "woman" else MEN)) / SPREAD
    return "tall" if above > 1 else "short" if above < -1 else "average"


def require_as_wanted(person: Attributes, wanted: Mapping[str, object]) -> None:
    """Raises InputError where the person is not as wanted."""
    facts = person.facts()
    wrong = [name for name, word in wanted.items() if not is_as_wanted(facts.get(name, "none"), str(word))]
    if wrong:
        told = " and ".join(f"{shown(name)} {wanted[name]}" for name in wrong)
        raise InputError(f"{told}: nobody of these weights is like that; leave something out")
