"""A file of phonemes and their times, JSON: a list of objects, in order.

    [{"start": 0.20, "end": 0.27, "phoneme": "HH"},
     {"start": 0.27, "end": 0.36, "phoneme": "AH0"},
     {"start": 0.36, "end": 0.55, "viseme": "O"}]

Times are seconds. A phoneme is one of ARPAbet's, with a digit of stress or without; "SIL", "SP", "PAU" and
"" are silence, and so is what lies between two entries. A viseme is one of Oculus' fifteen, with "viseme_" in
front or without.
"""

import json
import math
from pathlib import Path
from typing import Any

from avatargen.errors import InputError
from avatargen.motion.speech.sounds import PAUSES, SILENCE, SOUNDS, VISEMES
from avatargen.motion.speech.timing import AFTER, Segment, segments_of_sound

LONGEST = 3600.0  # seconds
MOST_BYTES = 1 << 24


def read_phonemes(path: str | Path) -> list[Segment]:
    """The visemes of a file, silence where it says nothing and behind its last entry.

    Raises:
        InputError: no such file, or it is no list of phonemes with times that follow each other.
    """
    path = Path(path)
    try:
        if path.stat().st_size > MOST_BYTES:
            raise InputError(f"phonemes: {path} is larger than {MOST_BYTES >> 20} MB; say less")
        entries = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(
            f"phonemes: cannot read {path}: {error.strerror or error}; check the path"
        ) from error
    except (ValueError, RecursionError) as error:
        raise InputError(f"phonemes: {path} is no JSON ({error}); write a list of objects") from error
    if not isinstance(entries, list) or not entries:
        raise InputError(
            f"phonemes: {path} holds no list with entries; write "
            '[{"start": 0.2, "end": 0.3, "phoneme": "AA"}, ...]'
        )
    found: list[Segment] = []
    for number, entry in enumerate(entries, start=1):
        found += segments_of_entry(
            entry, found[-1].end if found else 0.0, f"phonemes: {path}, entry {number}"
        )
    return [*found, Segment(found[-1].end, found[-1].end + AFTER, SILENCE)]


def segments_of_entry(entry: Any, last: float, where: str) -> list[Segment]:
    """One entry's visemes, and the silence since the last one's end.

    Raises:
        InputError: it is no such entry, or begins too early; `where` says which it is.
    """
    if not isinstance(entry, dict) or not {"start", "end"} <= entry.keys():
        raise InputError(f'{where}: found no "start" and "end"; give both, in seconds')
    start, end = seconds(entry["start"]), seconds(entry["end"])
    if start is None or end is None or not start < end <= LONGEST:
        raise InputError(
            f"{where}: found {entry['start']!r} to {entry['end']!r}; give seconds from 0 to {LONGEST:g}, the "
            "end behind the start"
        )
    if start < last - 1e-6:
        raise InputError(f"{where}: it starts at {start:g} s, before the last ends at {last:g} s; sort")
    silence = [Segment(last, start, SILENCE)] if start > last + 1e-6 else []
    return [*silence, *visemes_of(entry, max(start, last), end, where)]


def visemes_of(entry: dict[str, Any], start: float, end: float, where: str) -> list[Segment]:
    """What the mouth shows of an entry. Raises InputError for a sound that there is not."""
    given = [name for name in ("phoneme", "viseme") if name in entry]
    if len(given) != 1 or not isinstance(entry[given[0]], str):
        raise InputError(f'{where}: give it either a "phoneme" or a "viseme", a word in quotes')
    word = entry[given[0]]
    if given == ["viseme"]:
        viseme = word.removeprefix("viseme_")
        if viseme not in (*VISEMES, SILENCE):
            known = ", ".join((SILENCE, *VISEMES))
            raise InputError(f"{where}: found viseme {word!r}, wanted one of {known}")
        return [Segment(start, end, viseme)]
    sound = word.upper().rstrip("012")
    if not sound or sound in PAUSES:
        return [Segment(start, end, SILENCE)]
    if sound not in SOUNDS:
        raise InputError(f"{where}: found phoneme {word!r}, wanted one of ARPAbet's, as {', '.join(SOUNDS)}")
    return list(segments_of_sound(sound, start, end))


def seconds(value: Any) -> float | None:
    """A time, or None for what is none."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    return float(value) if math.isfinite(value) and value >= 0 else None
