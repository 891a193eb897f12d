"""A motion of one person for the figure of another: rotations as they are, the way scaled with the legs, and
feet that stand kept where they stand.

Longer legs make longer steps, so the pelvis' way is scaled by the ratio of the legs' lengths. What then is
left of a standing foot's slide comes from other proportions, and the legs take it out, after Kovar, Schreiner
and Gleicher, "Footskate Cleanup for Motion Capture Editing" (2002). Unlike there, a foot may roll from its
heel over its ball while it stands: what keeps its place is at any time the lowest part of the sole. Letters:
T frames.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float64
from scipy.spatial.transform import Rotation

from avatargen.motion.figure import Figure
from avatargen.motion.gait import measure_foot
from avatargen.motion.legs import STRAIGHTEST, X, leg_length
from avatargen.motion.motion import Motion, continuous
from avatargen.motion.standing import smooth

SIDES, JOINTS = ("left", "right"), ("hip", "knee", "ankle")
NEEDED = {"pelvis", *(f"{side}_{joint}" for side in SIDES for joint in (*JOINTS, "foot"))}
FASTEST = 0.4  # m/s that the sole of a standing foot may slide
HIGHEST = 0.05  # metres that it may be above the ground
SHORTEST = 0.1  # seconds that a foot stands at least, and is lifted at least between
FARTHEST = 0.15  # of the leg's length: a standing foot that slides farther is meant to
GROUND = 10  # per cent of the frames in which the lower sole may be below the ground
LEVEL = 0.01  # metres between heel and ball, from which on only the lower one of them stands


@dataclass(frozen=True, kw_only=True)
class Leg:
    """One leg of a figure in a motion: world rotations, and where its joints are, metres."""

    pelvis: Rotation
    thigh: Rotation
    shin: Rotation
    foot: Rotation
    hip: Float64[np.ndarray, "T 3"]
    knee: Float64[np.ndarray, "T 3"]
    ankle: Float64[np.ndarray, "T 3"]


def retarget(motion: Motion, figure: Figure) -> Motion:
    """The motion as the figure's own; one that is its own already comes back as it is.

    Where the motion or the figure lacks a joint of the legs, the way stays as it is and feet may slide.
    """
    if motion.leg is None:
        return motion
    if not set(motion.joint_names) & set(figure.joint_names) >= NEEDED:
        return replace(motion, leg=None)
    length = sum(leg_length(figure, side) for side in SIDES) / 2
    scaled = replace(motion, translation=motion.translation * (length / motion.leg), leg=None)
    return keep_feet(scaled, figure)


def keep_feet(motion: Motion, figure: Figure) -> Motion:
    """The motion with its legs bent and turned so that feet which stand do not slide over the ground."""
    legs = {side: pose_leg(motion, figure, side) for side in SIDES}
    soles = {side: sole(figure, side, leg) for side, leg in legs.items()}
    lower = np.min([points[..., 1] for points in soles.values()], axis=(0, 1))
    ground = float(np.percentile(lower, GROUND))
    rotations = motion.rotations.copy()
    for side, leg in legs.items():
        farthest = FARTHEST * leg_length(figure, side)
        thigh, shin = reach(leg, leg.ankle + against_slide(soles[side], motion.times, ground, farthest))
        turned = {
            "hip": leg.pelvis.inv() * thigh,
            "knee": thigh.inv() * shin,
            "ankle": shin.inv() * leg.foot,
        }
        for joint, rotation in turned.items():
            rotations[:, motion.joint_names.index(f"{side}_{joint}")] = rotation.as_quat()
    return replace(motion, rotations=continuous(rotations))


def pose_leg(motion: Motion, figure: Figure, side: str) -> Leg:
    """Where the figure's leg is in the motion."""
    pelvis, *turns = (
        Rotation.from_quat(motion.rotations[:, motion.joint_names.index(name)])
        for name in ("pelvis", *(f"{side}_{joint}" for joint in JOINTS))
    )
    thigh = pelvis * turns[0]
    shin = thigh * turns[1]
    root, (hip, knee, ankle) = figure["pelvis"], (figure[f"{side}_{joint}"] for joint in JOINTS)
    hips = root + motion.translation + pelvis.apply(hip - root)
    knees = hips + thigh.apply(knee - hip)
    return Leg(
        pelvis=pelvis,
        thigh=thigh,
        shin=shin,
        foot=shin * turns[2],
        hip=hips,
        knee=knees,
        ankle=knees + shin.apply(ankle - knee),
    )


def sole(figure: Figure, side: str, leg: Leg) -> Float64[np.ndarray, "2 T 3"]:
    """The ways of the heel's edge and of the ball, metres: its joint, about which the foot rolls over toes
    that stay, as far down as it is above the ground in a standing foot.
    """
    foot = measure_foot(figure, side)
    points = [leg.ankle + leg.foot.apply(point) for point in (foot.heel, foot.ball)]
    points[1][:, 1] -= foot.ball[1] - foot.heel[1]
    return np.stack(points)


def against_slide(
    points: Float64[np.ndarray, "2 T 3"], times: Float64[np.ndarray, " T"], ground: float, farthest: float
) -> Float64[np.ndarray, "T 3"]:
    """What has to be added to a foot's way, level, so that its sole stands still while it is on the ground.

    While a foot stands, it is what the sole slides, the other way, and nothing in the mean; between, it goes
    from one to the other.
    """
    higher = points[..., 1] - points[..., 1].min(axis=0)
    share = np.maximum(1 - higher / LEVEL, 0)
    share = share / share.sum(axis=0)
    step_share = (share[:, 1:] + share[:, :-1]) / 2
    slide = np.einsum("pt,pti->ti", step_share, np.diff(points, axis=1)) * [1.0, 0.0, 1.0]
    low = points[..., 1].min(axis=0) < ground + HIGHEST
    slow = np.linalg.norm(slide, axis=1) < FASTEST * np.diff(times)
    added = np.full(points.shape[1:], np.nan)
    for first, last in stands(slow & low[1:] & low[:-1], times):
        way = np.concatenate([np.zeros((1, 3)), -np.cumsum(slide[first:last], axis=0)])
        way = way - way.mean(axis=0)
        if np.linalg.norm(way, axis=1).max() <= farthest:
            added[first : last + 1] = way
    return filled(added, times)


def stands(still: Bool[np.ndarray, " steps"], times: Float64[np.ndarray, " T"]) -> Iterator[tuple[int, int]]:
    """First and last frame of each time a foot stands; `still` is of the steps from frame to frame."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], still, [False]]).astype(int)))
    runs = edges.reshape(-1, 2).tolist()
    joined: list[list[int]] = []
    for first, last in runs:
        if joined and times[first] - times[joined[-1][1]] < SHORTEST:
            joined[-1][1] = last
        else:
            joined.append([first, last])
    for first, last in joined:
        if times[last] - times[first] >= SHORTEST:
            yield first, last


def filled(
    values: Float64[np.ndarray, "T 3"], times: Float64[np.ndarray, " T"]
) -> Float64[np.ndarray, "T 3"]:
    """Rows of NaN filled: smoothly from the row before to the one behind, at the ends by the nearest."""
    known = np.flatnonzero(~np.isnan(values[:, 0]))
    if len(known) == 0:
        return np.zeros_like(values)
    frames = np.arange(len(values))
    behind = known[np.minimum(np.searchsorted(known, frames), len(known) - 1)]
    before = known[np.maximum(np.searchsorted(known, frames, side="right") - 1, 0)]
    gap = times[behind] - times[before]
    share = smooth(np.where(gap > 0, (times - times[before]) / np.where(gap > 0, gap, 1), 0.0))[:, None]
    return (1 - share) * values[before] + share * values[behind]


def reach(leg: Leg, goal: Float64[np.ndarray, "T 3"]) -> tuple[Rotation, Rotation]:
    """World rotations of thigh and shin that bring the ankle to its goal: the knee bends about the thigh's
    own x axis, then the whole leg swings about the hip by the least turn. A goal out of reach is approached.
    """
    thigh, shin, axis = leg.knee - leg.hip, leg.ankle - leg.knee, leg.thigh.apply(X)
    bend = further_bend(thigh, shin, axis, np.linalg.norm(goal - leg.hip, axis=1))
    knee = Rotation.from_rotvec(axis * bend[:, None])
    swing = least_turn(thigh + knee.apply(shin), goal - leg.hip)
    return swing * leg.thigh, swing * knee * leg.shin


def further_bend(
    thigh: Float64[np.ndarray, "T 3"],
    shin: Float64[np.ndarray, "T 3"],
    axis: Float64[np.ndarray, "T 3"],
    wanted: Float64[np.ndarray, " T"],
) -> Float64[np.ndarray, " T"]:
    """The least angle by which the shin turns about the axis so that hip and ankle are `wanted` metres apart.

    |thigh + turned shin|^2 = wanted^2 has the form C cos(angle) + S sin(angle) = K.
    """
    along = dot(thigh, axis) * dot(shin, axis)
    C, S = dot(thigh, shin) - along, dot(thigh, np.cross(axis, shin))
    squares = dot(thigh, thigh), dot(shin, shin)
    straightest = STRAIGHTEST * (np.sqrt(squares[0]) + np.sqrt(squares[1]))
    wanted = np.minimum(wanted, np.maximum(straightest, np.linalg.norm(thigh + shin, axis=1)))
    K = (wanted**2 - squares[0] - squares[1]) / 2 - along
    middle = np.arctan2(S, C)
    away = np.arccos(np.clip(K / np.maximum(np.hypot(C, S), 1e-12), -1, 1))
    both = np.stack([middle + away, middle - away])
    both = (both + np.pi) % (2 * np.pi) - np.pi
    return np.where(np.abs(both[0]) < np.abs(both[1]), both[0], both[1])


def least_turn(start: Float64[np.ndarray, "T 3"], end: Float64[np.ndarray, "T 3"]) -> Rotation:
    """The rotation by the smallest angle from one direction to the other."""
    across = np.cross(start, end)
    sine = np.linalg.norm(across, axis=1)
    angle = np.arctan2(sine, dot(start, end))
    return Rotation.from_rotvec(across * (angle / np.maximum(sine, 1e-12))[:, None])


def dot(one: Float64[np.ndarray, "T 3"], other: Float64[np.ndarray, "T 3"]) -> Float64[np.ndarray, " T"]:
    return np.einsum("ti,ti->t", one, other)
