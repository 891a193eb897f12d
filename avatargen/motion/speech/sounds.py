"""English phonemes by ARPAbet's names, how long each takes and what the mouth shows of it.

A viseme is one of the fifteen of Oculus' lip sync, without its prefix `viseme_`. Standard library alone.
"""

from dataclasses import dataclass

SILENCE = "sil"
CLOSED = ("PP", "FF")  # lips meet, or the lower one meets the teeth: whatever is around
VISEMES = ("PP", "FF", "TH", "DD", "kk", "CH", "SS", "nn", "RR", "aa", "E", "I", "O", "U")


@dataclass(frozen=True)
class Sound:
    """Seconds in fluent speech, and the visemes it goes through, a share of its time each. One without any
    is said with the mouth that its neighbours make."""

    seconds: float
    visemes: tuple[tuple[str, float], ...] = ()


def vowel(seconds: float, *visemes: str) -> Sound:
    """A vowel, or a diphthong whose first half is the longer one."""
    if len(visemes) == 1:
        return Sound(seconds, ((visemes[0], 1.0),))
    first, second = visemes
    return Sound(seconds, ((first, 0.6), (second, 0.4)))


def consonant(seconds: float, viseme: str) -> Sound:
    return Sound(seconds, ((viseme, 1.0),))


SOUNDS = {
    "AA": vowel(0.13, "aa"),
    "AE": vowel(0.13, "aa"),
    "AH": vowel(0.08, "aa"),
    "AO": vowel(0.13, "O"),
    "AW": vowel(0.17, "aa", "U"),
    "AY": vowel(0.17, "aa", "I"),
    "EH": vowel(0.10, "E"),
    "ER": vowel(0.12, "RR"),
    "EY": vowel(0.15, "E", "I"),
    "IH": vowel(0.08, "I"),
    "IY": vowel(0.12, "I"),
    "OW": vowel(0.15, "O", "U"),
    "OY": vowel(0.18, "O", "I"),
    "UH": vowel(0.09, "U"),
    "UW": vowel(0.13, "U"),
    "B": consonant(0.075, "PP"),
    "CH": consonant(0.10, "CH"),
    "D": consonant(0.065, "DD"),
    "DH": consonant(0.06, "TH"),
    "F": consonant(0.095, "FF"),
    "G": consonant(0.07, "kk"),
    "HH": Sound(0.05),
    "JH": consonant(0.09, "CH"),
    "K": consonant(0.08, "kk"),
    "L": consonant(0.07, "nn"),
    "M": consonant(0.08, "PP"),
    "N": consonant(0.07, "nn"),
    "NG": consonant(0.08, "nn"),
    "P": consonant(0.085, "PP"),
    "R": consonant(0.07, "RR"),
    "S": consonant(0.095, "SS"),
    "SH": consonant(0.10, "CH"),
    "T": consonant(0.07, "DD"),
    "TH": consonant(0.09, "TH"),
    "V": consonant(0.07, "FF"),
    "W": consonant(0.07, "U"),
    "Y": consonant(0.06, "I"),
    "Z": consonant(0.08, "SS"),
    "ZH": consonant(0.09, "CH"),
}
VOWELS = ("AA", "AE", "AH", "AO", "AW", "AY", "EH", "ER", "EY", "IH", "IY", "OW", "OY", "UH", "UW")
PAUSES = ("SIL", "SP", "PAU")  # what makers of phonemes call silence
