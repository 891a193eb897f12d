"""Poses in words that people use: how far an arm is raised or a knee is bent, in degrees.

Each limb's angle turns one joint about one axis of the T-pose; several of one joint are applied in the order
of the table, the first outermost. Joints that a skeleton does not have are skipped, so any skeleton with
SMPL's names works.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.spatial.transform import Rotation

from avatargen.body.pose import Z_AXIS_POSES
from avatargen.errors import InputError

X, Y, Z = 0, 1, 2


@dataclass(frozen=True, kw_only=True)
class Limb:
    """What one angle does: degrees about an axis (0 x, 1 y, 2 z) of a joint, and how far it goes."""

    joint: str
    axis: int
    sign: int
    low: int
    high: int


def pair(name: str, joint: str, axis: int, left: int, right: int, low: int, high: int) -> dict[str, Limb]:
    """The same angle on both sides."""
    return {
        f"left {name}": Limb(joint=f"left_{joint}", axis=axis, sign=left, low=low, high=high),
        f"right {name}": Limb(joint=f"right_{joint}", axis=axis, sign=right, low=low, high=high),
    }


LIMBS: dict[str, Limb] = {
    "bend forward": Limb(joint="spine1", axis=X, sign=1, low=-30, high=80),
    "bend left": Limb(joint="spine2", axis=Z, sign=-1, low=-40, high=40),
    "turn left": Limb(joint="spine3", axis=Y, sign=1, low=-50, high=50),
    "nod": Limb(joint="head", axis=X, sign=1, low=-40, high=40),
    "look left": Limb(joint="neck", axis=Y, sign=1, low=-70, high=70),
    **pair("arm swing", "shoulder", X, -1, -1, -60, 120),
    **pair("arm forward", "shoulder", Y, -1, 1, -30, 110),
    **pair("arm up", "shoulder", Z, 1, -1, -85, 85),
    **pair("arm twist", "shoulder", X, -1, -1, -90, 90),
    **pair("elbow", "elbow", Y, -1, 1, 0, 140),
    **pair("leg forward", "hip", X, -1, -1, -40, 110),
    **pair("leg out", "hip", Z, 1, -1, -10, 60),
    **pair("knee", "knee", X, 1, 1, 0, 140),
    **pair("foot up", "ankle", X, -1, -1, -40, 40),
}


def angles_of(pose: str) -> dict[str, float]:
    """A rest pose of arms and legs in these words."""
    limb_of = {(limb.joint, limb.axis): (name, limb.sign) for name, limb in LIMBS.items()}
    found = {}
    for joint, radians in Z_AXIS_POSES[pose].items():
        name, sign = limb_of[joint, Z]
        found[name] = sign * float(np.degrees(radians))
    return found


DOWN = {"left arm up": -68.0, "right arm up": -68.0}
STANCES: dict[str, dict[str, float]] = {
    **{name: angles_of(name) for name in ("a", "t", "x")},
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
        if limb.joint in found:
            turn = Rotation.from_rotvec(np.eye(3)[limb.axis] * limb.sign * np.radians(angles[name]))
            found[limb.joint] = found[limb.joint] * turn
    return np.stack([found[name].as_rotvec() for name in joint_names])
