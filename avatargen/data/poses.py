"""A prior of everyday poses: standing, walking, arms anywhere between hanging and raised, some sitting back.

A pose is [J 3] axis-angle in radians as in `avatargen.body.pose`: zeros are the T-pose, y up, facing +z. For
the left side a negative turn about z lowers the arm, a negative one about x brings the leg forward, a
negative one about y bends the elbow; right sides are mirrored.
"""

import numpy as np
from jaxtyping import Float32

MIRRORED = np.array([1.0, -1.0, -1.0])  # a turn seen in the plane x = 0
SPREAD = {  # standard deviations about x, y, z of what nothing else below decides, radians
    "spine1": (0.08, 0.08, 0.05),
    "spine2": (0.05, 0.08, 0.04),
    "spine3": (0.05, 0.08, 0.04),
    "neck": (0.10, 0.15, 0.06),
    "head": (0.12, 0.20, 0.08),
    "left_wrist": (0.20, 0.20, 0.20),
    "right_wrist": (0.20, 0.20, 0.20),
    "left_ankle": (0.12, 0.10, 0.05),
    "right_ankle": (0.12, 0.10, 0.05),
}


def random_pose(joint_names: tuple[str, ...], rng: np.random.Generator) -> Float32[np.ndarray, "J 3"]:
    """One pose; joints that the skeleton does not have are skipped. The root stands upright, facing +z."""
    turns = {name: rng.normal(0, spread) for name, spread in SPREAD.items()}
    turns |= legs(rng)
    for side in ("left", "right"):
        turns |= arm(side, rng)
    pose = np.zeros((len(joint_names), 3), dtype=np.float32)
    for name, turn in turns.items():
        if name in joint_names:
            pose[joint_names.index(name)] = turn
    return pose


def legs(rng: np.random.Generator) -> dict[str, np.ndarray]:
    """Half of the people stand, half walk: opposite hips, and the knee behind bends more."""
    stride = rng.uniform(0.1, 0.6) * (rng.random() < 0.5)
    phase = rng.uniform(0, 2 * np.pi)
    turns = {}
    for side, swing in (("left", np.sin(phase)), ("right", -np.sin(phase))):
        mirror = 1.0 if side == "left" else MIRRORED
        hip = np.array([stride * swing, 0, 0.07]) + rng.normal(0, (0.08, 0.12, 0.05))
        bend = abs(rng.normal(0, 0.08)) + stride * max(0.0, swing) + 0.25 * stride
        turns[f"{side}_hip"] = hip * mirror
        turns[f"{side}_knee"] = np.array([bend, 0, 0])
    return turns


def arm(side: str, rng: np.random.Generator) -> dict[str, np.ndarray]:
    """Hanging in two cases of three, else anywhere up to shoulder height; elbows bend forward."""
    lowered = rng.normal(-1.15, 0.15) if rng.random() < 2 / 3 else rng.uniform(-1.1, 0.15)
    mirror = 1.0 if side == "left" else MIRRORED
    shoulder = np.array([rng.normal(0, 0.25), rng.normal(0, 0.25), lowered])
    elbow = np.array([0, -abs(rng.normal(0.25, 0.45)), 0])
    return {f"{side}_shoulder": shoulder * mirror, f"{side}_elbow": elbow * mirror}
