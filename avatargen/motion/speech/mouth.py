"""Weights of visemes over time: each rises before its sound and fades behind it, so that neighbours blend.

Between neighbours the dominance of each decides, as in M. Cohen and D. Massaro, Modeling coarticulation in
synthetic visual speech, 1993; but lips that close do so whatever is around. Letters: T times, S segments, K
visemes.
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float64

from avatargen.motion.speech.sounds import CLOSED, SILENCE, VISEMES
from avatargen.motion.speech.timing import Segment
from avatargen.smoothstep import smoothstep

EASE = 0.045  # seconds before and behind a border within which its sounds blend
CLOSE_EASE = 0.05  # seconds that lips take to close or to open
HELD = 0.05  # seconds that they are closed for at least: a frame of a slow film shows it
FAINT = 1e-6  # of a dominance: no sound at all
STRENGTH = {  # of a viseme in fluent speech, of the one held for a picture
    "PP": 1.0,
    "FF": 1.0,
    "TH": 0.8,
    "DD": 0.7,
    "kk": 0.7,
    "CH": 0.85,
    "SS": 0.8,
    "nn": 0.7,
    "RR": 0.75,
    "aa": 0.8,
    "E": 0.8,
    "I": 0.75,
    "O": 0.9,
    "U": 0.9,
}


def mouth_weights(
    segments: Sequence[Segment], times: Float64[np.ndarray, " T"]
) -> Float64[np.ndarray, "T K"]:
    """The weight of each of `VISEMES` at each time, 0..1; their sum is at most 1, and 0 in silence."""
    shown = {name: np.zeros(len(times)) for name in (*VISEMES, SILENCE)}
    closed = {name: np.zeros(len(times)) for name in CLOSED}
    for segment in segments:
        if segment.viseme in closed:
            closed[segment.viseme] = np.maximum(closed[segment.viseme], closure(segment, times))
        elif segment.viseme:
            shown[segment.viseme] += bump(times, segment.start, segment.end, EASE)
    total = np.maximum(sum(shown.values()), FAINT)
    # at a sound that shows nothing of its own, and beyond both ends, no dominance need add up to 1
    share = {name: dominance / np.maximum(total, 1.0) for name, dominance in shown.items()}
    left = np.ones(len(times))
    for name in CLOSED:
        share[name] = left * closed[name]
        left = left * (1 - closed[name])
    columns = [share[name] * (1 if name in CLOSED else STRENGTH[name] * left) for name in VISEMES]
    return np.clip(np.stack(columns, axis=1), 0.0, 1.0)


def closure(segment: Segment, times: Float64[np.ndarray, " T"]) -> Float64[np.ndarray, " T"]:
    """How far lips are closed: wholly for as long as the sound but for its ends, and for `HELD` at least."""
    middle = (segment.start + segment.end) / 2
    half = max((segment.end - segment.start) / 2 - CLOSE_EASE / 2, HELD / 2)
    rise = smoothstep((times - (middle - half - CLOSE_EASE)) / CLOSE_EASE)
    return rise * smoothstep(((middle + half + CLOSE_EASE) - times) / CLOSE_EASE)


def bump(
    times: Float64[np.ndarray, " T"], start: float, end: float, ease: float
) -> Float64[np.ndarray, " T"]:
    """1 from start to end, half at both, 0 from `ease` before and behind."""
    return smoothstep((times - start + ease) / (2 * ease)) * smoothstep((end + ease - times) / (2 * ease))
