"""A line of text to one of a generator's people: somebody described, or a seed's person changed.

drawn(sampler, 0, "an old man in a grey suit and brown shoes")
drawn(sampler, 3, "in a red shirt", change=True)
"""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from typing import Protocol, runtime_checkable

from avatargen.avatar import Avatar, Sampler
from avatargen.errors import InputError
from avatargen.text.items import items_of
from avatargen.text.near import near
from avatargen.text.phrases import Reader, read
from avatargen.text.wishes import ANY_COLOUR, Value, Wish, Wishes
from avatargen.wardrobe.choosing import ANY, HEIGHT, SHOWN, VALUES, Traits, shown, traits_of

MOST_WORDS = 200
COAT = "coat"
BENEATH = ((), ("top",), ("bottom",), ("top", "bottom"))  # what may be left out under one


@dataclass(frozen=True, kw_only=True)
class Told:
    """The traits that were understood, and a line for each thing that is left out."""

    traits: Traits
    left_out: tuple[str, ...]

    @property
    def understood(self) -> str:
        """The traits in words."""
        pairs = self.traits.given().items()
        return ", ".join(f"{shown(name)} {v if isinstance(v, str) else f'{v:.2f} m'}" for name, v in pairs)


@runtime_checkable
class Having(Protocol):
    """A generator that says what there is to wear."""

    def had(self) -> Mapping[str, Collection[str]]: ...


def drawn(
    sampler: Sampler,
    seed: int,
    text: str,
    change: bool = False,
    traits: Traits | None = None,
    wear: Mapping[str, int] | None = None,
) -> Avatar:
    """The person of a seed who is as a text says; with `change`, the seed's own, changed by it. Traits that
    are given besides win over the text. What was understood is in the person's facts.

    Raises:
        InputError: nothing of the text was understood or can be made, it does not go with the traits, or the
            seed is none.
    """
    chosen = {} if traits is None else traits.given()
    own = facts_of(sampler.sample(seed, traits=traits)) if change else None
    told = understand(text, offered_by(sampler), own)
    given = {**told.traits.given(), **chosen}
    if own is not None and isinstance(sampler, Having):
        given = {"gender": own["gender"]} | given  # a skirt alone changes nobody's sex
    avatar, left_out = together(sampler, seed, given, chosen, wear)
    said = [
        ("text", text),
        ("understood", told.understood),
        ("left_out", "; ".join((*told.left_out, *left_out))),
    ]
    info = replace(avatar.info, said=tuple((name, words) for name, words in said if words))
    return replace(avatar, info=info)


def together(
    sampler: Sampler,
    seed: int,
    given: Mapping[str, Value],
    chosen: Collection[str],
    wear: Mapping[str, int] | None,
) -> tuple[Avatar, list[str]]:
    """The person in all that is given, or without what does not go under the coat, but for what was chosen
    besides; and a line for each garment that is left out.

    Raises:
        InputError: nobody is like that all the same.
    """
    refused: InputError | None = None
    for out in BENEATH if given.get("outer") == COAT else BENEATH[:1]:
        of_out = [name for name in given if name.removesuffix("_color") in out]
        of_out += [name for name in ("pattern", "pattern_color") if "top" in out and name in given]
        if not set(of_out) & set(chosen):
            try:
                rest = {name: value for name, value in given.items() if name not in of_out}
                avatar = sampler.sample(seed, traits=traits_of(rest), wear=wear)
                return avatar, [
                    f"{given[name]}: it does not go under a coat" for name in out if name in given
                ]
            except InputError as error:
                refused = refused or error
    assert refused is not None, "what was tried was refused"
    raise refused


def facts_of(avatar: Avatar) -> dict[str, Value]:
    """What somebody is, by trait."""
    return dict(avatar.info.facts) | {HEIGHT: avatar.height}


def offered_by(sampler: Sampler) -> dict[str, set[str]]:
    """The values of each trait that a generator's people have."""
    if not isinstance(sampler, Having):
        return {name: set(values) for name, values in VALUES.items()}
    had = sampler.had()
    offered = {name: set(values) for name, values in SHOWN.items()}
    offered |= {name: {*words} | (offered.get(name, set()) & {"none"}) for name, words in had.items()}
    return {name: values | {ANY_COLOUR} if name in ANY else values for name, values in offered.items()}


def understand(
    text: str, offered: Mapping[str, Collection[str]], own: Mapping[str, Value] | None = None
) -> Told:
    """What a text says of a person who has what is `offered`; of whom `own` are the facts, where somebody is
    changed.

    Raises:
        InputError: nothing was understood, or nothing of it can be made.
    """
    items = items_of(text, near)
    if len(items) > MOST_WORDS:
        raise InputError(f"text: found {len(items)} words, wanted at most {MOST_WORDS}; say it shorter")
    read_out = read(items)
    wishes = Wishes(offered=offered, own=own)
    for mention in sorted(read_out.mentions, key=lambda each: each.guessed):
        wishes.mention(mention)
    left_out = (*told_of(read_out), *wishes.left_out)
    if not wishes.found:
        why = "; ".join(left_out) or "it names nothing that people have"
        raise InputError(
            f"text: nothing of {text!r} can be made ({why}); describe a person and their clothes"
        )
    found = settled(wishes, own)
    return Told(traits=found[0], left_out=(*left_out, *found[1]))


def told_of(found: Reader) -> list[str]:
    """Lines for what cannot be made and what was not understood."""
    lines = [f"{item.words}: {item.value}" for item in found.cannot]
    if words := list(dict.fromkeys(item.words for item in found.unknown)):
        lines.append(f"not understood: {', '.join(words)}")
    return lines


def settled(wishes: Wishes, own: Mapping[str, Value] | None) -> tuple[Traits, list[str]]:
    """The traits that go together, and lines for those that do not. Hair that is described is seen."""
    found, lines = dict(wishes.found), []
    outer = "none" if own is None else str(own.get("outer", "none"))
    if outer != "none" and "top" in found and not {"outer", "overall"} & set(found):
        found["outer"] = Wish(name="outer", value=outer, words="", implied=True)  # a shirt under it
    has_hat = "hat" in found or "hat_color" in found
    if (
        own is None
        and not has_hat
        and {"hair", "hair_color"} & set(found)
        and "none" in wishes.offered.get("hat", ())
    ):
        found["hat"] = Wish(name="hat", value="none", words="", implied=True)
    chosen: dict[str, Value] = {}
    for name in sorted(found, key=lambda each: found[each].implied):
        wish = found[name]
        try:
            traits_of(chosen | {name: wish.value})
        except InputError as error:
            if not wish.implied:
                lines.append(str(error).removesuffix("; leave out one of them"))
            continue
        chosen[name] = wish.value
    return traits_of(chosen), lines
