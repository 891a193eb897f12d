"""A person in another's clothes."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

from avatargen.errors import InputError
from avatargen.wardrobe.makehuman.choose import Attributes

LENT = (
    "top",
    "bottom",
    "dress",
    "overall",
    "outer",
    "shoes",
    "hat",
)  # what can be borrowed; shoes with their socks
OUTWARD = ("socks", "shoes", "bottom", "overall", "dress", "top", "outer", "hat")  # from the skin
OWN_OUTWARD = (
    "socks",
    "shoes",
    "bottom",
    "top",
    "overall",
    "dress",
    "outer",
    "hat",
)  # own tops lie under overalls
TAKES_OFF = {
    "overall": ("overall", "top", "bottom", "dress"),
    "dress": ("dress", "overall", "top", "bottom"),
    "top": ("top", "dress"),
    "bottom": ("bottom", "overall", "dress"),
    "shoes": ("shoes", "socks"),
}
Color = tuple[float, float, float]


@dataclass(frozen=True)
class Worn:
    """One garment of a person."""

    garment: str
    kind: str
    colour: Color | None
    shade: Color
    printed: str


def worn_by(person: Attributes) -> list[Worn]:
    """What somebody wears, from the skin outward."""
    rows = zip(person.garments, person.kinds, person.colours, person.shades, person.prints, strict=True)
    return [Worn(*row) for row in rows]


def borrow(person: Attributes, lender: Callable[[int], Attributes], wear: Mapping[str, int]) -> Attributes:
    """The person in garments of other seeds: `wear` names by kind the seed that lends. A borrowed top goes
    over an overall, the own one lies under it; a bottom takes an overall or a dress off, so a top has to
    come with it; a top takes a dress off, so a bottom has to.

    Raises:
        InputError: an unknown kind, a seed that wears none, or somebody would be left without a top.
    """
    worn, prints = worn_by(person), (person.print_colour, person.print_width)
    for kind, seed in wear.items():
        if kind not in LENT:
            raise InputError(f"wear: found {kind!r}, wanted one of {', '.join(LENT)}")
        other = lender(seed)
        kinds = ("socks", "shoes") if kind == "shoes" else (kind,)
        lent = [each for each in worn_by(other) if each.kind in kinds]
        if kind not in other.kinds:
            has = ", ".join(each.kind for each in worn_by(other) if each.kind in LENT)
            raise InputError(f"wear: seed {seed} wears no {kind}; it wears {has or 'nothing'}")
        if kind == "bottom" and "overall" in person.kinds and "top" not in wear:
            raise InputError("wear: a bottom takes this person's overall off; borrow a top as well")
        if kind in ("top", "bottom") and "dress" in person.kinds and not {"top", "bottom"} <= set(wear):
            missing = "bottom" if kind == "top" else "top"
            raise InputError(f"wear: a {kind} takes this person's dress off; borrow a {missing} as well")
        off = {kind, *TAKES_OFF.get(kind, ())} - (set(wear) - {kind})
        worn = [each for each in worn if each.kind not in off] + lent
        if kind == "top":
            prints = (other.print_colour, other.print_width)
    outward = OUTWARD if "top" in wear else OWN_OUTWARD
    worn.sort(key=lambda each: outward.index(each.kind) if each.kind in outward else len(outward))
    return replace(wearing(person, worn), print_colour=prints[0], print_width=prints[1])


def wearing(person: Attributes, worn: Sequence[Worn]) -> Attributes:
    """The person in these garments, from the skin outward."""
    return replace(
        person,
        garments=tuple(each.garment for each in worn),
        kinds=tuple(each.kind for each in worn),
        colours=tuple(each.colour for each in worn),
        shades=tuple(each.shade for each in worn),
        prints=tuple(each.printed for each in worn),
    )
