"""The built-in clips by name: each a pure function of a figure and of time, sampled to a motion."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64
from scipy.spatial.transform import Rotation

from avatargen.body.joints import driving_name
from avatargen.errors import InputError
from avatargen.motion.figure import Figure
from avatargen.motion.gait import SECONDS as WALK_SECONDS
from avatargen.motion.gait import Turns, walk
from avatargen.motion.limits import range_seconds, range_test
from avatargen.motion.motion import Motion, continuous
from avatargen.motion.standing import IDLE_SECONDS, WAVE_SECONDS, idle, wave

FPS = 30.0


@dataclass(frozen=True)
class Clip:
    """`function` gives rotations by joint and the pelvis' way at any times in 0..seconds."""

    seconds: Callable[[Figure], float]
    function: Callable[[Figure, Float64[np.ndarray, " T"]], tuple[Turns, Float64[np.ndarray, "T 3"]]]


CLIPS = {
    "idle": Clip(lambda figure: IDLE_SECONDS, idle),
    "walk": Clip(lambda figure: WALK_SECONDS, walk),
    "wave": Clip(lambda figure: WAVE_SECONDS, wave),
    "range": Clip(range_seconds, range_test),
}


def make_clip(name: str, figure: Figure, fps: float = FPS) -> Motion:
    """A built-in clip for this figure, at about `fps` frames a second; the last frame is the clip's end.

    Raises:
        InputError: no clip has that name, or the figure lacks a joint that it moves.
    """
    if name not in CLIPS:
        raise InputError(f"clip: none is called {name!r}; use one of {', '.join(CLIPS)}")
    if not 0 < fps <= 1000:
        raise InputError(f"clip: {fps:g} frames a second; choose a number up to 1000")
    seconds = CLIPS[name].seconds(figure)
    times = np.linspace(0, seconds, max(2, round(seconds * fps) + 1))
    turns, place = CLIPS[name].function(figure, times)
    drivers = {joint: driving_name(joint, turns) for joint in figure.joint_names}
    names = tuple(joint for joint, driver in drivers.items() if driver is not None)
    matrices = np.stack([turns[driver] for driver in drivers.values() if driver is not None], axis=1)
    quaternions = Rotation.from_matrix(matrices.reshape(-1, 3, 3)).as_quat().reshape(*matrices.shape[:2], 4)
    return Motion(
        name=name, joint_names=names, times=times, rotations=continuous(quaternions), translation=place
    )
