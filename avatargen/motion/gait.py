"""The walk: one cycle of two steps, forward along z, on feet that roll and do not slide.

Everything is a function of the phase u in 0..1 of a foot, which lands on its heel at u = 0, rolls flat, lifts
its heel over the ball and leaves the ground at u = STANCE. The feet are led first and the legs follow (see
`legs`), so a body of any proportions walks with planted feet. Letters: T times.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64
from scipy.interpolate import PchipInterpolator

from avatargen.motion.figure import Figure
from avatargen.motion.legs import leg_length, place_leg, turn_x, turn_y, turn_z

SECONDS = 32 / 30  # of the cycle: whole frames at 30 a second
STRIDE = 1.26  # of two steps, in leg lengths
STANCE = 0.62  # phase at which a foot leaves the ground
FLAT = (0.1, 0.38)  # phases between which the whole sole is on the ground
TOES_STRAIGHT = 0.86  # phase at which the toes are straight again
PITCH = PchipInterpolator(  # radians that the foot points down, over the phase
    [0.0, *FLAT, 0.5, 0.56, STANCE, 0.7, 0.87, 1.0], [-0.28, 0.0, 0.0, 0.16, 0.42, 0.85, 0.72, -0.05, -0.28]
)
HEEL_BEHIND = 0.35  # of the way from ankle to ball: how far the edge of the heel is behind the ankle
AHEAD = 0.275  # of the stride, that the ankle lands before the hip
NARROW = 0.75  # distance of the feet from the middle, in those of the hips
TOES_OUT = 0.10  # radians
CLEARANCE = 0.04  # metres that the swinging foot is lifted on top of what its roll needs
STRETCH = 0.994  # of the leg's length, that a step may reach
SWAY, BOB = 0.02, 0.02  # metres that the pelvis moves sideways and up
MIDDLE = 0.29  # phase at which a foot is under the body
YAW, DROP = 0.09, 0.045  # radians that the pelvis turns and drops on the swinging side
SWING, LIFT = 0.36, 1.27  # radians: how far the arms swing, and how far they hang below the T-pose
ELBOW = (0.35, 0.2)  # radians that it is bent, and that the swing bends it more

Turns = dict[str, Float64[np.ndarray, "T 3 3"]]


@dataclass(frozen=True)
class Foot:
    """One foot's points against its ankle in the T-pose, metres."""

    side: str
    heel: Float64[np.ndarray, "3"]  # the edge it lands on
    ball: Float64[np.ndarray, "3"]  # the joint of the toes
    middle: Float64[np.ndarray, "3"]  # where the ankle is when the foot stands under the body
    outward: float  # radians


def measure_foot(figure: Figure, side: str) -> Foot:
    hip, ankle = figure[f"{side}_hip"], figure[f"{side}_ankle"]
    ball = figure[f"{side}_foot"] - ankle
    height = float(ankle[1] - figure.ground)
    return Foot(
        side=side,
        heel=np.array([0.0, -height, -HEEL_BEHIND * np.hypot(ball[0], ball[2])]),
        ball=np.array([0.0, ball[1], ball[2]]),
        middle=np.array([NARROW * hip[0], ankle[1], hip[2]]),
        outward=float(np.sign(hip[0]) * TOES_OUT),
    )


def stride_length(figure: Figure) -> float:
    """Metres that the figure walks in a cycle."""
    return STRIDE * min(leg_length(figure, "left"), leg_length(figure, "right"))


def walk(figure: Figure, times: Float64[np.ndarray, " T"]) -> tuple[Turns, Float64[np.ndarray, "T 3"]]:
    """Rotations by joint and the pelvis' way from its place in the T-pose, at times in seconds."""
    phase = times / SECONDS
    stride = stride_length(figure)
    pelvis = pelvis_turn(phase)
    place = np.stack(
        [
            SWAY * np.cos(2 * np.pi * (phase - MIDDLE)),
            pelvis_height(figure) + bob(phase),
            stride * phase,
        ],
        axis=1,
    )
    turns: Turns = {"pelvis": pelvis, **trunk(phase), **arms(phase)}
    forward = stride * phase[:, None] * [0.0, 0.0, 1.0]
    for side, own_phase in (("left", phase % 1), ("right", (phase + 0.5) % 1)):
        foot = measure_foot(figure, side)
        ankle = ankle_path(foot, own_phase, stride) + forward
        turned = foot_turn(foot, PITCH(own_phase))
        turns |= place_leg(figure, side, pelvis, figure["pelvis"] + place, ankle, turned)
        turns[f"{side}_foot"] = turn_x(-PITCH(own_phase) * toes_bent(own_phase))
    return turns, place


def foot_turn(foot: Foot, pitch: Float64[np.ndarray, " T"]) -> Float64[np.ndarray, "T 3 3"]:
    return turn_y(np.full(len(pitch), foot.outward)) @ turn_x(pitch)


def toes_bent(phase: Float64[np.ndarray, " T"]) -> Float64[np.ndarray, " T"]:
    """Share of the foot's pitch that the toes undo: all of it while the ball is on the ground."""
    fading = np.clip((TOES_STRAIGHT - phase) / (TOES_STRAIGHT - STANCE), 0, 1)
    return np.where(phase > FLAT[0], fading * fading * (3 - 2 * fading), 0.0)


def ankle_path(foot: Foot, phase: Float64[np.ndarray, " T"], stride: float) -> Float64[np.ndarray, "T 3"]:
    """The ankle's place in the frame that walks on with the body: planted, then swung forward."""
    share = np.clip((phase - STANCE) / (1 - STANCE), 0, 1)[:, None]  # of the swing
    ends = np.array([STANCE, STANCE - 1e-4, 0.0, 1e-4])
    leave, before, land, after = planted(foot, ends, stride)
    slope_leave, slope_land = ((leave - before), (after - land)) * np.array((1 - STANCE) / 1e-4)
    swung = (
        (1 + 2 * share) * (1 - share) ** 2 * leave
        + share * (1 - share) ** 2 * slope_leave
        + share**2 * (3 - 2 * share) * land
        - share**2 * (1 - share) * slope_land
    )
    swung[:, 1] += CLEARANCE * np.sin(np.pi * share[:, 0]) ** 2
    return np.where(phase[:, None] <= STANCE, planted(foot, phase, stride), swung)


def planted(foot: Foot, phase: Float64[np.ndarray, " T"], stride: float) -> Float64[np.ndarray, "T 3"]:
    """The ankle over a foot that rolls about its heel's edge, stands, and rolls about its ball."""
    level = foot.middle + stride * (AHEAD - phase)[:, None] * [0.0, 0.0, 1.0]
    pivot = np.where((phase < FLAT[0])[:, None], foot.heel, foot.ball)
    outward = foot_turn(foot, np.zeros(len(phase)))
    turned = np.einsum("tij,tj->ti", foot_turn(foot, PITCH(phase)), pivot)
    return level + np.einsum("tij,tj->ti", outward, pivot) - turned


def bob(phase: Float64[np.ndarray, " T"]) -> Float64[np.ndarray, " T"]:
    """Up over each standing foot, down between."""
    return BOB * np.cos(4 * np.pi * (phase - MIDDLE))


def pelvis_height(figure: Figure) -> float:
    """How far the pelvis is above its place in the T-pose, metres: as high as the longest step lets it be."""
    phase = np.arange(64) / 64
    pelvis, stride = pelvis_turn(phase), stride_length(figure)
    heights = []
    for side, own_phase in (("left", phase), ("right", (phase + 0.5) % 1)):
        hip = figure["pelvis"] + pelvis @ (figure[f"{side}_hip"] - figure["pelvis"])
        hip[:, 0] += SWAY * np.cos(2 * np.pi * (phase - MIDDLE))
        hip[:, 1] += bob(phase)
        away = ankle_path(measure_foot(figure, side), own_phase, stride) - hip
        reach = STRETCH * leg_length(figure, side)
        heights.append(away[:, 1] + np.sqrt(np.maximum(reach**2 - away[:, 0] ** 2 - away[:, 2] ** 2, 0)))
    return float(np.min(heights))


def pelvis_turn(phase: Float64[np.ndarray, " T"]) -> Float64[np.ndarray, "T 3 3"]:
    """The hip of the leg that reaches forward goes with it; that of the swinging leg drops."""
    around = turn_y(-YAW * np.cos(2 * np.pi * phase))
    return around @ turn_z(DROP * np.cos(2 * np.pi * (phase - MIDDLE))) @ turn_x(np.full(len(phase), 0.03))


def trunk(phase: Float64[np.ndarray, " T"]) -> Turns:
    """The spine turns the shoulders against the hips and keeps them level; the head looks ahead."""
    yaw, drop = YAW * np.cos(2 * np.pi * phase), DROP * np.cos(2 * np.pi * (phase - MIDDLE))
    level = turn_y(2 * yaw / 3) @ turn_z(-0.9 * drop / 3)
    turns: Turns = {"spine1": level, "spine2": level, "spine3": level}
    turns["neck"] = turn_y(-0.5 * yaw)
    turns["head"] = turn_y(-0.5 * yaw) @ turn_x(np.full(len(phase), -0.03))
    return turns


def arms(phase: Float64[np.ndarray, " T"]) -> Turns:
    """Hanging arms that swing against the legs, bent a little more in front."""
    turns: Turns = {}
    for side, sign, forward in (
        ("left", 1.0, -np.cos(2 * np.pi * phase)),
        ("right", -1.0, np.cos(2 * np.pi * phase)),
    ):
        hang = np.full(len(phase), -sign * LIFT)
        turns[f"{side}_shoulder"] = turn_x(-SWING * (forward - 0.1)) @ turn_z(hang)
        turns[f"{side}_elbow"] = turn_y(-sign * (ELBOW[0] + ELBOW[1] * forward))
        turns[f"{side}_hand"] = turn_z(np.full(len(phase), -0.2 * sign))
    return turns
