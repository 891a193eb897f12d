"""Which viseme when: the sounds of a text one after another, each as long as it usually takes.

Seconds from the beginning.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from avatargen.errors import InputError
from avatargen.motion.speech.sounds import SILENCE, SOUNDS, VOWELS
from avatargen.motion.speech.spelling import LONG_PAUSE, SHORT_PAUSE, spoken

BEFORE, AFTER = 0.2, 0.4  # seconds of silence around a text
PAUSE_SECONDS = {LONG_PAUSE: 0.4, SHORT_PAUSE: 0.2}
LAST = 1.35  # by which the sounds of a word before a pause are longer


@dataclass(frozen=True)
class Segment:
    """A viseme, or silence, from one time to another."""

    start: float
    end: float
    viseme: str


def segments_of_text(text: str) -> list[Segment]:
    """The visemes of an English text, silence before and behind it.

    Raises:
        InputError: there is nothing in it to say.
    """
    said = spoken(text)
    if all(isinstance(word, str) for word in said):
        raise InputError(
            f"found {text!r} to say, which has no English word; give some, as --say 'Hello there'"
        )
    found, at = [Segment(0.0, BEFORE, SILENCE)], BEFORE
    for number, word in enumerate(said):
        behind = said[number + 1] if number + 1 < len(said) else LONG_PAUSE
        if isinstance(word, str):
            made = [Segment(at, at + PAUSE_SECONDS[word], SILENCE)]
        else:
            made = list(segments_of_word(word, at, LAST if isinstance(behind, str) else 1.0))
        found += made
        at = made[-1].end
    if found[-1].viseme == SILENCE:
        found.pop()
    return [*found, Segment(found[-1].end, found[-1].end + AFTER, SILENCE)]


def segments_of_word(sounds: Sequence[str], at: float, slower: float) -> Iterator[Segment]:
    """The visemes of a word's phonemes; those from its last vowel on are `slower`."""
    last = max((i for i, sound in enumerate(sounds) if sound in VOWELS), default=0)
    for number, sound in enumerate(sounds):
        end = at + SOUNDS[sound].seconds * (slower if number >= last else 1.0)
        yield from segments_of_sound(sound, at, end)
        at = end


def segments_of_sound(sound: str, start: float, end: float) -> Iterator[Segment]:
    """The visemes of one phoneme; one without any lasts and shows nothing of its own."""
    at = start
    for viseme, share in SOUNDS[sound].visemes or (("", 1.0),):
        yield Segment(at, at + share * (end - start), viseme)
        at += share * (end - start)
