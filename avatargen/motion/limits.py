"""The range test: every joint in turn to both ends of its range, to see how the skin bends there.

Ranges are those of a supple adult, rounded: what a rig must survive, not what everyone can do.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64
from scipy.interpolate import CubicHermiteSpline

from avatargen.body.joints import FINGERS, mirrored_name
from avatargen.motion.figure import Figure
from avatargen.motion.gait import Turns
from avatargen.motion.legs import turn

SECONDS_EACH = 1.0
X, Y, Z = 0, 1, 2


@dataclass(frozen=True)
class Range:
    """How far joints turn about one axis from the T-pose, in degrees; together, each by this much.

    Joints of the left side are given; the right ones mirror them.
    """

    joints: tuple[str, ...]
    axis: int
    low: int
    high: int


FINGER_JOINTS = tuple(f"left_{finger}{link}" for finger in FINGERS if finger != "thumb" for link in (1, 2, 3))
RANGES = (
    Range(("left_hip",), X, -100, 20),
    Range(("left_hip",), Z, -15, 45),
    Range(("left_hip",), Y, -30, 40),
    Range(("left_knee",), X, 0, 130),
    Range(("left_ankle",), X, -20, 45),
    Range(("left_ankle",), Z, -20, 15),
    Range(("left_foot",), X, -45, 30),
    Range(("spine1", "spine2", "spine3"), X, -8, 20),
    Range(("spine1", "spine2", "spine3"), Y, -14, 14),
    Range(("spine1", "spine2", "spine3"), Z, -10, 10),
    Range(("neck", "head"), X, -25, 22),
    Range(("neck", "head"), Y, -35, 35),
    Range(("neck", "head"), Z, -18, 18),
    Range(("left_collar",), Z, -8, 25),
    Range(("left_collar",), Y, -20, 15),
    Range(("left_shoulder",), Z, -75, 60),
    Range(("left_shoulder",), Y, -100, 25),
    Range(("left_shoulder",), X, -70, 60),
    Range(("left_elbow",), Y, -140, 0),
    Range(("left_wrist",), Z, -70, 60),
    Range(("left_wrist",), Y, -25, 20),
    Range(("left_wrist",), X, -70, 70),
    Range(("left_hand",), Z, -75, 10),
    Range(FINGER_JOINTS, Z, -75, 5),
)


def ranges_of(figure: Figure) -> list[Range]:
    """Those rows whose joints the figure has."""
    return [row for row in RANGES if set(row.joints) <= set(figure.joint_names)]


def range_seconds(figure: Figure) -> float:
    return SECONDS_EACH * len(ranges_of(figure))


def range_test(figure: Figure, times: Float64[np.ndarray, " T"]) -> tuple[Turns, Float64[np.ndarray, "T 3"]]:
    """Rotations by joint: one row after another, there, across and back; the pelvis stays."""
    turns: Turns = {}
    for index, row in enumerate(ranges_of(figure)):
        path = CubicHermiteSpline([0, 0.3, 0.7, 1], np.radians([0, row.low, row.high, 0]), np.zeros(4))
        angle = path(np.clip(times / SECONDS_EACH - index, 0, 1))
        for joint in row.joints:
            add_turn(turns, joint, turn(angle, row.axis))
            if mirrored_name(joint) != joint:
                # in a mirror across x = 0 turns about x stay and the others change their sign
                other = turn(angle if row.axis == X else -angle, row.axis)
                add_turn(turns, mirrored_name(joint), other)
    return turns, np.zeros((len(times), 3))


def add_turn(turns: Turns, joint: str, turned: Float64[np.ndarray, "T 3 3"]) -> None:
    """One row's turn on top of the others', of which at most one is not zero at any time."""
    turns[joint] = turns[joint] @ turned if joint in turns else turned
