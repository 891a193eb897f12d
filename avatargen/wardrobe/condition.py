"""Moves a latent to what was chosen, and no further: a draw under that condition, the rest as it was.

Signs turn, a measure outside the wanted interval takes its own rank's place within it, a colour goes to the
nearest one of the wanted name; what already is as wanted stays. What is named is seen: hair takes the hat
off, a top takes the jacket off, where these were not named; a top of a named colour is plain.

Letters: Z latent size. A rule names coordinates with the sign or the interval of the measure that they must
have; a trait's value has one or several rules, of which the nearest is taken.
"""

import itertools
from collections.abc import Iterable, Iterator
from functools import cache

import numpy as np
import torch
from jaxtyping import Float, Float64
from torch import Tensor
from torch.special import ndtr, ndtri

from avatargen.errors import InputError
from avatargen.wardrobe.attributes import coordinate
from avatargen.wardrobe.choosing import Traits
from avatargen.wardrobe.colour_names import NAMES, distances, lab
from avatargen.wardrobe.palettes import PALETTES, Palette
from avatargen.wardrobe.together import SEEN_UNDER_A_HAT, WORN_BY, check_together

Wanted = bool | tuple[float, float]
Rule = dict[str, Wanted]

LEAST = 0.1  # of a coordinate whose sign turns, so that nobody is in between
FARTHEST = 1e-4  # rank from either end that no measure is moved beyond
CLEAR = 14.0  # L*a*b* by which a named colour is nearer to its own name than to any other, or
DARKEST = 32.0  # L* of a named colour but black: weights make darker ones look black
CLEAREST = 0.75  # this share of what the palette has at most: weights miss a colour by some 7
HAIR = ("hair_a", "hair_b", "hair_c")
HAT = ("hat_a", "hat_b", "hat_c")
PATTERN = ("pattern_a", "pattern_b", "pattern_c")
PLAIN = (0, 1, 2)  # of the patterns' codes
BEARD, SHOE, COLLAR = ("beard_a", "beard_b"), ("shoe_a", "shoe_b"), ("collar_a", "collar_b")
WOMEN_HAIR = {"bob": (0, 5), "long": (1, 4), "bun": (2,), "ponytail": (3,), "short": (6,), "afro": (7,)}
MEN_HAIR = {"cropped": (0,), "short": (1, 2, 3, 4), "afro": (5,), "long": (6,), "bald": (7,)}
MEASURED = {  # intervals of a measure's rank
    "age": {"young": (0.0, 0.3), "old": (0.9, 1.0)},
    "skin": {"light": (0.0, 0.25), "medium": (0.32, 0.52), "brown": (0.6, 0.76), "dark": (0.86, 1.0)},
}
MEASURE_OF = {"age": "age", "skin": "skin_light"}
HAIR_TONES = {"black": (0.0, 0.1), "brown": (0.25, 0.5), "blond": (0.74, 0.84)}
GREY_FROM, TONED_TO = 0.93, 0.8  # ranks of age: grey hair, and hair of its own colour
SLEEVES = {"none": (0.0, 0.06), "short": (0.14, 0.36), "long": (0.68, 1.0)}
THIN = (0.0, 0.75)  # ranks of thickness that are no knit, whose sleeves are long


def bits(names: tuple[str, ...], number: int) -> Rule:
    """The choices that make a whole number, first bit lowest."""
    return {name: bool(number >> i & 1) for i, name in enumerate(names)}


def bare_head() -> list[Rule]:
    """Without a hat: one of three choices is enough."""
    return [bits((name,), 0) for name in HAT]


def hair_rules(style: str) -> list[Rule]:
    """The codes of a hair style, of women and of men."""
    women = [{"woman": True} | bits(HAIR, code) for code in WOMEN_HAIR.get(style, ())]
    return women + [{"woman": False} | bits(HAIR, code) for code in MEN_HAIR.get(style, ())]


def bottom_rules(bottom: str) -> list[Rule]:
    woman, man = bits(("woman",), 1), bits(("woman",), 0)
    rules: dict[str, list[Rule]] = {
        "trousers": [woman | {"bottom_a": False, "bottom_b": False}, man | {"bottom_b": False}],
        "jeans": [{"bottom_a": False, "bottom_b": True}],
        "shorts": [man | {"bottom_a": True, "bottom_b": True}],
        "skirt": [woman | {"bottom_a": True, "bottom_b": False}],
        "dress": [woman | {"bottom_a": True, "bottom_b": True}],
    }
    return rules[bottom]


def outer_rules(outer: str) -> list[Rule]:
    return [{"outer_a": False}] if outer == "none" else [{"outer_a": True, "outer_b": outer == "coat"}]


def beard_rules(beard: str) -> list[Rule]:
    numbers = {"none": 0, "stubble": 1, "moustache": 2, "full": 3}
    if beard not in numbers:
        raise InputError(f"beard {beard}: these weights have {', '.join(numbers)}; choose among them")
    number = numbers[beard]
    rules: list[Rule] = [{"woman": False} | bits(BEARD, number)]
    return [{"woman": True}, *rules] if beard == "none" else rules


def hair_color_rules(color: str) -> list[Rule]:
    """Grey comes with age alone; other tones want an age that leaves them."""
    if color == "grey":
        return [{"age": (GREY_FROM, 1.0)}]
    return [{"hair": HAIR_TONES[color], "age": (0.0, TONED_TO)}]


def top_rules(top: str) -> list[Rule]:
    number = ("t-shirt", "v-neck", "shirt", "turtleneck").index(top)
    return [bits(COLLAR, number)]


def sleeve_rules(sleeves: str) -> list[Rule]:
    if sleeves == "long":
        return [{"sleeve": SLEEVES["long"]}]
    loose = [bits(COLLAR, number) for number in range(3)]
    return [{"sleeve": SLEEVES[sleeves], "thickness": THIN} | collar for collar in loose]


def rules_of(traits: Traits) -> Iterator[list[Rule]]:
    """For each thing chosen, and each that has to be out of its way, the rules of which one must hold."""
    if traits.gender:
        yield [{"woman": traits.gender == "woman"}]
    for name, ranks in MEASURED.items():
        if value := getattr(traits, name):
            yield [{MEASURE_OF[name]: ranks[value]}]
    yield from head_rules(traits)
    yield from body_rules(traits)
    if traits.shoes:
        yield [bits(SHOE, ("sneakers", "boots", "flats", "leather").index(traits.shoes))]


def head_rules(traits: Traits) -> Iterator[list[Rule]]:
    if traits.hair:
        yield hair_rules(traits.hair)
    elif traits.hair_color:
        yield [rule for style in {**WOMEN_HAIR, **MEN_HAIR} if style != "bald" for rule in hair_rules(style)]
    if traits.hair_color:
        yield hair_color_rules(traits.hair_color)
    if traits.beard:
        yield beard_rules(traits.beard)
    shows_hair = (traits.hair or traits.hair_color) and traits.hair not in SEEN_UNDER_A_HAT
    if traits.hat == "beanie":
        yield [bits(HAT, 7)]
    elif traits.hat == "none" or shows_hair:
        yield bare_head()


def body_rules(traits: Traits) -> Iterator[list[Rule]]:
    if traits.bottom:
        yield bottom_rules(traits.bottom)
    elif traits.bottom_color:
        yield [rule for kind in ("trousers", "shorts", "skirt") for rule in bottom_rules(kind)]
    if traits.outer:
        yield outer_rules(traits.outer)
    elif traits.outer_color:
        yield [*outer_rules("jacket"), *outer_rules("coat")]
    shows_top = traits.top or traits.top_color or traits.sleeves
    if shows_top and not (traits.outer or traits.outer_color):
        yield outer_rules("none")
    elif shows_top and traits.outer != "none":
        yield [{"collar_b": True}]  # an open front
    if traits.top:
        yield top_rules(traits.top)
    if traits.top_color:
        yield [bits(PATTERN, code) for code in PLAIN]
    if traits.sleeves:
        yield sleeve_rules(traits.sleeves)


def condition(z: Float[Tensor, "1 Z"], traits: Traits) -> Float[Tensor, "1 Z"]:
    """The latent with what was chosen; coordinates that decide none of it keep their values.

    Raises:
        InputError: these people do not have it, or not all of it at once.
    """
    check_together(traits)
    normal = z[0].double().numpy().copy()
    held: Rule = {"woman": one_sex(traits, normal)} if needs_a_sex(traits) else {}
    for rules in rules_of(traits):
        held = nearest(rules, held, normal)
    for name, wanted in held.items():
        normal[coordinate(name)] = moved(normal[coordinate(name)], wanted)
    for palette, color in colours_of(traits, normal):
        normal[palette.coordinates] = nearest_colour(palette, color, normal[palette.coordinates])
    return torch.from_numpy(normal).to(z.dtype)[None]


def needs_a_sex(traits: Traits) -> bool:
    """Whether some of what was chosen depends on who wears it."""
    worn = traits.hair, traits.hair_color, traits.beard, traits.bottom, traits.bottom_color
    return any((traits.gender, *worn))


def one_sex(traits: Traits, normal: Float64[np.ndarray, " Z"]) -> bool:
    """Whether the person is a woman: as chosen, or as what was chosen is worn by one sex, or as drawn."""
    if traits.gender is not None:
        return traits.gender == "woman"
    worn = [WORN_BY[pair] for pair in traits.given().items() if pair in WORN_BY]
    return worn[0] == "woman" if worn else bool(normal[coordinate("woman")] > 0)


def nearest(rules: Iterable[Rule], held: Rule, normal: Float64[np.ndarray, " Z"]) -> Rule:
    """What is held already together with the rule that moves the latent least.

    Raises:
        InputError: none of the rules goes with what is held.
    """
    fitting = [both for rule in rules if (both := joined(held, rule)) is not None]
    if not fitting:
        raise InputError("traits: nobody can have all of these at once; leave one out")
    return min(fitting, key=lambda rule: sum(cost(normal[coordinate(name)], w) for name, w in rule.items()))


def joined(held: Rule, rule: Rule) -> Rule | None:
    """Both rules at once, or None where they exclude each other."""
    both = dict(held)
    for name, wanted in rule.items():
        known = both.get(name)
        if isinstance(known, tuple) and isinstance(wanted, tuple):
            wanted = max(known[0], wanted[0]), min(known[1], wanted[1])
            if wanted[0] >= wanted[1]:
                return None
        elif known is not None and known != wanted:
            return None
        both[name] = wanted
    return both


def cost(normal: float, wanted: Wanted) -> float:
    """How far a coordinate has to go."""
    return abs(moved(normal, wanted) - normal)


def moved(normal: float, wanted: Wanted) -> float:
    """The coordinate with the wanted sign, or its measure's rank in the wanted interval.

    Ranks outside the interval keep their order within it, so that people differ there as much as elsewhere.
    """
    if isinstance(wanted, bool):
        side = 1.0 if wanted else -1.0
        return normal if normal * side > 0 else side * max(abs(normal), LEAST)
    low, high = wanted
    rank = float(ndtr(torch.tensor(normal, dtype=torch.float64)))
    if low <= rank <= high:
        return normal
    outside = rank if rank < low else rank - (high - low)
    inside = low + (high - low) * outside / (1 - (high - low))
    inside = min(max(inside, low, FARTHEST), high, 1 - FARTHEST)
    return float(ndtri(torch.tensor(inside, dtype=torch.float64)))


def colours_of(traits: Traits, normal: Float64[np.ndarray, " Z"]) -> Iterator[tuple[Palette, str]]:
    """The palettes of what was given a colour, once it is known what is worn."""
    skirt = normal[coordinate("woman")] > 0 and normal[coordinate("bottom_a")] > 0
    named = (
        ("top", traits.top_color),
        ("skirt" if skirt else "trousers", traits.bottom_color),
        ("outer", traits.outer_color),
    )
    for name, color in named:
        if color is not None:
            yield PALETTES[name], color


def nearest_colour(
    palette: Palette, color: str, normal: Float64[np.ndarray, "3"]
) -> Float64[np.ndarray, "3"]:
    """The coordinates nearest to a colour's own whose colour has the wanted name without doubt."""
    there, least = named_part(palette, color)
    if lead(palette, color, normal[None])[0] >= least:
        return normal
    return there[((there - normal) ** 2).sum(axis=1).argmin()]


@cache
def named_part(palette: Palette, color: str) -> tuple[Float64[np.ndarray, "G 3"], float]:
    """Coordinates all over the part of a palette that has a name without doubt, and how clear they are."""
    lightness = ndtri(torch.linspace(0.02, 0.98, 49, dtype=torch.float64)).numpy()
    axis = np.linspace(-1.9, 1.9, 20)
    grid = np.array(list(itertools.product(lightness, axis, axis)))
    clear = lead(palette, color, grid)
    least = min(CLEAR, CLEAREST * float(clear.max()))
    return grid[clear >= least], least


def lead(palette: Palette, color: str, normal: Float64[np.ndarray, "N 3"]) -> Float64[np.ndarray, " N"]:
    """How much nearer each place's colour is to the name than to any other, L*a*b*; else below 0."""
    rgb = palette.colours(normal)
    apart, own = distances(rgb), NAMES.index(color)
    nearer = np.delete(apart, own, axis=1).min(axis=1) - apart[:, own]
    return np.where((lab(rgb)[:, 0] > DARKEST) | (color == "black"), nearer, -np.inf)
