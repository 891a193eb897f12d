"""Rotations, named poses and pose files."""

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from avatargen.body.joints import FINGERS, SMPL_JOINT_NAMES, SMPLH_JOINT_NAMES, SMPLX_JOINT_NAMES
from avatargen.body.pose import axis_angle_to_matrix, load_pose, named_pose
from avatargen.errors import InputError


def test_matrices_match_scipy_at_all_angles():
    rng = np.random.default_rng(0)
    axes = rng.normal(size=(200, 3))
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    angles = np.concatenate([[0, 1e-300, 1e-9, 1e-4, np.pi, 2 * np.pi, 7], rng.uniform(0, 7, 193)])
    vectors = axes * angles[:, None]

    assert np.abs(axis_angle_to_matrix(vectors) - Rotation.from_rotvec(vectors).as_matrix()).max() < 1e-12


def test_named_poses_by_joint_name():
    assert not named_pose("t", SMPL_JOINT_NAMES).any()
    x = named_pose("x", SMPL_JOINT_NAMES)
    assert x[1, 2] == pytest.approx(0.4)
    assert x[2, 2] == pytest.approx(-0.4)
    assert (
        named_pose("a", ("root", "right_shoulder"))[1, 2] > 0.7
    )  # other skeletons take the joints they have
    with pytest.raises(InputError, match="use one of t, x, a"):
        named_pose("tpose", SMPL_JOINT_NAMES)


@pytest.mark.parametrize(
    ("arrays", "frame"),
    [
        ({"pose": (24, 3)}, np.arange(72)),
        ({"pose": (72,)}, np.arange(72)),
        ({"poses": (5, 72)}, np.arange(72)),
        ({"poses": (5, 24, 3)}, np.arange(72)),
        ({"body_pose": (23, 3), "global_orient": (3,)}, np.concatenate([np.arange(3), np.arange(69)])),
        ({"body_pose": (1, 69), "global_orient": (1, 3)}, np.concatenate([np.arange(3), np.arange(69)])),
    ],
)
def test_pose_files_in_their_many_forms(tmp_path: Path, arrays: dict, frame: np.ndarray):
    path = tmp_path / "pose.npz"
    np.savez(path, **{key: np.arange(np.prod(size)).reshape(size) / 100 for key, size in arrays.items()})

    assert np.allclose(load_pose(path, SMPL_JOINT_NAMES).ravel(), frame / 100)


def test_shorter_poses_leave_the_last_joints_at_rest(tmp_path: Path):
    np.savez(tmp_path / "p.npz", pose=np.ones((22, 3)))
    assert (load_pose(tmp_path / "p.npz", SMPL_JOINT_NAMES)[22:] == 0).all()


@pytest.mark.parametrize(
    "arrays",
    [
        {"angles": np.zeros(72)},
        {"pose": np.zeros(71)},
        {"pose": np.zeros((53, 3))},
        {"pose": np.full(72, np.nan)},
        {"pose": np.array(["a"] * 72)},
        {"pose": np.zeros((0, 3))},
        {"pose": np.array([{}], dtype=object)},
        {"body_pose": np.zeros(69), "global_orient": np.zeros(4)},
    ],
)
def test_files_that_hold_no_pose_are_refused(tmp_path: Path, arrays: dict):
    np.savez(tmp_path / "p.npz", **arrays)
    with pytest.raises(InputError, match="pose"):
        load_pose(tmp_path / "p.npz", SMPL_JOINT_NAMES)
    with pytest.raises(InputError, match="cannot read"):
        load_pose(tmp_path / "none.npz", SMPL_JOINT_NAMES)


def test_poses_of_other_skeletons_are_matched_by_name(tmp_path: Path):
    rng = np.random.default_rng(0)
    for source, target in ((SMPL_JOINT_NAMES, SMPLH_JOINT_NAMES), (SMPLX_JOINT_NAMES, SMPL_JOINT_NAMES)):
        angles = rng.normal(size=(len(source), 3)).astype(np.float32)
        np.savez(tmp_path / "p.npz", pose=angles)
        found = dict(zip(target, load_pose(tmp_path / "p.npz", target), strict=True))
        given = dict(zip(source, angles, strict=True))
        for name in set(source) & set(target):
            assert np.array_equal(found[name], given[name])
        if "left_hand" in given:
            assert all(np.array_equal(found[f"left_{f}1"], given["left_hand"]) for f in FINGERS[:4])
            assert not found["left_thumb1"].any() and not found["left_index2"].any()
        else:
            assert np.array_equal(found["right_hand"], given["right_middle1"])
