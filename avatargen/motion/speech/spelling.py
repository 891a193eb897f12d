"""English words to phonemes by rules: letters, what stands before and behind them, and the sounds they have
there. Words that follow no rule are listed. Standard library alone.

No rule knows which syllable is stressed, and a mouth shows little of that.
"""

import re
import unicodedata

from avatargen.motion.speech.listed import EXCEPTIONS, SHORTENED
from avatargen.motion.speech.numbers import number_words
from avatargen.motion.speech.rules import RULES

PAUSE = re.compile(r"[.!?;:\n]+|[,\u2013\u2014()]+")
TOKENS = re.compile(rf"[a-z]+(?:'[a-z]+)?|\d+|{PAUSE.pattern}")
THOUSANDS = re.compile(r"(?<=\d),(?=\d{3}\b)")
LONG_PAUSE, SHORT_PAUSE = ".", ","


def spoken(text: str) -> list[tuple[str, ...] | str]:
    """The words of a text as phonemes by ARPAbet's names, and between them "." or "," where one pauses. What
    is no English letter, digit or pause is passed over."""
    plain = unicodedata.normalize("NFKD", THOUSANDS.sub("", text.lower().replace("\u2019", "'")))
    said: list[tuple[str, ...] | str] = []
    for token in TOKENS.findall("".join(letter for letter in plain if not unicodedata.combining(letter))):
        if PAUSE.fullmatch(token):
            said.append(LONG_PAUSE if set(token) & set(".!?;:\n") else SHORT_PAUSE)
        elif token[0].isdigit():
            said.extend(word_sounds(word) for word in number_words(token))
        else:
            said.append(word_sounds(token))
    return said


def word_sounds(word: str) -> tuple[str, ...]:
    """A word of the letters a to z, perhaps with an apostrophe, as phonemes."""
    if word in EXCEPTIONS:
        return tuple(EXCEPTIONS[word].split())
    base, _, short = word.partition("'")
    if short:
        return (*word_sounds(base), *shortened(base, short))
    for ending, sound in (("s", "Z"), ("ed", "D"), ("ing", "IH NG"), ("ly", "L IY")):
        stem = word.removesuffix(ending)
        if stem != word and stem in EXCEPTIONS:
            return (*EXCEPTIONS[stem].split(), *sound.split())
    return by_rules(word)


def shortened(base: str, short: str) -> tuple[str, ...]:
    """What stands behind an apostrophe: `'s` is hard after a hard sound."""
    if short == "s":
        return ("S",) if base.endswith(("p", "t", "k", "f", "th")) else ("Z",)
    return tuple(SHORTENED[short].split()) if short in SHORTENED else by_rules(short)


def by_rules(word: str) -> tuple[str, ...]:
    """From the left, the first rule that fits each place; one of two equal sounds in a row is heard."""
    sounds: list[str] = []
    at = 0
    while at < len(word):
        for before, letters, behind, said in RULES[word[at]]:
            if (
                word.startswith(letters, at)
                and re.search(f"(?:{before})$", word[:at])
                and re.match(behind, word[at + len(letters) :])
            ):
                sounds += [sound for sound in said.split() if not sounds or sound != sounds[-1]]
                at += len(letters)
                break
    return tuple(sounds)
