"""Another person's motion: the way follows the legs, standing feet stay, what is one's own is not touched."""

import functools
from dataclasses import replace

import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation

from avatargen.avatar import shipped
from avatargen.body.load import load_body
from avatargen.body.model import forward_kinematics, shape
from avatargen.motion import gait
from avatargen.motion.clips import make_clip
from avatargen.motion.figure import Figure
from avatargen.motion.legs import leg_length
from avatargen.motion.motion import Motion
from avatargen.motion.retarget import retarget
from avatargen.wardrobe.stature import Sizing

SIDES = ("left", "right")


@functools.cache
def person(metres: float = 1.74, thigh: float = 1.0, shin: float = 1.0) -> Figure:
    """The shipped body in the T-pose, that tall as its shapes are, with longer or shorter legs."""
    body = load_body(shipped("body.npz"))
    betas = Sizing(body).sized(torch.zeros(1, body.shapedirs.shape[2]), torch.tensor([[metres]]))
    shaped = shape(body, betas[0].numpy())
    joints, names = shaped.joints.copy(), body.joint_names
    lowered = 0.0
    for side in SIDES:
        places = [names.index(f"{side}_{joint}") for joint in ("hip", "knee", "ankle", "foot")]
        hip, knee, ankle, foot = joints[places]
        knee_there = hip + thigh * (knee - hip)
        ankle_there = knee_there + shin * (ankle - knee)
        joints[places[1:]] = knee_there, ankle_there, ankle_there + foot - ankle
        lowered = ankle_there[1] - ankle[1]
    ground = float(shaped.vertices[:, 1].min()) + lowered
    return Figure(joint_names=names, joints=joints, ground=ground)


def posed(figure: Figure, motion: Motion) -> np.ndarray:
    """World <- joint [T J 4 4] by the body model's own forward kinematics."""
    parents = load_body(shipped("body.npz")).parents
    frames = []
    for turned, way in zip(motion.rotations, motion.translation, strict=True):
        turns = np.tile(np.eye(3), (len(figure.joints), 1, 1))
        for name, quaternion in zip(motion.joint_names, turned, strict=True):
            turns[figure.joint_names.index(name)] = Rotation.from_quat(quaternion).as_matrix()
        frame = forward_kinematics(figure.joints, turns, parents)
        frame[:, :3, 3] += way
        frames.append(frame)
    return np.array(frames)


def walk_of(figure: Figure, cycles: int = 2, fps: float = 60.0) -> Motion:
    """Some cycles of the built-in walk, which does not slide, as a file of that person would hold it."""
    one = make_clip("walk", figure, fps=fps)
    frames = len(one.times) - 1
    step = one.translation[-1] - one.translation[0]
    rotations = np.concatenate([one.rotations[:frames]] * cycles)
    translation = np.concatenate([one.translation[:frames] + k * step for k in range(cycles)])
    leg = sum(leg_length(figure, side) for side in SIDES) / 2
    times = np.arange(frames * cycles) / fps
    return replace(one, times=times, rotations=rotations, translation=translation, leg=leg)


def slides(figure: Figure, motion: Motion) -> np.ndarray:
    """Level speeds, m/s, of the part of the sole that the walk has on the ground, in all steps it stands."""
    frames, speeds = posed(figure, motion), []
    seconds = np.diff(motion.times)
    for side, shift in (("left", 0.0), ("right", 0.5)):
        phase = (motion.times / gait.SECONDS + shift) % 1
        foot = gait.measure_foot(figure, side)
        ankle = frames[:, figure.joint_names.index(f"{side}_ankle")]
        for point, (begin, end) in (
            (foot.heel, (0.0, gait.FLAT[0])),
            (foot.ball, (gait.FLAT[0], gait.STANCE)),
        ):
            place = np.einsum("tij,j->ti", ankle[:, :3, :3], point) + ankle[:, :3, 3]
            speed = np.linalg.norm(np.diff(place, axis=0)[:, [0, 2]], axis=1) / seconds
            speeds.append(speed[(phase[:-1] >= begin) & (phase[1:] <= end) & (phase[1:] > phase[:-1])])
    return np.concatenate(speeds)


def turned(one: Motion, other: Motion) -> float:
    """The largest angle, radians, between two motions' rotations."""
    first, second = (Rotation.from_quat(each.rotations.reshape(-1, 4)) for each in (one, other))
    return float((first.inv() * second).magnitude().max())


FIGURES = {
    "tall": (2.16, 1.0, 1.0),
    "small": (1.45, 1.0, 1.0),
    "long thighs": (1.74, 1.2, 0.9),
    "long shins": (1.74, 0.9, 1.2),
}


@pytest.mark.parametrize("name", FIGURES)
def test_the_feet_of_another_figure_stand_still(name: str) -> None:
    """As they are they slide by a decimetre a second and more; scaled, by some centimetres; kept, by
    millimetres: while the weight goes from one part of the sole to another."""
    figure, walk = person(*FIGURES[name]), walk_of(person())
    assert walk.leg is not None
    ratio = sum(leg_length(figure, side) for side in SIDES) / 2 / walk.leg
    scaled = replace(walk, translation=walk.translation * ratio, leg=None)
    kept = retarget(walk, figure)
    assert slides(figure, replace(walk, leg=None)).mean() > 0.09
    assert slides(figure, scaled).mean() > 0.025
    assert slides(figure, kept).mean() < 0.003
    assert slides(figure, kept).max() < 0.03
    np.testing.assert_array_equal(kept.translation, scaled.translation)
    assert turned(kept, scaled) < 0.12
    others = [i for i, joint in enumerate(walk.joint_names) if not joint.endswith(("hip", "knee", "ankle"))]
    np.testing.assert_allclose(kept.rotations[:, others], scaled.rotations[:, others], atol=1e-12)
    speeds = np.linalg.norm(np.diff(posed(figure, kept)[:, :, :3, 3], axis=0), axis=2) * 60
    before = np.linalg.norm(np.diff(posed(figure, scaled)[:, :, :3, 3], axis=0), axis=2) * 60
    assert np.abs(speeds - before).max() < 0.8  # no joint jumps where a foot begins or ends to stand


def test_ones_own_motion_is_not_touched() -> None:
    walk = walk_of(person())
    own = replace(walk, leg=None)
    assert retarget(own, person(2.16)) is own
    again = retarget(walk, person())
    assert again.leg is None
    np.testing.assert_allclose(again.translation, walk.translation, rtol=1e-12)
    assert turned(again, walk) < 0.003


def test_the_way_follows_the_legs_whatever_the_feet_do() -> None:
    """Feet that hang in the air, run, or slide far over the ground keep their rotations."""
    figure, walk = person(2.16), walk_of(person())
    still = replace(walk, rotations=np.repeat(walk.rotations[:1], len(walk.times), axis=0))
    up = walk.times > walk.times[-1] / 4
    flight = np.stack([np.where(up, 0.1, 2.0) * walk.times, 2.0 * up, 0 * walk.times], axis=1)
    for way in (flight, walk.times[:, None] * [0.0, 0.0, 0.3], walk.times[:, None] * [2.0, 0.0, 0.0]):
        motion = replace(still, translation=way)
        made = retarget(motion, figure)
        ratio = sum(leg_length(figure, side) for side in SIDES) / 2 / (motion.leg or 1)
        np.testing.assert_allclose(made.translation, way * ratio, rtol=1e-12)
        assert turned(made, motion) < 1e-6


def test_what_lacks_legs_keeps_its_way() -> None:
    walk, figure = walk_of(person()), person(2.16)
    kept = [i for i, name in enumerate(walk.joint_names) if name != "left_knee"]
    names = tuple(walk.joint_names[i] for i in kept)
    lame = replace(walk, joint_names=names, rotations=walk.rotations[:, kept])
    made = retarget(lame, figure)
    assert made.leg is None
    np.testing.assert_array_equal(made.translation, walk.translation)
    np.testing.assert_array_equal(made.rotations, lame.rotations)
    one = replace(walk, times=walk.times[:1], rotations=walk.rotations[:1], translation=walk.translation[:1])
    assert turned(retarget(one, figure), one) < 1e-6
