"""Motion files: every joint count, axes turned once, bad frames filled and named, damage refused."""

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
        "trans": rng.normal(size=(frames, 3)),
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
    motion = load_motion(saved(tmp_path))
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
