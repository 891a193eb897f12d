"""What hair and beard a draw gives: style, colour, which way round it is combed, how long, and its line."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from avatargen.wardrobe.hairline import Hairline
from avatargen.wardrobe.skin import HAIR_TONES

BALD = 0.93  # of men's share of styles, from where they have none
CROSS = ((0.88, BALD), (0.95, 1.01))  # of men's and women's, where they wear what the other sex usually does
SHAVED = 0.5  # share of the bald whose hair shows as a shadow
AFRO = 0.7  # darkness of a skin from which hair may be afro
BEARDED = (("stubble", 0.13), ("full", 0.24), ("goatee", 0.30), ("moustache", 0.35))  # men, by share


@dataclass(frozen=True, kw_only=True)
class HairWorn:
    """How one person wears a style: `mirrored` the other way round; `length` 0..1 from the longest to the
    shortest; the hairline; `shaved`, of a bald head whose hair shows as a shadow."""

    mirrored: bool
    length: float
    line: Hairline
    shaved: bool


def hair_style(share: float, tags: Mapping[str, tuple[str, ...]], woman: bool, dark: float) -> str | None:
    """A style (names with their `tags`) for the sex; afro hair on dark skins. A few men have long hair, and a
    few women a man's short cut."""
    bald, crossed = not woman and share > BALD, CROSS[woman][0] < share < CROSS[woman][1]
    if bald or not tags:
        return None
    fitting = sorted(name for name, own in tags.items() if fits(name, own, woman, crossed, dark))
    if woman and not crossed:  # longer styles are as likely again
        fitting = [name for name in fitting for _ in range(1 if "Short" in tags[name] else 2)]
    fitting = fitting or sorted(tags)
    low, high = CROSS[woman] if crossed else (0.0, CROSS[woman][0])
    return fitting[min(int((share - low) / (high - low) * len(fitting)), len(fitting) - 1)]


def fits(name: str, tags: tuple[str, ...], woman: bool, crossed: bool, dark: float) -> bool:
    """Whether a style suits somebody, or somebody who wears what the other sex usually does."""
    if crossed:
        return "Male" in tags if woman else {"Female", "Long"} <= set(tags) and not tied(name)
    if not {"Male", "Female"} & set(tags):
        return "Afro" not in tags or dark > AFRO
    cropped = "Short" in tags and "Bob" not in tags  # a woman's crop, cut at the hairline, is a man's, too
    return "Female" in tags if woman else "Female" not in tags or cropped


def tied(name: str) -> bool:
    return name.startswith(("ponytail", "braid"))


def hair_worn(share: Callable[[str], float], woman: bool, years: float) -> HairWorn:
    """Of a draw's shares: which side the parting is on, length and hairline, which recedes with men's age."""
    part, length, high = share("hair_part"), share("hair_length"), share("hairline")
    lost = 0.0 if woman else max(high - 0.45, 0.0) * max(years - 0.25, 0.0)
    return HairWorn(
        mirrored=part > 0.5,
        length=length,
        line=Hairline(raised=0.007 * (high - 0.5) + 0.03 * lost, receded=0.004 * high + 0.04 * lost),
        shaved=length < SHAVED,
    )


def beard_style(share: float, woman: bool) -> str:
    """About a third of men have one."""
    return "none" if woman else next((kind for kind, end in BEARDED if share < end), "none")


def natural_hair(share: float, dark: float, age: float, grey: float) -> tuple[float, float, float]:
    """Hair colours that go with a skin (dark 0..1), greyer with age."""
    place = share * (1 - 0.93 * dark) * (len(HAIR_TONES) - 1.001)
    if 3.2 < place < 4.4 and dark > 0.25:
        place = 1.5
    low = int(place)
    tone = HAIR_TONES[low] + (HAIR_TONES[low + 1] - HAIR_TONES[low]) * (place - low)
    white = max(0.0, min(1.0, (age - 0.72) / 0.28)) * grey
    r, g, b = (tone + (0.66 - tone) * white).tolist()
    return (r, g, b)
