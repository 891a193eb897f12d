"""Motion files as AMASS has them: .npz with `poses` [T, 3 J] axis-angle and `trans` [T, 3], z up.

Our axes are y up; the two differ by a quarter turn about x. A body's own axes are SMPL's in both, so the turn
changes the pelvis' rotation and its place and no other joint. (Turning the place about the world's origin and
not about the pelvis' place in the T-pose shifts the whole motion by a constant, which means nothing.)
Letters: T frames, J joints.
"""

import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from jaxtyping import Bool, Float64, Int
from scipy.spatial.transform import Rotation

from avatargen.body.arrays import read_npz
from avatargen.body.joints import JOINT_NAMES
from avatargen.errors import InputError
from avatargen.motion.motion import Motion, continuous, sampled

POSES, TRANSLATION = "poses", "trans"
RATES = ("mocap_framerate", "mocap_frame_rate")
USUAL_RATE = 60.0  # frames a second of a file that does not say
FASTEST = 10_000.0
MOST_FRAMES = 200_000
LARGEST_ANGLE = 100.0  # radians: more is not axis-angle
LARGEST_WAY = 1e4  # metres
Y_UP_FROM_Z_UP = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])


def load_motion(path: str | Path) -> Motion:
    """Read a motion of 22 (SMPL's body), 24 (SMPL), 52 (SMPL-H) or 55 joints (SMPL-X).

    Frames that hold NaN, infinity or huge numbers are filled from the good frames around them and named in
    `bad_frames`, counted from 0.

    Raises:
        InputError: the file is missing, damaged or no motion, or half of its frames or more are bad.
    """
    path = Path(path)
    arrays = read_npz(path, (POSES, TRANSLATION, *RATES), what="motion")
    poses, way = read_frames(arrays, path)
    rate = read_rate(arrays, path)
    good = good_frames(poses, way)
    bad = np.flatnonzero(~good)
    if good.sum() <= len(good) / 2:
        raise InputError(
            f"motion: {path} holds NaN, infinite or huge numbers in {len(bad)} of {len(good)} frames "
            f"({in_ranges(bad)}); cut them out"
        )
    J, turn = poses.shape[1], Rotation.from_matrix(Y_UP_FROM_Z_UP)
    rotations = Rotation.from_rotvec(poses[good].reshape(-1, 3)).as_quat().reshape(-1, J, 4)
    rotations[:, 0] = (turn * Rotation.from_quat(rotations[:, 0])).as_quat()
    times = np.arange(len(good)) / rate
    kept = Motion(
        name=motion_name(path),
        joint_names=JOINT_NAMES[J],
        times=times[good] - times[good][0],
        rotations=continuous(rotations),
        translation=way[good] @ Y_UP_FROM_Z_UP.T,
    )
    whole = sampled(kept, np.clip(times - times[good][0], 0, kept.seconds), times)
    return replace(whole, bad_frames=tuple(bad.tolist()))


def motion_name(path: Path) -> str:
    """The motion of a file by its name; bytes of it that are no UTF-8 become U+FFFD."""
    return os.fsencode(path.stem).decode(errors="replace")


def read_frames(
    arrays: dict[str, np.ndarray], path: Path
) -> tuple[Float64[np.ndarray, "T J 3"], Float64[np.ndarray, "T 3"]]:
    """Axis-angle poses and the way, as they stand in the file.

    Raises:
        InputError: one is missing, is no array of numbers or of another shape.
    """
    if POSES not in arrays:
        raise InputError(f"motion: {path} holds no {POSES!r}; save [T, 3 J] axis-angle in radians under it")
    poses = arrays[POSES]
    shape = poses.shape
    joints = joints_of(shape)
    if poses.dtype.kind not in "fiu" or joints not in JOINT_NAMES or not 0 < shape[0] <= MOST_FRAMES:
        raise InputError(
            f"motion: {path} holds poses of {poses.dtype} {shape}; [T, 3 J] numbers with J one of "
            f"{', '.join(map(str, JOINT_NAMES))} and T up to {MOST_FRAMES} are read"
        )
    way = arrays.get(TRANSLATION, np.zeros((shape[0], 3)))
    if way.dtype.kind not in "fiu" or way.shape != (shape[0], 3):
        raise InputError(
            f"motion: {path} holds trans of {way.dtype} {way.shape}; [{shape[0]}, 3] numbers are needed"
        )
    return poses.reshape(shape[0], -1, 3).astype(np.float64), way.astype(np.float64)


def joints_of(shape: tuple[int, ...]) -> int:
    """J of [T, 3 J] or [T, J, 3]; 0 for any other shape."""
    if len(shape) == 3 and shape[2] == 3:
        return shape[1]
    return shape[1] // 3 if len(shape) == 2 and shape[1] % 3 == 0 else 0


def read_rate(arrays: dict[str, np.ndarray], path: Path) -> float:
    """Frames a second. Raises InputError where the file gives no usable number."""
    found = next((arrays[name] for name in RATES if name in arrays), np.array(USUAL_RATE))
    if found.dtype.kind not in "fiu" or found.size != 1 or not 0 < float(found.reshape(-1)[0]) <= FASTEST:
        raise InputError(
            f"motion: {path} gives its frame rate as {found.dtype} {found.shape}; a number above 0 is needed"
        )
    return float(found.reshape(-1)[0])


def good_frames(
    poses: Float64[np.ndarray, "T J 3"], way: Float64[np.ndarray, "T 3"]
) -> Bool[np.ndarray, " T"]:
    """Frames whose numbers can be a pose and a place; NaN is in no range."""
    numbers = np.concatenate([poses.reshape(len(poses), -1) / LARGEST_ANGLE, way / LARGEST_WAY], axis=1)
    return np.abs(numbers).max(axis=1) < 1


def in_ranges(frames: Sequence[int] | Int[np.ndarray, " N"], most: int = 8) -> str:
    """Frame numbers for people: 3, 7-12, 40."""
    frames = np.asarray(frames)
    runs = np.split(frames, np.flatnonzero(np.diff(frames) > 1) + 1)
    words = [f"{run[0]}-{run[-1]}" if len(run) > 1 else f"{run[0]}" for run in runs[:most] if len(run)]
    return ", ".join(words) + (", ..." if len(runs) > most else "")
