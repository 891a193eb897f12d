"""The built-in clips: legs reach what they are told, feet stay where they stand, joints keep to limits."""

import functools

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from avatargen.avatar import shipped
from avatargen.body.derive import SMPLH_PARENTS
from avatargen.body.load import load_body
from avatargen.body.model import forward_kinematics
from avatargen.errors import InputError
from avatargen.motion import gait
from avatargen.motion.clips import CLIPS, make_clip
from avatargen.motion.figure import Figure
from avatargen.motion.legs import leg_length, place_leg, turn_y
from avatargen.motion.limits import RANGES
from avatargen.motion.motion import Motion, mirrored
from tests.bodies import SMPL_PARENTS, capsule_body
from tests.figures import figure, symmetric_figure

FIGURES = ("default", "capsule")
# degrees that a joint of a calm clip may turn from the T-pose, whatever the axis
LARGEST = {"hip": 50, "knee": 75, "ankle": 40, "foot": 60, "spine": 12, "neck": 10, "head": 12, "collar": 12,
    "pelvis": 12, "shoulder": 130, "elbow": 130, "wrist": 20, "hand": 20,
    "index": 20, "middle": 20, "ring": 20, "pinky": 20}  # fmt: skip

PARENTS = {24: SMPL_PARENTS, 52: np.array(SMPLH_PARENTS)}


@functools.cache
def body_figure(name: str) -> Figure:
    return figure(load_body(shipped("body.npz")) if name == "default" else capsule_body())


def world(figure: Figure, motion: Motion) -> np.ndarray:
    """World <- joint [T J 4 4] by the body model's own forward kinematics."""
    frames = []
    for frame in range(len(motion.times)):
        turns = np.tile(np.eye(3), (len(figure.joints), 1, 1))
        for index, name in enumerate(motion.joint_names):
            turns[figure.joint_names.index(name)] = Rotation.from_quat(
                motion.rotations[frame, index]
            ).as_matrix()
        posed = forward_kinematics(figure.joints, turns, PARENTS[len(turns)])
        posed[:, :3, 3] += motion.translation[frame]
        frames.append(posed)
    return np.array(frames)


@pytest.mark.parametrize("name", FIGURES)
@pytest.mark.parametrize("side", ["left", "right"])
def test_a_leg_brings_the_ankle_where_it_is_told(name: str, side: str) -> None:
    person = body_figure(name)
    rng = np.random.default_rng(0)
    pelvis = Rotation.from_rotvec(rng.uniform(-0.4, 0.4, (50, 3))).as_matrix()
    place = rng.normal(size=(50, 3))
    reach = leg_length(person, side) * rng.uniform(0.6, 0.99, 50)
    down = np.stack([rng.uniform(-0.3, 0.3, 50), np.full(50, -1.0), rng.uniform(-0.6, 0.6, 50)], axis=1)
    hip = person["pelvis"] + place + pelvis @ (person[f"{side}_hip"] - person["pelvis"])
    ankle = hip + reach[:, None] * down / np.linalg.norm(down, axis=1, keepdims=True)
    foot = Rotation.random(50, rng=np.random.default_rng(1)).as_matrix()
    turns = place_leg(person, side, pelvis, person["pelvis"] + place, ankle, foot)

    names = (f"{side}_hip", f"{side}_knee", f"{side}_ankle")
    motion = Motion(
        name="leg",
        joint_names=("pelvis", *names),
        times=np.arange(50.0),
        rotations=np.stack(
            [Rotation.from_matrix(m).as_quat() for m in (pelvis, *(turns[n] for n in names))], axis=1
        ),
        translation=place,
    )
    found = world(person, motion)[:, person.joint_names.index(f"{side}_ankle")]
    np.testing.assert_allclose(found[:, :3, 3], ankle, atol=1e-9)
    np.testing.assert_allclose(found[:, :3, :3], foot, atol=1e-9)
    bend = Rotation.from_matrix(turns[f"{side}_knee"]).as_rotvec()
    assert np.abs(bend[:, 1:]).max() < 1e-12  # a knee is a hinge
    assert bend[:, 0].min() > 0  # that bends backward


def test_a_leg_out_of_reach_stretches_towards_its_goal() -> None:
    person = body_figure("capsule")
    ankle = person["left_hip"] + np.array([[0.0, -5.0, 0.0]])
    still = turn_y(np.zeros(1))
    turns = place_leg(person, "left", still, person["pelvis"][None], ankle, still)
    assert all(np.isfinite(turn).all() for turn in turns.values())
    assert abs(Rotation.from_matrix(turns["left_knee"]).magnitude()[0]) < 0.15


@pytest.mark.parametrize("name", FIGURES)
def test_walking_feet_do_not_slide_or_sink(name: str) -> None:
    """The ankle stands still while the sole is flat, heel and ball while the foot rolls over them."""
    person = body_figure(name)
    motion = make_clip("walk", person, fps=300.0)
    posed = world(person, motion)
    for side, shift in (("left", 0.0), ("right", 0.5)):
        phase = (motion.times / gait.SECONDS + shift) % 1
        foot = gait.measure_foot(person, side)
        ankle = posed[:, person.joint_names.index(f"{side}_ankle")]
        heel = np.einsum("tij,j->ti", ankle[:, :3, :3], foot.heel) + ankle[:, :3, 3]
        ball = np.einsum("tij,j->ti", ankle[:, :3, :3], foot.ball) + ankle[:, :3, 3]
        landing, rising = phase < gait.FLAT[0], (phase > gait.FLAT[1]) & (phase < gait.STANCE)
        flat = (phase >= gait.FLAT[0]) & (phase <= gait.FLAT[1])
        for point, planted in ((heel, landing), (ankle[:, :3, 3], flat), (ball, rising)):
            frames = np.flatnonzero(planted)
            for run in np.split(frames, np.flatnonzero(np.diff(frames) > 1) + 1):
                assert np.ptp(point[run], axis=0).max() < 1e-3, side
        assert np.abs(heel[landing | flat, 1] - person.ground).max() < 1e-3
        assert ball[:, 1].min() > person[f"{side}_foot"][1] - 1e-3
        assert heel[:, 1].min() > person.ground - 1e-3
        assert heel[~landing & ~flat & ~rising, 1].max() > person.ground + 0.05  # it is lifted


@pytest.mark.parametrize("name", FIGURES)
@pytest.mark.parametrize("clip", ["idle", "wave"])
def test_standing_feet_stay(name: str, clip: str) -> None:
    person = body_figure(name)
    posed = world(person, make_clip(clip, person))
    for side in ("left", "right"):
        for joint in ("ankle", "foot"):
            places = posed[:, person.joint_names.index(f"{side}_{joint}"), :3, 3]
            assert np.ptp(places, axis=0).max() < 1e-6
        assert places[0, 1] == pytest.approx(person[f"{side}_foot"][1], abs=1e-6)  # flat on the ground


def test_the_walk_is_the_same_on_both_sides_half_a_cycle_later() -> None:
    person = symmetric_figure()
    motion = make_clip("walk", person, fps=30.0)
    half = (len(motion.times) - 1) // 2
    seen = mirrored(motion)
    along = np.einsum("tjk,tjk->tj", motion.rotations[half:], seen.rotations[: half + 1])
    np.testing.assert_allclose(np.abs(along), 1, atol=1e-9)
    step = [0.0, 0.0, gait.stride_length(person) / 2]
    np.testing.assert_allclose(motion.translation[half:], seen.translation[: half + 1] + step, atol=1e-9)


@pytest.mark.parametrize("clip", CLIPS)
@pytest.mark.parametrize("name", FIGURES)
def test_clips_loop_and_move_smoothly(clip: str, name: str) -> None:
    person = body_figure(name)
    motion = make_clip(clip, person)
    along = np.einsum("jk,jk->j", motion.rotations[0], motion.rotations[-1])
    np.testing.assert_allclose(np.abs(along), 1, atol=1e-9)
    way = motion.translation[-1] - motion.translation[0]
    forward = gait.stride_length(person) if clip == "walk" else 0.0
    np.testing.assert_allclose(way, [0, 0, forward], atol=1e-9)
    along = np.einsum("tjk,tjk->tj", motion.rotations[1:], motion.rotations[:-1])
    steps = 2 * np.degrees(np.arccos(np.clip(along, -1, 1)))
    assert steps.max() < 25  # degrees between frames
    assert np.diff(motion.times).max() == pytest.approx(1 / 30, rel=0.02)


@pytest.mark.parametrize("clip", ["idle", "walk", "wave"])
@pytest.mark.parametrize("name", FIGURES)
def test_calm_clips_stay_within_limits(clip: str, name: str) -> None:
    motion = make_clip(clip, body_figure(name))
    turns = (
        Rotation.from_quat(motion.rotations.reshape(-1, 4)).magnitude().reshape(motion.rotations.shape[:2])
    )
    for joint, most in zip(motion.joint_names, np.degrees(turns.max(axis=0)), strict=True):
        kind = joint.split("_")[-1].rstrip("0123456789")
        assert most <= LARGEST[kind], f"{joint} turns by {most:.0f} degrees"


def test_range_test_reaches_both_ends_of_every_range_one_after_another() -> None:
    person = body_figure("default")
    motion = make_clip("range", person, fps=40.0)
    rows = [row for row in RANGES if {joint for joint, _ in row.axes} <= set(person.joint_names)]
    assert len(rows) == len(RANGES) - 1  # all but the row of a hand without fingers
    assert motion.seconds == len(rows)
    for index, row in enumerate(rows):
        second = (motion.times >= index) & (motion.times <= index + 1)
        moved = {joint for joint, _ in row.axes}
        for joint, axis in row.axes:
            turns = motion.rotations[second, motion.joint_names.index(joint)]
            long = float(np.linalg.norm(axis))
            vectors = np.degrees(Rotation.from_quat(turns).as_rotvec())
            if long == 0:  # the middle finger stays when others spread
                assert np.abs(vectors).max() < 1e-6
                continue
            angles = vectors @ (np.array(axis) / long)
            assert (angles.min(), angles.max()) == pytest.approx((row.low * long, row.high * long), abs=1e-6)
            assert np.abs(vectors - angles[:, None] * axis / long).max() < 1e-6
        others = [i for i, name in enumerate(motion.joint_names) if not moved & {name, mirror(name)}]
        turned = Rotation.from_quat(motion.rotations[second][:, others].reshape(-1, 4)).magnitude()
        assert turned.max(initial=0) < 1e-9


def mirror(name: str) -> str:
    return name.replace("right_", "left_")


def test_unknown_clips_and_other_skeletons_are_refused() -> None:
    with pytest.raises(InputError, match="none is called 'fly'; use one of idle, walk, wave, range"):
        make_clip("fly", body_figure("capsule"))
    bare = Figure(joint_names=("pelvis",), joints=np.zeros((1, 3)), ground=0.0)
    with pytest.raises(InputError, match="no joint left_hip"):
        make_clip("walk", bare)
    with pytest.raises(InputError, match="frames a second"):
        make_clip("walk", body_figure("capsule"), fps=0.0)
