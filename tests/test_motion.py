"""Mirrored, retimed and held motions, against what the words mean."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation, Slerp

from avatargen.body.joints import SMPL_JOINT_NAMES, SMPLH_JOINT_NAMES, mirrored_name
from avatargen.errors import InputError
from avatargen.motion.motion import Motion, continuous, in_place, mirrored, retimed
from tests.figures import random_motion


@pytest.mark.parametrize("names", [SMPL_JOINT_NAMES, SMPLH_JOINT_NAMES], ids=len)
def test_a_mirror_shows_the_motion_reflected(names: tuple[str, ...]) -> None:
    motion = random_motion(names=names)
    found = mirrored(motion)
    reflection = np.diag([-1.0, 1, 1])
    for joint, name in enumerate(names):
        twin = names.index(mirrored_name(name))
        ours = Rotation.from_quat(found.rotations[:, twin]).as_matrix()
        seen = reflection @ Rotation.from_quat(motion.rotations[:, joint]).as_matrix() @ reflection
        np.testing.assert_allclose(ours, seen, atol=1e-12)
    np.testing.assert_array_equal(found.translation, motion.translation * [-1, 1, 1])
    twice = mirrored(found)
    np.testing.assert_array_equal(twice.rotations, motion.rotations)
    np.testing.assert_array_equal(twice.translation, motion.translation)


@pytest.mark.parametrize(
    ("fps", "speed"), [(30, 1.0), (60, 1.0), (24, 1.0), (10, 0.5), (30, 3.0), (7.3, 1.7)]
)
def test_retiming_is_slerp_between_frames(fps: float, speed: float) -> None:
    motion = random_motion(20, angle=1.2)
    found = retimed(motion, float(fps), speed)
    assert found.seconds == pytest.approx(motion.seconds / speed, abs=1e-3 / fps)
    np.testing.assert_allclose(np.diff(found.times)[:-1], 1 / fps, atol=1e-12)
    for joint in range(len(motion.joint_names)):
        between = Slerp(motion.times, Rotation.from_quat(motion.rotations[:, joint]))
        expected = between(np.minimum(found.times * speed, motion.seconds))
        error = (expected.inv() * Rotation.from_quat(found.rotations[:, joint])).magnitude()
        assert error.max() < 1e-9
    for axis in range(3):
        expected = np.interp(found.times * speed, motion.times, motion.translation[:, axis])
        np.testing.assert_allclose(found.translation[:, axis], expected, atol=1e-12)


def test_retiming_at_its_own_rate_changes_nothing() -> None:
    motion = random_motion(20)
    found = retimed(motion, 30.0)
    np.testing.assert_allclose(found.times, motion.times, atol=1e-12)
    np.testing.assert_allclose(found.rotations, motion.rotations, atol=1e-9)


def test_a_single_frame_can_be_retimed() -> None:
    assert len(retimed(random_motion(1), 60.0, 2.0).times) == 1


@pytest.mark.parametrize(
    ("fps", "speed"), [(0.0, 1.0), (-1.0, 1.0), (np.nan, 1.0), (30.0, 0.0), (30.0, np.inf)]
)
def test_impossible_rates_are_refused(fps: float, speed: float) -> None:
    with pytest.raises(InputError, match="must be above 0"):
        retimed(random_motion(), fps, speed)


def test_too_many_frames_are_refused_before_they_are_made() -> None:
    with pytest.raises(InputError, match="at most"):
        retimed(random_motion(), 30.0, 1e-9)


def test_in_place_keeps_height_alone() -> None:
    motion = random_motion()
    found = in_place(motion).translation
    np.testing.assert_array_equal(found, motion.translation * [0, 1, 0])


def test_signs_become_continuous_and_rotations_stay() -> None:
    motion = random_motion(30, angle=3.0)
    rng = np.random.default_rng(0)
    flipped = motion.rotations * rng.choice([-1.0, 1.0], size=(30, 24, 1))
    found = continuous(flipped)
    assert np.einsum("tjk,tjk->tj", found[1:], found[:-1]).min() >= 0
    assert (found[0, :, 3] >= 0).all()
    np.testing.assert_array_equal(np.abs(found), np.abs(flipped))


@pytest.mark.parametrize(
    "change", [{"times": np.zeros(5)}, {"times": np.arange(1.0, 6)}, {"translation": np.full((5, 3), np.nan)}]
)
def test_a_motion_checks_itself(change: dict) -> None:
    motion = random_motion(5)
    with pytest.raises(InputError, match="motion random"):
        replace(motion, **change)
    assert isinstance(motion, Motion)
