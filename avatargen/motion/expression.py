"""Motions of a face alone: it blinks, smiles, or says something. Pure functions of time; each begins and ends
with the face at rest. Letters: T times.
"""

from collections.abc import Mapping, Sequence

import numpy as np
from jaxtyping import Float64

from avatargen.errors import InputError
from avatargen.motion.motion import Motion
from avatargen.motion.names import FACE_CLIPS
from avatargen.motion.speech.mouth import mouth_weights
from avatargen.motion.speech.sounds import VISEMES
from avatargen.motion.speech.timing import Segment, segments_of_text
from avatargen.smoothstep import smoothstep

FPS = 60.0  # of what is made here, before it is sampled anew
LIDS = ("eyeBlinkLeft", "eyeBlinkRight")
LID_SECONDS = (0.08, 0.05, 0.17)  # closing, closed, opening
BLINK_SECONDS = 3.0  # of the clip, which blinks once early and once again
SMILE = {"mouthSmileLeft": 0.9, "mouthSmileRight": 0.9, "cheekSquintLeft": 0.6, "cheekSquintRight": 0.6}
SMILE_SECONDS = (0.5, 1.7, 0.8)  # coming, staying, going
FIRST_BLINK, SHORTEST_GAP, LONGEST_GAP = 0.9, 2.2, 4.6  # seconds
TALK = "Hello, and welcome! I am very happy to meet you. Please come by more often."


def make_face_clip(name: str) -> Motion:
    """The clip `blink`, `talk` or `smile`. Raises InputError where none has that name."""
    if name not in FACE_CLIPS:
        raise InputError(f"clip: no clip of a face is called {name!r}; use one of {', '.join(FACE_CLIPS)}")
    if name == "talk":
        return speech(name, segments_of_text(TALK))
    if name == "blink":
        times = frames(BLINK_SECONDS)
        return face_motion(name, times, dict.fromkeys(LIDS, lids(times, (0.4, 2.2))))
    times = frames(sum(SMILE_SECONDS))
    share = rise_and_fall(times, 0.0, SMILE_SECONDS)
    closed = lids(times, (0.7,))
    return face_motion(
        name, times, {shape: weight * share for shape, weight in SMILE.items()} | dict.fromkeys(LIDS, closed)
    )


def speech(name: str, segments: Sequence[Segment]) -> Motion:
    """A mouth that shows these visemes, with blinks."""
    times = frames(segments[-1].end)
    mouth = mouth_weights(segments, times)
    mouth[[0, -1]] = 0.0
    closed = lids(times, blink_times(float(times[-1])))
    said = {f"viseme_{viseme}": mouth[:, column] for column, viseme in enumerate(VISEMES)}
    return face_motion(name, times, said | dict.fromkeys(LIDS, closed))


def blink_times(seconds: float) -> list[float]:
    """When a speaker blinks, who goes on for so long: gaps of all lengths between the shortest and the
    longest, spread by the golden ratio."""
    found, at, golden = [], FIRST_BLINK, (5**0.5 - 1) / 2
    while at + sum(LID_SECONDS) <= seconds:
        found.append(at)
        at += SHORTEST_GAP + (LONGEST_GAP - SHORTEST_GAP) * (len(found) * golden % 1.0)
    return found


def lids(times: Float64[np.ndarray, " T"], starts: Sequence[float]) -> Float64[np.ndarray, " T"]:
    """How far the lids are closed that blink at these times."""
    blinks = [rise_and_fall(times, start, LID_SECONDS) for start in starts]
    return np.max([np.zeros(len(times)), *blinks], axis=0)


def rise_and_fall(
    times: Float64[np.ndarray, " T"], start: float, lengths: tuple[float, float, float]
) -> Float64[np.ndarray, " T"]:
    """From 0 to 1, there for a while, and back; three lengths in seconds."""
    up, stay, down = lengths
    return smoothstep((times - start) / up) * smoothstep((start + up + stay + down - times) / down)


def frames(seconds: float) -> Float64[np.ndarray, " T"]:
    """Times from 0 to the last frame that the seconds touch."""
    return np.arange(int(np.ceil(seconds * FPS - 1e-9)) + 1) / FPS


def face_motion(
    name: str, times: Float64[np.ndarray, " T"], shapes: Mapping[str, Float64[np.ndarray, " T"]]
) -> Motion:
    """Weights by shape as a motion; shapes that never show are left out."""
    shown = {shape: weights for shape, weights in shapes.items() if weights.any()}
    return Motion(
        name=name,
        joint_names=(),
        times=times,
        rotations=np.zeros((len(times), 0, 4)),
        translation=np.zeros((len(times), 3)),
        shapes=tuple(shown),
        weights=np.stack([*shown.values()], axis=1),
    )
