"""The range test: every joint in turn to both ends of its range, to see how the skin bends there.

Ranges are those of a supple adult, rounded: what a rig must survive, not what everyone can do.
"""

import numpy as np
from jaxtyping import Float64
from scipy.interpolate import CubicHermiteSpline

from avatargen.body.joints import mirrored_name
from avatargen.body.pose import axis_angle_to_matrix
from avatargen.body.stance import FINGER_LIMBS, Axis, Limb, X, Y, Z
from avatargen.motion.figure import Figure
from avatargen.motion.gait import Turns

SECONDS_EACH = 1.0


def together(joints: tuple[str, ...], axis: int, low: int, high: int) -> Limb:
    """Joints that each turn by the whole angle about x, y or z."""
    x, y, z = (float(axis == each) for each in (X, Y, Z))
    return Limb(axes=tuple((joint, (x, y, z)) for joint in joints), low=low, high=high)


# joints of the left side are given; the right ones mirror them
RANGES = (
    together(("left_hip",), X, -100, 20),
    together(("left_hip",), Z, -15, 45),
    together(("left_hip",), Y, -30, 40),
    together(("left_knee",), X, 0, 130),
    together(("left_ankle",), X, -20, 45),
    together(("left_ankle",), Z, -20, 15),
    together(("left_foot",), X, -45, 30),
    together(("spine1", "spine2", "spine3"), X, -8, 20),
    together(("spine1", "spine2", "spine3"), Y, -14, 14),
    together(("spine1", "spine2", "spine3"), Z, -10, 10),
    together(("neck", "head"), X, -25, 22),
    together(("neck", "head"), Y, -35, 35),
    together(("neck", "head"), Z, -18, 18),
    together(("left_collar",), Z, -8, 25),
    together(("left_collar",), Y, -20, 15),
    together(("left_shoulder",), Z, -75, 60),
    together(("left_shoulder",), Y, -100, 25),
    together(("left_shoulder",), X, -70, 60),
    together(("left_elbow",), Y, -140, 0),
    together(("left_wrist",), Z, -70, 60),
    together(("left_wrist",), Y, -25, 20),
    together(("left_wrist",), X, -70, 70),
    together(("left_hand",), Z, -75, 10),
    *(limb for name, limb in FINGER_LIMBS.items() if name.startswith("left")),
)


def ranges_of(figure: Figure) -> list[Limb]:
    """Those rows whose joints the figure has."""
    return [row for row in RANGES if {joint for joint, _ in row.axes} <= set(figure.joint_names)]


def range_seconds(figure: Figure) -> float:
    return SECONDS_EACH * len(ranges_of(figure))


def range_test(figure: Figure, times: Float64[np.ndarray, " T"]) -> tuple[Turns, Float64[np.ndarray, "T 3"]]:
    """Rotations by joint: one row after another, there, across and back; the pelvis stays."""
    turns: Turns = {}
    for index, row in enumerate(ranges_of(figure)):
        path = CubicHermiteSpline([0, 0.3, 0.7, 1], np.radians([0, row.low, row.high, 0]), np.zeros(4))
        angle = path(np.clip(times / SECONDS_EACH - index, 0, 1))
        for joint, axis in row.axes:
            add_turn(turns, joint, turn_about(axis, angle))
            if mirrored_name(joint) != joint:
                # in a mirror across x = 0 turns about x stay and the others change their sign
                add_turn(turns, mirrored_name(joint), turn_about((axis[0], -axis[1], -axis[2]), angle))
    return turns, np.zeros((len(times), 3))


def turn_about(axis: Axis, angle: Float64[np.ndarray, " T"]) -> Float64[np.ndarray, "T 3 3"]:
    """Rotations about an axis, by the angle times its length."""
    return axis_angle_to_matrix(angle[:, None] * np.array(axis))


def add_turn(turns: Turns, joint: str, turned: Float64[np.ndarray, "T 3 3"]) -> None:
    """One row's turn on top of the others', of which at most one is not zero at any time."""
    turns[joint] = turns[joint] @ turned if joint in turns else turned
