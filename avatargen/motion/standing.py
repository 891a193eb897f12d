"""Clips on the spot: idle and wave. Both loop: they end as they begin. Letters: T times."""

import numpy as np
from jaxtyping import Float64
from scipy.spatial.transform import Rotation

from avatargen.motion.figure import Figure
from avatargen.motion.gait import Turns
from avatargen.motion.legs import place_leg, turn_x, turn_y, turn_z

IDLE_SECONDS, WAVE_SECONDS = 4.0, 3.0
FEET = 0.85  # distance of the feet from the middle, in those of the hips
TOES_OUT = 0.14  # radians
LOWERED = 0.008  # metres that the pelvis is below straight legs
SWAY = 0.009  # metres
BREATH = 0.018  # radians that the chest rises
HANGING = 1.25  # radians that the arms hang below the T-pose
RAISED = (0.6, 2.4)  # seconds between which the arm is up
WAVES = 4  # while it is up


def idle(figure: Figure, times: Float64[np.ndarray, " T"]) -> tuple[Turns, Float64[np.ndarray, "T 3"]]:
    """Breathing and shifting the weight a little, on planted feet."""
    return stand(figure, 2 * np.pi * times / IDLE_SECONDS)


def wave(figure: Figure, times: Float64[np.ndarray, " T"]) -> tuple[Turns, Float64[np.ndarray, "T 3"]]:
    """The right arm goes up, waves, and goes down again."""
    turns, place = stand(figure, 2 * np.pi * times / WAVE_SECONDS)
    begin, end = RAISED
    up = smooth(times / begin) * smooth((WAVE_SECONDS - times) / (WAVE_SECONDS - end))
    swing = np.sin(2 * np.pi * WAVES * (times - begin) / (end - begin)) * up
    full = np.ones(len(times))
    raised = {
        "right_collar": turn_z(-0.12 * full),
        "right_shoulder": turn_z(0.12 * full) @ turn_y(0.45 * full) @ turn_x(-1.35 * full),
        "right_elbow": turn_y(1.6 + 0.38 * swing),
        "right_wrist": turn_y(0.15 * swing),
        "right_hand": turn_z(0 * full),
    }
    for name, goal in raised.items():
        turns[name] = between(turns.get(name, np.tile(np.eye(3), (len(times), 1, 1))), goal, up)
    turns["head"] = turn_z(0.08 * up) @ turn_y(-0.1 * up) @ turns["head"]
    return turns, place


def stand(figure: Figure, angle: Float64[np.ndarray, " T"]) -> tuple[Turns, Float64[np.ndarray, "T 3"]]:
    """Standing at an angle in 0..2 pi of the loop, two breaths long."""
    breath = 0.5 - 0.5 * np.cos(2 * angle)
    place = np.stack(
        [
            SWAY * np.sin(angle),
            np.full(len(angle), standing_height(figure)) - 0.25 * SWAY * np.sin(angle) ** 2,
            0.4 * SWAY * np.sin(2 * angle),
        ],
        axis=1,
    )
    pelvis = turn_z(0.012 * np.sin(angle))
    turns: Turns = {"pelvis": pelvis, **upper_body(breath, np.sin(angle))}
    for side in ("left", "right"):
        ankle, foot = footprint(figure, side)
        steady = np.tile(ankle, (len(angle), 1)), np.tile(foot, (len(angle), 1, 1))
        turns |= place_leg(figure, side, pelvis, figure["pelvis"] + place, *steady)
    return turns, place


def footprint(figure: Figure, side: str) -> tuple[Float64[np.ndarray, "3"], Float64[np.ndarray, "3 3"]]:
    """Where a standing ankle is, and the turn of its foot."""
    hip, ankle = figure[f"{side}_hip"], figure[f"{side}_ankle"]
    outward = turn_y(np.array([np.sign(hip[0]) * TOES_OUT]))[0]
    return np.array([FEET * hip[0], ankle[1], ankle[2]]), outward


def standing_height(figure: Figure) -> float:
    """How far the pelvis is above its place in the T-pose, metres: legs all but straight."""
    heights = []
    for side in ("left", "right"):
        hip, ankle = figure[f"{side}_hip"], footprint(figure, side)[0]
        straight = figure[f"{side}_ankle"] - hip
        away = np.hypot(ankle[0] - hip[0], ankle[2] - hip[2])
        heights.append(ankle[1] + np.sqrt(max(straight @ straight - away**2, 0.0)) - hip[1])
    return float(min(heights)) - LOWERED


def upper_body(breath: Float64[np.ndarray, " T"], sway: Float64[np.ndarray, " T"]) -> Turns:
    """Chest, head and hanging arms of somebody who breathes; `sway` is in -1..1."""
    steady = np.ones(len(breath))
    turns: Turns = {
        "spine1": turn_z(-0.008 * sway),
        "spine2": turn_x(-0.5 * BREATH * breath),
        "spine3": turn_x(-BREATH * breath),
        "neck": turn_x(0.5 * BREATH * breath),
        "head": turn_y(0.05 * sway) @ turn_x(BREATH * breath),
    }
    for side, sign in (("left", 1.0), ("right", -1.0)):
        turns[f"{side}_collar"] = turn_z(sign * (0.02 * breath - 0.03))
        hanging = turn_z(-sign * (HANGING * steady - 0.03 * breath))
        turns[f"{side}_shoulder"] = turn_x(-0.06 * steady) @ hanging
        turns[f"{side}_elbow"] = turn_y(-sign * (0.22 * steady + 0.03 * breath))
        turns[f"{side}_hand"] = turn_z(-0.2 * sign * steady)
    return turns


def smooth(share: Float64[np.ndarray, " T"]) -> Float64[np.ndarray, " T"]:
    """0 before 0, 1 after 1, and no jerk between."""
    share = np.clip(share, 0, 1)
    return share**3 * (10 - 15 * share + 6 * share**2)


def between(
    start: Float64[np.ndarray, "T 3 3"], end: Float64[np.ndarray, "T 3 3"], share: Float64[np.ndarray, " T"]
) -> Float64[np.ndarray, "T 3 3"]:
    """A share of the way from one rotation to the other."""
    first = Rotation.from_matrix(start)
    whole = (first.inv() * Rotation.from_matrix(end)).as_rotvec()
    return (first * Rotation.from_rotvec(whole * share[:, None])).as_matrix()
