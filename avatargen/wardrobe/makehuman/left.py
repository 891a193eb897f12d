"""What is left to choose among once something to wear is wished: a draw then chooses as ever, out of that.

What is not wished stays as its person has it, whatever the draw would choose from the rest.
"""

from collections.abc import Mapping
from dataclasses import dataclass

from avatargen.wardrobe.makehuman.choose import DRESS, Attributes
from avatargen.wardrobe.makehuman.outfit import CLOSE, TAILORED, Item, outfit_of
from avatargen.wardrobe.makehuman.words import garment_word, hair_word

UPPER = ("top", "outer", "overall", "dress")  # one of all these, but that a coat goes over a top
SLOTS = (UPPER, ("bottom",), ("shoes",), ("hat",), ("hair",))  # things of which one is chosen
WITH_COAT = (("top",), ("outer",), *SLOTS[1:])
OVER = ("outer", "overall")
SEXED = {"Male", "Female"}  # tags
SOMETHING = "something"  # is worn, whatever it is


@dataclass(frozen=True, kw_only=True)
class ForAnybody:
    """Hair of a style that is otherwise for one sex."""

    name: str
    kind: str
    tags: tuple[str, ...]
    own_color: tuple[float, float, float]


def word_of(item: Item) -> str:
    return hair_word(item.name) if item.kind == "hair" else garment_word(item.name, item.kind)


def left(
    items: Mapping[str, Item], wanted: Mapping[str, str], own: Attributes, sex: str
) -> Mapping[str, Item]:
    """The items that go with what is `wanted`, a word by kind, or none, or something, for a person who is
    `own` but for that and for the `sex`."""
    over = {outfit_of(each): each.name for each in items.values() if each.kind in OVER}
    beneath = {
        n: over[outfit_of(each)]
        for n, each in items.items()
        if each.kind == "top" and outfit_of(each) in over
    }
    coat = wants_coat(items, wanted, own)
    kept = {name: each for name, each in items.items() if name in beneath or goes(each, wanted, coat=coat)}
    others = [n for n, each in kept.items() if each.kind == "outer" and sewn(each) and n not in own.garments]
    kept = kept if coat else {n: each for n, each in kept.items() if n not in others}
    for kinds in WITH_COAT if coat else SLOTS:
        options = [n for n, each in kept.items() if each.kind in kinds and n not in beneath]
        options = options if coat else [n for n in options if kept[n].kind != "outer" or not sewn(kept[n])]
        mine = [n for n in options if n in own.garments or n == own.hair]
        if mine and (sex == own.sex or kinds == ("shoes",)):
            kept = {n: each for n, each in kept.items() if n in mine or n not in options}
    kept = {name: each for name, each in kept.items() if name not in beneath or beneath[name] in kept}
    return kept | worn_hair(kept, sex, wished="hair" in wanted or sex == own.sex)


def wants_coat(items: Mapping[str, Item], wanted: Mapping[str, str], own: Attributes) -> bool:
    """Whether a tailored coat is to be worn over a top: it is wished, or has what is wished."""
    coats = {name: word_of(each) for name, each in items.items() if each.kind == "outer" and sewn(each)}
    outer = wanted.get("outer")
    return outer in coats.values() or (outer == SOMETHING and not coats.keys().isdisjoint(own.garments))


def sewn(item: Item) -> bool:
    return TAILORED in item.tags


def goes(item: Item, wanted: Mapping[str, str], *, coat: bool) -> bool:
    """Whether an item is what is wished of its kind, and what is wished of others lets it be worn."""
    worn = {kind: word for kind, word in wanted.items() if word != "none"}
    whole = DRESS in (wanted.get("top"), wanted.get("bottom"))
    if item.kind == DRESS:
        return whole or not (
            {"bottom", "overall", "outer"} & set(worn) or worn.get("top", SOMETHING) != SOMETHING
        )
    if item.kind in (*UPPER, "bottom") and whole:
        return False
    if item.kind == "socks":
        return wanted.get("shoes") != "none"
    if coat and item.kind in ("top", "bottom") and item.name not in CLOSE:
        return False
    if item.kind == "top" and {"outer", "overall"} & set(worn) and not coat:
        return False  # those come with their own
    if (
        item.kind == "outer"
        and "outer" not in worn
        and not sewn(item)
        and (worn.get("top", SOMETHING) != SOMETHING or "overall" in worn)
    ):
        return False
    if item.kind == "overall" and "overall" not in worn and {"top", "outer", "bottom"} & set(worn):
        return False
    return wanted.get(item.kind) in (None, SOMETHING, word_of(item))


def worn_hair(items: Mapping[str, Item], sex: str, *, wished: bool) -> dict[str, Item]:
    """The styles for the sex where they are `wished`, and where there are none, those of the other, for
    anybody."""
    hair = {name: each for name, each in items.items() if each.kind == "hair" and wished}
    own = {"woman": "Female", "man": "Male"}[sex]
    suited = {name: each for name, each in hair.items() if own in each.tags or not SEXED & set(each.tags)}
    return {
        name: ForAnybody(
            name=name,
            kind=each.kind,
            tags=tuple(tag for tag in each.tags if tag not in {*SEXED, "Afro"}),
            own_color=each.own_color,
        )
        for name, each in (suited or hair).items()
    }
