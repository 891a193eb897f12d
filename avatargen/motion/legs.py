"""Legs that stand where they are told: hip, knee and ankle rotations from a place and a turn of the foot.

In closed form: the knee's angle follows from the distance between hip and ankle, the hip then swings the bent
leg onto the line between them, with the knee in the plane that the pelvis faces. Letters: T frames.
`turn_x(angle)` > 0 bends the knee, lowers the toes and swings a hanging limb back.
"""

import numpy as np
from jaxtyping import Float, Float64

from avatargen.motion.figure import Figure

X = np.array([1.0, 0.0, 0.0])
STRAIGHTEST = 0.9995  # share of the leg's length that it may reach: a straight knee has no plane to bend in


def turn_x(angle: Float[np.ndarray, " T"]) -> Float64[np.ndarray, "T 3 3"]:
    """Rotations about x, radians."""
    return turn(angle, 0)


def turn_y(angle: Float[np.ndarray, " T"]) -> Float64[np.ndarray, "T 3 3"]:
    """Rotations about y, radians."""
    return turn(angle, 1)


def turn_z(angle: Float[np.ndarray, " T"]) -> Float64[np.ndarray, "T 3 3"]:
    """Rotations about z, radians."""
    return turn(angle, 2)


def turn(angle: Float[np.ndarray, " T"], axis: int) -> Float64[np.ndarray, "T 3 3"]:
    """Rotations about one of the world's axes."""
    second, third = (axis + 1) % 3, (axis + 2) % 3
    matrices = np.tile(np.eye(3), (len(angle), 1, 1))
    cosine, sine = np.cos(angle), np.sin(angle)
    matrices[:, second, second], matrices[:, third, third] = cosine, cosine
    matrices[:, second, third], matrices[:, third, second] = -sine, sine
    return matrices


def leg_length(figure: Figure, side: str) -> float:
    """Hip to knee to ankle, metres."""
    hip, knee, ankle = (figure[f"{side}_{joint}"] for joint in ("hip", "knee", "ankle"))
    return float(np.linalg.norm(knee - hip) + np.linalg.norm(ankle - knee))


def place_leg(
    figure: Figure,
    side: str,
    pelvis: Float64[np.ndarray, "T 3 3"],
    place: Float64[np.ndarray, "T 3"],
    ankle: Float64[np.ndarray, "T 3"],
    foot: Float64[np.ndarray, "T 3 3"],
) -> dict[str, Float64[np.ndarray, "T 3 3"]]:
    """Rotations of hip, knee and ankle that bring the ankle there with the foot turned so.

    `pelvis` and `place` are the pelvis' rotation and where its joint is, `foot` the foot's rotation, all in
    world axes. An ankle out of reach is approached as far as the leg is long.
    """
    thigh = figure[f"{side}_knee"] - figure[f"{side}_hip"]
    shin = figure[f"{side}_ankle"] - figure[f"{side}_knee"]
    hip = place + pelvis @ (figure[f"{side}_hip"] - figure["pelvis"])
    bend = knee_bend(thigh, shin, np.linalg.norm(ankle - hip, axis=1))
    bent = thigh + turn_x(bend) @ shin
    aim = frame(ankle - hip, pelvis @ X) @ frame(bent, np.broadcast_to(X, bent.shape)).transpose(0, 2, 1)
    below = aim @ turn_x(bend)
    return {
        f"{side}_hip": pelvis.transpose(0, 2, 1) @ aim,
        f"{side}_knee": turn_x(bend),
        f"{side}_ankle": below.transpose(0, 2, 1) @ foot,
    }


def knee_bend(
    thigh: Float64[np.ndarray, "3"], shin: Float64[np.ndarray, "3"], reach: Float64[np.ndarray, " T"]
) -> Float64[np.ndarray, " T"]:
    """The knee's angle >= 0 about x at which hip and ankle are `reach` metres apart.

    |thigh + turn_x(angle) shin|^2 = reach^2 has the form C cos(angle) + S sin(angle) = K.
    """
    C = thigh[1] * shin[1] + thigh[2] * shin[2]
    S = thigh[2] * shin[1] - thigh[1] * shin[2]
    longest = np.linalg.norm(thigh) + np.linalg.norm(shin)
    reach = np.minimum(reach, STRAIGHTEST * longest)
    K = (reach**2 - thigh @ thigh - shin @ shin) / 2 - thigh[0] * shin[0]
    return np.arctan2(S, C) + np.arccos(np.clip(K / max(np.hypot(C, S), 1e-12), -1, 1))


def frame(
    along: Float64[np.ndarray, "T 3"], beside: Float64[np.ndarray, "T 3"]
) -> Float64[np.ndarray, "T 3 3"]:
    """Right-handed axes in columns: along the first, the second as near to `beside` as can be."""
    first = along / np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-12)
    second = beside - np.einsum("ti,ti->t", beside, first)[:, None] * first
    second = second / np.maximum(np.linalg.norm(second, axis=1, keepdims=True), 1e-12)
    return np.stack([first, second, np.cross(first, second)], axis=2)
