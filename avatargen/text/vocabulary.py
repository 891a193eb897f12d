"""What words mean here: `vocabulary.tsv`, read."""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path

TABLE = Path(__file__).with_name("vocabulary.tsv")
WORD = re.compile(r"[a-z]+(?:'[a-z]+)?|[.,;:!?&+]")
LONGEST = 4  # words of a phrase


@dataclass(frozen=True, kw_only=True)
class Meaning:
    """A line of the table: its kind, and its value as written there."""

    kind: str
    value: str


def words_of(text: str) -> list[str]:
    """Lower-case words and marks; hyphens part words, and `she's` is `she`."""
    plain = text.lower().replace("’", "'").replace("gray", "grey")
    found = WORD.findall(re.sub(r"[-/_]", " ", plain))
    return [word.removesuffix("'s").removesuffix("'") for word in found]


@cache
def vocabulary() -> Mapping[str, Meaning]:
    """Meanings by words with one space between them."""
    found: dict[str, Meaning] = {}
    for line in TABLE.read_text().splitlines():
        if not line.startswith("#"):
            kind, value, words = line.split("\t")
            for phrase in words.split(", "):
                found.setdefault(" ".join(words_of(phrase)), Meaning(kind=kind, value=value))
    return found


def meaning_of(phrase: str) -> Meaning | None:
    """What a phrase means, in the singular or the plural."""
    known = vocabulary()
    for ending, instead in (("", ""), ("ies", "y"), ("es", ""), ("s", "")):
        if phrase.endswith(ending) and (found := known.get(phrase[: len(phrase) - len(ending)] + instead)):
            return found
    return None
