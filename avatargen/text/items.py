"""Text to items: its words, one or several at a time, with what they mean."""

import re
from collections.abc import Callable
from dataclasses import dataclass, replace

from avatargen.text.vocabulary import LONGEST, Meaning, meaning_of, words_of
from avatargen.wardrobe.choosing import CLOTH
from avatargen.wardrobe.named_colours import named_rgb

MARKS = ".,;:!?&+"
SEXES = {"woman": "woman", "man": "man", "lady": "woman", "girl": "woman", "boy": "man", "ess": "woman"}
TENS = ("twenty", "thirty", "forty", "fifty", "sixty", "seventy", "eighty", "ninety")
GROWN, MIDDLE, OLD = 15, 36, 60  # years
FOOT, INCH = 0.3048, 0.0254  # m
YEARS = re.compile(
    rf"\b(?:aged?|age of)[ -]?(\d{{1,3}})\b|\b(\d{{1,3}}|{'|'.join(TENS)})[ -]?(?:years?|yrs?)?[ -]old\b"
    rf"|\b({'|'.join(TENS)}) something\b|\b(?:of|about|around) (\d{{2}})\b(?! ?(?:cm|kg|m|ft|%))"
    r"|\b(\d{2}) ?(?:years|yrs?)\b|(?<=, )(\d{2})(?=\s*(?:,|$))"
    r"|\bin (?:his|her|their) (?:mid |late |early )?(\d0)s\b"
)
METRES = re.compile(
    r"\b([12][.,]\d{1,2}) ?m(?:et(?:er|re)s?)?\b(?: tall)?"
    r"|\b(1\d\d|20\d) ?(?:cm|centimet(?:er|re)s?)\b(?: tall)?"
)
FEET = re.compile(
    r"\b([4-7]) ?(?:ft|foot|feet|')\.?[ -]?"
    r"(?:(\d{1,2}) ?(?:in(?:ch(?:es)?)?\b|\"|''|(?=\s|,|$)))?(?: tall)?"
)
DESCRIBED = ("garment", "colour", "of", "part", "say", "person")  # kinds of items


@dataclass(frozen=True, kw_only=True)
class Item:
    """Some words of the text and what they mean: a kind and a value of the vocabulary; or `mark`, a colour's
    name as `colour`, a trait as `say`, or `unknown`."""

    kind: str
    value: str
    words: str
    guessed: bool = False  # its word is in no table


def items_of(text: str, near: Callable[[str], Meaning | None]) -> list[Item]:
    """The items of a text, in order. `near` says what a word may mean that is in no table."""
    said, text = numbers(text.lower().replace("’", "'").replace("-something", " something"))
    words, found = words_of(text), []
    while words:
        item, count = longest(words)
        found.append(item or guessed(words[0], near))
        words = words[count:]
    return [*adjectives(found), *said]


def adjectives(items: list[Item]) -> list[Item]:
    """The items, but for guessed garments that stand before what they must be adjectives of: muddy boots."""
    kinds = [*(each.kind for each in items[1:]), "mark"][: len(items)]
    return [
        replace(item, kind="unknown")
        if item.guessed and item.kind == "garment" and kind in DESCRIBED
        else item
        for item, kind in zip(items, kinds, strict=True)
    ]


def longest(words: list[str]) -> tuple[Item | None, int]:
    """The item that the most words from the first on make, and how many they are; None where it is not
    known."""
    if words[0] in MARKS:
        return Item(kind="mark", value=words[0], words=words[0]), 1
    for count in range(min(LONGEST, len(words)), 0, -1):
        phrase = " ".join(words[:count])
        if (meaning := meaning_of(phrase)) is not None:
            return Item(kind=meaning.kind, value=meaning.value, words=phrase), count
        if phrase in CLOTH or named_rgb(phrase) is not None:
            return Item(kind="colour", value=phrase, words=phrase), count
    return None, 1


def guessed(word: str, near: Callable[[str], Meaning | None]) -> Item:
    """An item of a word that no table has."""
    for ending, sex in SEXES.items():
        if word.endswith(ending) and len(word) > len(ending) + 2:
            return Item(kind="person", value=f"gender:{sex}", words=word)
    base = word.removesuffix("ish")
    if base != word and (base in CLOTH or base + "e" in CLOTH or base[:-1] in CLOTH):
        name = next(each for each in (base, base + "e", base[:-1]) if each in CLOTH)
        return Item(kind="colour", value=name, words=word)
    meaning = near(word)
    if meaning is None:
        return Item(kind="unknown", value="", words=word)
    return Item(kind=meaning.kind, value=meaning.value, words=word, guessed=True)


def numbers(text: str) -> tuple[list[Item], str]:
    """Ages in years and heights as items, and the text without them."""
    found = []
    if match := YEARS.search(text):
        said = next(group for group in match.groups() if group)
        years = 10 * TENS.index(said) + 20 if said in TENS else int(said)
        if years < GROWN:
            found.append(
                Item(kind="cannot", value="children are none of the people that are made", words=match[0])
            )
        else:
            age = "young" if years < MIDDLE else "middleage" if years < OLD else "old"
            found.append(Item(kind="say", value=f"age:{age}", words=match[0]))
        text = text.replace(match[0], " ")
    if match := METRES.search(text):
        metres = float(match[1].replace(",", ".")) if match[1] else int(match[2]) / 100
    elif match := FEET.search(text):
        metres = int(match[1]) * FOOT + int(match[2] or 0) * INCH
    if match:
        found.append(Item(kind="say", value=f"height:{metres:.2f}", words=match[0].strip()))
        text = text.replace(match[0], " ")
    return found, text
