"""Poses in words that people use: how far an arm is raised or a knee is bent, in degrees.

Each limb's angle turns a joint, or all joints of a finger, about axes of the T-pose; several of one joint are
applied in the order of the table, the first outermost. Joints that a skeleton does not have are skipped, so
any skeleton with SMPL's names works.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.spatial.transform import Rotation

from avatargen.body.pose import Z_AXIS_POSES
from avatargen.errors import InputError

X, Y, Z = 0, 1, 2
Axis = tuple[float, float, float]


@dataclass(frozen=True, kw_only=True)
class Limb:
    """What one angle does: each joint turns about its axis, by the angle times the axis' length. Degrees."""

    axes: tuple[tuple[str, Axis], ...]
    low: int
    high: int


def limb(joint: str, axis: int, sign: int, low: int, high: int) -> Limb:
    """One joint about x, y or z."""
    x, y, z = (float(sign * (axis == each)) for each in (X, Y, Z))
    return Limb(axes=((joint, (x, y, z)),), low=low, high=high)


def pair(name: str, joint: str, axis: int, left: int, right: int, low: int, high: int) -> dict[str, Limb]:
    """The same angle on both sides."""
    return {
        f"left {name}": limb(f"left_{joint}", axis, left, low, high),
        f"right {name}": limb(f"right_{joint}", axis, right, low, high),
    }


def of_hands(name: str, axes: dict[str, Axis], low: int, high: int) -> dict[str, Limb]:
    """Joints of the left hand turned about these axes, and those of the right about their mirror images."""
    return {
        f"{side} {name}": Limb(
            axes=tuple((f"{side}_{joint}", (x, sign * y, sign * z)) for joint, (x, y, z) in axes.items()),
            low=low,
            high=high,
        )
        for side, sign in (("left", 1), ("right", -1))
    }


ASIDE = {"index": 14.0, "middle": 0.0, "ring": -9.0, "pinky": -15.0}  # degrees from x to z, of a left finger
BENDS = (0.9, 1.0, 0.7)  # of the three links, for one degree of a curl
THUMB_HINGE = (0.60, 0.70, -0.39)  # turns its last links into the palm


def curl(finger: str) -> dict[str, Axis]:
    """Each link bends about the hinge that lies across the finger and in the palm."""
    aside = np.radians(ASIDE[finger])
    x, z = float(np.sin(aside)), float(-np.cos(aside))
    return {f"{finger}{link + 1}": (share * x, 0.0, share * z) for link, share in enumerate(BENDS)}


FINGER_LIMBS = {
    # the first in the table is outermost: a finger that is curled and aside bends in its own plane
    **of_hands("spread", {f"{finger}1": (0.0, -aside / 14, 0.0) for finger, aside in ASIDE.items()}, -14, 14),
    **{name: each for finger in ASIDE for name, each in of_hands(finger, curl(finger), -10, 100).items()},
    **of_hands("thumb in", {"thumb1": (1.0, 0.3, 0.0)}, -15, 45),
    **of_hands("thumb", {"thumb2": THUMB_HINGE, "thumb3": THUMB_HINGE}, -15, 70),
}


LIMBS: dict[str, Limb] = {
    "bend forward": limb("spine1", X, 1, -30, 80),
    "bend left": limb("spine2", Z, -1, -40, 40),
    "turn left": limb("spine3", Y, 1, -50, 50),
    "nod": limb("head", X, 1, -40, 40),
    "look left": limb("neck", Y, 1, -70, 70),
    **pair("arm swing", "shoulder", X, -1, -1, -60, 120),
    **pair("arm forward", "shoulder", Y, -1, 1, -30, 110),
    **pair("arm up", "shoulder", Z, 1, -1, -85, 85),
    **pair("arm twist", "shoulder", X, -1, -1, -90, 90),
    **pair("elbow", "elbow", Y, -1, 1, 0, 140),
    **pair("leg forward", "hip", X, -1, -1, -40, 110),
    **pair("leg out", "hip", Z, 1, -1, -10, 60),
    **pair("knee", "knee", X, 1, 1, 0, 140),
    **pair("foot up", "ankle", X, -1, -1, -40, 40),
    **FINGER_LIMBS,
}


def angles_of(pose: str) -> dict[str, float]:
    """A rest pose of arms and legs in these words."""
    found = {}
    for name, limb in LIMBS.items():
        joint, (x, y, z) = limb.axes[0]
        if joint in Z_AXIS_POSES[pose] and not x and not y:
            found[name] = float(np.degrees(Z_AXIS_POSES[pose][joint])) / z
    return found


def both_hands(**angles: int) -> dict[str, float]:
    """Angles of fingers, on both sides."""
    words = {name.replace("_", " "): float(angle) for name, angle in angles.items()}
    return {f"{side} {name}": angle for side in ("left", "right") for name, angle in words.items()}


FIST = both_hands(spread=-14, index=88, middle=92, ring=94, pinky=96, thumb_in=32, thumb=45)
OPEN = both_hands(spread=12, index=-4, middle=-8, ring=-10, pinky=-10, thumb=-10)
DOWN = {"left arm up": -68.0, "right arm up": -68.0}
STANCES: dict[str, dict[str, float]] = {
    **{name: angles_of(name) for name in ("a", "t", "x")},
    "fist": {**angles_of("a"), **FIST},
    "spread": {**angles_of("a"), **OPEN},
    "point": {**angles_of("a"), **FIST, **both_hands(spread=-6, index=0)},
    "stand": {**DOWN, "left elbow": 12.0, "right elbow": 12.0, "left leg out": 3.0, "right leg out": 3.0},
    "walk": {
        **DOWN,
        "left arm swing": -25.0,
        "right arm swing": 25.0,
        "left elbow": 20.0,
        "right elbow": 30.0,
        "left leg forward": 28.0,
        "left knee": 8.0,
        "left foot up": 12.0,
        "right leg forward": -16.0,
        "right knee": 32.0,
        "turn left": -6.0,
    },
    "wave": {
        **DOWN,
        "left elbow": 12.0,
        "right arm up": 10.0,
        "right arm twist": 80.0,
        "right elbow": 80.0,
        "look left": -12.0,
        "left leg out": 3.0,
        "right leg out": 3.0,
    },
    "sit": {
        **DOWN,
        "left arm swing": 25.0,
        "right arm swing": 25.0,
        "left elbow": 45.0,
        "right elbow": 45.0,
        "left leg forward": 88.0,
        "right leg forward": 88.0,
        "left leg out": 6.0,
        "right leg out": 6.0,
        "left knee": 88.0,
        "right knee": 88.0,
    },
}


def stance(name: str) -> dict[str, float]:
    """The angles of a stance, by limb. Raises InputError where none has that name."""
    if name not in STANCES:
        raise InputError(f"pose: no pose is named {name!r}; use one of {', '.join(STANCES)} or an .npz file")
    return STANCES[name]


def limb_rotations(angles: dict[str, float], joint_names: tuple[str, ...]) -> Float[np.ndarray, "J 3"]:
    """Axis-angle rotations [J 3], radians, of a skeleton in the T-pose for angles in degrees by limb.

    Raises:
        InputError: an angle of no limb, or not finite.
    """
    unknown = set(angles) - set(LIMBS)
    if unknown or not all(np.isfinite(angle) for angle in angles.values()):
        raise InputError(f"pose: {', '.join(sorted(unknown)) or 'an angle'} is no finite angle of a limb")
    found = {name: Rotation.identity() for name in joint_names}
    for name in (name for name in LIMBS if name in angles):
        limb = LIMBS[name]
        for joint, axis in limb.axes:
            if joint in found:
                found[joint] = found[joint] * Rotation.from_rotvec(np.radians(angles[name]) * np.array(axis))
    return np.stack([found[name].as_rotvec() for name in joint_names])
