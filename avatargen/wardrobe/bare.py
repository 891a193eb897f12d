"""Underwear, drawn on every bare body. sRGB 0..1, metres."""

import numpy as np
from jaxtyping import Float64

from avatargen.body.model import CanonicalBody
from avatargen.smoothstep import smoothstep

UNDERWEAR = np.array([0.78, 0.77, 0.75])


def band(x: np.ndarray, low: float, high: float) -> np.ndarray:
    """1 from low to high (m), 0 beyond, with edges of two millimetres."""
    return smoothstep(x, low - 0.001, low + 0.001) * (1 - smoothstep(x, high - 0.001, high + 0.001))


def underwear(
    body: CanonicalBody, foot: Float64[np.ndarray, "N 3"], chest_covered: bool
) -> Float64[np.ndarray, " N"]:
    """1 on the parts of the skin that nobody sees."""
    names, joints = body.joint_names, body.joints
    hip, shoulder = (float(joints[names.index(name), 1]) for name in ("left_hip", "left_shoulder"))
    torso = 1 - smoothstep(np.abs(foot[:, 0]), 0.20, 0.205)
    briefs = band(foot[:, 1], hip - 0.12, hip + 0.05)
    top = band(foot[:, 1], shoulder - 0.22, shoulder - 0.09) * float(chest_covered)
    return torso * np.maximum(briefs, top)
