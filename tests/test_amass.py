"""Motion files: every joint count, axes turned once, bad frames filled and named, damage refused."""

import os
import pickle
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from avatargen.body.joints import JOINT_NAMES
from avatargen.body.model import pose, shape
from avatargen.body.pose import axis_angle_to_matrix
from avatargen.errors import InputError
from avatargen.motion.amass import in_ranges, load_motion
from tests.bodies import capsule_body
from tests.figures import BETAS


def arrays(frames: int = 12, joints: int = 24, seed: int = 0) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(seed)
    start, drift = rng.uniform(-1, 1, (2, 3 * joints))
    poses = start + np.linspace(0, 1, frames)[:, None] * drift * 0.5
    return {
        "poses": poses,
        "trans": 0.1 * rng.normal(size=(frames, 3)),
        "mocap_framerate": np.array(60.0),
        "betas": rng.normal(size=16),
        "gender": np.array("female"),
    }


def saved(folder: Path, **changes: np.ndarray | None) -> Path:
    kept = {key: value for key, value in (arrays() | changes).items() if value is not None}
    np.savez(folder / "take.npz", **kept)  # pyright: ignore[reportArgumentType]
    return folder / "take.npz"


@pytest.mark.parametrize("flat", [True, False])
@pytest.mark.parametrize("joints", JOINT_NAMES)
def test_every_joint_count_is_read_by_its_names(tmp_path: Path, joints: int, flat: bool) -> None:
    given = arrays(joints=joints)
    poses = given["poses"] if flat else given["poses"].reshape(12, joints, 3)
    motion = load_motion(saved(tmp_path, poses=poses))
    assert motion.name == "take"
    assert motion.joint_names == JOINT_NAMES[joints]
    np.testing.assert_allclose(motion.times, np.arange(12) / 60, atol=1e-12)
    found = Rotation.from_quat(motion.rotations[:, 1:].reshape(-1, 4)).as_matrix()
    expected = axis_angle_to_matrix(given["poses"].reshape(12, joints, 3)[:, 1:].reshape(-1, 3))
    np.testing.assert_allclose(found, expected, atol=1e-12)
    assert motion.bad_frames == ()


def test_z_up_becomes_y_up_for_the_whole_body(tmp_path: Path) -> None:
    """Our pose of our motion is the file's pose of the file's numbers, turned as a whole, but for a shift."""
    given, body = arrays(), capsule_body()
    motion = load_motion(saved(tmp_path), "z")
    shaped = shape(body, BETAS)
    shifts = []
    for frame in range(12):
        theirs = pose(body, shaped, given["poses"][frame].reshape(24, 3), given["trans"][frame]).vertices
        turned = np.stack([theirs[:, 0], theirs[:, 2], -theirs[:, 1]], axis=1)
        angles = Rotation.from_quat(motion.rotations[frame]).as_rotvec()
        ours = pose(body, shaped, angles, motion.translation[frame]).vertices
        shifts.append((ours - turned).mean(axis=0))
        np.testing.assert_allclose(ours - shifts[-1], turned, atol=1e-6)
    np.testing.assert_allclose(shifts, np.tile(shifts[0], (12, 1)), atol=1e-6)


def test_somebody_upright_in_the_file_is_upright_here(tmp_path: Path) -> None:
    upright = np.zeros((2, 72))
    upright[:, 0] = np.pi / 2  # SMPL's y axis along the file's z
    motion = load_motion(saved(tmp_path, poses=upright, trans=np.tile([1.0, 2.0, 0.9], (2, 1))))
    np.testing.assert_allclose(np.abs(motion.rotations[0, 0]), [0, 0, 0, 1], atol=1e-12)
    np.testing.assert_allclose(motion.translation[0], [1.0, 0.9, -2.0], atol=1e-12)


def test_bad_frames_are_filled_from_their_neighbours_and_named(tmp_path: Path) -> None:
    given = arrays()
    poses, trans = given["poses"].copy(), given["trans"].copy()
    poses[0, 5] = np.nan
    poses[4, 70] = np.inf
    poses[5, 0] = 1e6
    trans[11, 2] = np.nan
    whole = load_motion(saved(tmp_path))
    motion = load_motion(saved(tmp_path, poses=poses, trans=trans))
    assert motion.bad_frames == (0, 4, 5, 11)
    np.testing.assert_allclose(motion.times, whole.times, atol=1e-12)
    good = [1, 2, 3, 6, 7, 8, 9, 10]
    np.testing.assert_allclose(motion.rotations[good], whole.rotations[good], atol=1e-9)
    np.testing.assert_allclose(motion.translation[0], whole.translation[1], atol=1e-12)
    np.testing.assert_allclose(motion.translation[11], whole.translation[10], atol=1e-12)
    between = (2 * whole.translation[3] + whole.translation[6]) / 3
    np.testing.assert_allclose(motion.translation[4], between, atol=1e-12)
    third = Rotation.from_quat(whole.rotations[3]).inv() * Rotation.from_quat(whole.rotations[6])
    expected = Rotation.from_quat(whole.rotations[3]) * Rotation.from_rotvec(third.as_rotvec() / 3)
    assert (expected.inv() * Rotation.from_quat(motion.rotations[4])).magnitude().max() < 1e-9


def test_a_file_of_mostly_bad_frames_is_refused_with_their_numbers(tmp_path: Path) -> None:
    poses = arrays()["poses"].copy()
    poses[2:9] = np.nan
    with pytest.raises(InputError, match=r"in 7 of 12 frames \(2-8\); cut them out"):
        load_motion(saved(tmp_path, poses=poses))


def test_frame_numbers_for_people() -> None:
    assert in_ranges([3, 7, 8, 9, 40]) == "3, 7-9, 40"
    assert in_ranges([]) == ""
    assert in_ranges(range(0, 40, 2)) == "0, 2, 4, 6, 8, 10, 12, 14, ..."


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"poses": None}, "holds no 'poses'"),
        ({"poses": np.zeros((12, 71))}, "poses of float64"),
        ({"poses": np.zeros((12, 75))}, "J one of 22, 24, 52, 55"),
        ({"poses": np.zeros((0, 72))}, "T up to"),
        ({"poses": np.zeros(72)}, "poses of float64"),
        ({"poses": np.array(["x"] * 72)[None]}, "poses of <U1"),
        ({"trans": np.zeros((11, 3))}, "trans of float64"),
        ({"trans": np.zeros((12, 2))}, "trans of float64"),
        ({"mocap_framerate": np.array(0.0)}, "frame rate"),
        ({"mocap_framerate": np.array(np.nan)}, "frame rate"),
        ({"mocap_framerate": np.array([30.0, 60.0])}, "frame rate"),
        ({"mocap_framerate": np.array("fast")}, "frame rate"),
    ],
)
def test_files_that_hold_no_motion_are_refused(
    tmp_path: Path, changes: dict[str, np.ndarray | None], words: str
) -> None:
    with pytest.raises(InputError, match=words):
        load_motion(saved(tmp_path, **changes))


def test_a_file_without_way_or_rate_stays_in_place_at_the_usual_rate(tmp_path: Path) -> None:
    motion = load_motion(saved(tmp_path, trans=None, mocap_framerate=None))
    assert not motion.translation.any()
    assert motion.times[1] == pytest.approx(1 / 60)


def standing(up: str, frames: int = 12) -> dict[str, np.ndarray]:
    """Somebody who walks forward along the file's other axis, swinging an arm."""
    poses = np.zeros((frames, 72))
    poses[:, 0] = np.pi / 2 if up == "z" else 0.0
    poses[:, 50] = np.linspace(-0.5, 0.5, frames)
    height, way = np.full(frames, 0.9), np.linspace(0, 1, frames)
    trans = np.stack([0 * way, height, way] if up == "y" else [0 * way, -way, height], axis=1)
    return {"poses": poses, "trans": trans}


@pytest.mark.parametrize("up", ["y", "z"])
def test_the_upward_axis_is_the_one_that_people_stand_along(tmp_path: Path, up: str) -> None:
    motion = load_motion(saved(tmp_path, **standing(up)))
    np.testing.assert_allclose(np.abs(motion.rotations[:, 0]), np.tile([0, 0, 0, 1.0], (12, 1)), atol=1e-12)
    np.testing.assert_allclose(motion.translation[-1], [0, 0.9, 1], atol=1e-12)


def test_an_upward_axis_that_is_given_is_taken(tmp_path: Path) -> None:
    """Somebody who lies along the file's y, z up, cannot be told from somebody who stands, y up."""
    lying = saved(tmp_path, **standing("y"))
    np.testing.assert_allclose(load_motion(lying, "z").translation[-1], [0, 1, -0.9], atol=1e-12)
    np.testing.assert_allclose(load_motion(lying, "y").translation[-1], [0, 0.9, 1], atol=1e-12)


@pytest.mark.parametrize("key", ["mocap_framerate", "mocap_frame_rate", "fps", "frame_rate"])
def test_every_name_of_the_rate_is_read(tmp_path: Path, key: str) -> None:
    rate = {"mocap_framerate": None} | {key: np.array(20)}
    assert load_motion(saved(tmp_path, **rate)).seconds == pytest.approx(11 / 20)


@pytest.mark.parametrize("suffix", [".npz", ".pkl"])
@pytest.mark.parametrize(
    ("root", "body", "hands", "joints"),
    [
        ("root_orient", "pose_body", ("pose_hand",), 52),
        ("global_orient", "body_pose", ("left_hand_pose", "right_hand_pose"), 52),
        ("global_orient", "body_pose", (), 22),
        ("global_orient", "body_pose", (), 24),
    ],
)
def test_poses_in_parts_are_the_same_pose(
    tmp_path: Path, suffix: str, root: str, body: str, hands: tuple[str, ...], joints: int
) -> None:
    given = arrays(joints=joints)
    whole = load_motion(saved(tmp_path, poses=given["poses"], trans=given["trans"]))
    end = 66 if joints == 52 else 3 * joints
    parts = {root: given["poses"][:, :3], body: given["poses"][:, 3:end], "transl": given["trans"]}
    parts |= dict(zip(hands, np.split(given["poses"][:, end:], len(hands) or 1, axis=1), strict=False))
    path = tmp_path / f"parts{suffix}"
    if suffix == ".npz":
        np.savez(path, **parts, fps=60.0)  # pyright: ignore[reportArgumentType]
    else:
        path.write_bytes(pickle.dumps(parts | {"fps": 60.0, "gender": "female"}))
    found = load_motion(path)
    assert found.joint_names == whole.joint_names
    for name in ("times", "rotations", "translation"):
        np.testing.assert_array_equal(getattr(found, name), getattr(whole, name))


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"poses": np.degrees(arrays()["poses"])}, "as if in degrees; save axis-angle in radians"),
        (
            {"trans": 1000 * standing("y")["trans"]},
            "as if in millimetres or centimetres; save trans in metres",
        ),
        ({"trans": 100 * standing("y")["trans"]}, "as if in millimetres or centimetres"),
        ({"poses": None, "pose_body": np.zeros((12, 62))}, r"\[T, 63\] or \[T, 69\] of a body"),
        ({"poses": None, "pose_body": np.zeros((12, 63)), "root_orient": np.zeros((3, 3))}, "holds parts"),
        ({"poses": None}, "holds no 'poses', nor pose_body or body_pose"),
    ],
)
def test_what_makes_no_person_is_refused(tmp_path: Path, change: dict, reason: str) -> None:
    with pytest.raises(InputError, match=reason):
        load_motion(saved(tmp_path, **standing("y") | change))


def test_a_pickled_motion_runs_nothing(tmp_path: Path) -> None:
    (tmp_path / "take.pkl").write_bytes(b"cos\nsystem\n(S'touch ran'\ntR.")
    with pytest.raises(InputError, match=r"motion: .*take.pkl was not read: .*os.system"):
        load_motion(tmp_path / "take.pkl")


def test_a_name_that_is_no_utf8_becomes_one(tmp_path: Path) -> None:
    path = tmp_path / os.fsdecode(b"caf\xe9.npz")
    saved(tmp_path).rename(path)
    assert load_motion(path).name == "caf\ufffd"
