"""Motion files as AMASS has them: `poses` [T, 3 J] axis-angle and `trans` [T, 3], z up, as .npz or .pkl.
Estimators of poses and SMPL-X's own files name them in parts and otherwise (`PARTS`, `TRANSLATIONS`), and
many are y up.

Our axes are y up; the two differ by a quarter turn about x. A body's own axes are SMPL's in both, so the turn
changes the pelvis' rotation and its place and no other joint. (Turning the place about the world's origin and
not about the pelvis' place in the T-pose shifts the whole motion by a constant, which means nothing.)
Letters: T frames, J joints.
"""

import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Literal

import numpy as np
from jaxtyping import Bool, Float64, Int
from scipy.spatial.transform import Rotation

from avatargen.body.arrays import read_npz
from avatargen.body.joints import JOINT_NAMES
from avatargen.body.pickle import convert_pickle
from avatargen.errors import InputError
from avatargen.motion.motion import Motion, continuous, sampled

Up = Literal["y", "z"]
POSES, TRANSLATIONS = "poses", ("trans", "transl")
PARTS = {  # of the poses, by other names
    "root": ("root_orient", "global_orient"),
    "body": ("pose_body", "body_pose"),
    "hands": ("pose_hand",),
    "left hand": ("left_hand_pose",),
    "right hand": ("right_hand_pose",),
}
BODY_SIZES, HAND_SIZE = (63, 69), 45  # numbers of SMPL-H's and of SMPL's body without its root, and of a hand
RATES = ("mocap_framerate", "mocap_frame_rate", "fps", "frame_rate")
KEYS = (POSES, *TRANSLATIONS, *RATES, *(name for names in PARTS.values() for name in names))
USUAL_RATE = 60.0  # frames a second of a file that does not say
FASTEST = 10_000.0
MOST_FRAMES = 200_000
LARGEST_ANGLE = 100.0  # radians: more is not axis-angle
LARGEST_WAY = 1e4  # metres
IN_DEGREES = 7.0  # radians: where the largest turn of most frames is more, no joint turns as far
HIGHEST, FASTEST_WAY = 20.0, 100.0  # metres, metres a second: what most frames have is less
UPRIGHT = 0.7  # of a pelvis' own y axis along an axis of the file, on average: that one is up
SMPL_LEG = 0.818  # metres from hip to knee to ankle of the mean of SMPL's bodies
Y_UP_FROM_Z_UP = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])


def load_motion(path: str | Path, up: Up | None = None) -> Motion:
    """Read a motion of 22 (SMPL's body), 24 (SMPL), 52 (SMPL-H) or 55 joints (SMPL-X) from an .npz or,
    converted in a subprocess that runs none of the file's code, a .pkl.

    `up` is the file's upward axis; None: the one along which the pelvis stands in most of it, z where it
    stands along neither.

    Frames that hold NaN, infinity or huge numbers are filled from the good frames around them and named in
    `bad_frames`, counted from 0.

    Raises:
        InputError: the file is missing, damaged or no motion, half of its frames or more are bad, or its
            numbers are degrees or millimetres.
    """
    path = Path(path)
    pickled = path.suffix.lower() == ".pkl"
    arrays = convert_pickle(path, KEYS, "motion") if pickled else read_npz(path, KEYS, "motion")
    poses, way = read_frames(arrays, path)
    rate = read_rate(arrays, path)
    good = good_frames(poses, way)
    bad = np.flatnonzero(~good)
    if good.sum() <= len(good) / 2:
        raise InputError(
            f"motion: {path} holds NaN, infinite or huge numbers in {len(bad)} of {len(good)} frames "
            f"({in_ranges(bad)}); cut them out"
        )
    require_angles(poses[good], path)
    J, up = poses.shape[1], up or upward_axis(poses[good, 0])
    require_metres(way[good], rate, up, path)
    ours = Y_UP_FROM_Z_UP if up == "z" else np.eye(3)
    rotations = Rotation.from_rotvec(poses[good].reshape(-1, 3)).as_quat().reshape(-1, J, 4)
    rotations[:, 0] = (Rotation.from_matrix(ours) * Rotation.from_quat(rotations[:, 0])).as_quat()
    times = np.arange(len(good)) / rate
    kept = Motion(
        name=motion_name(path),
        joint_names=JOINT_NAMES[J],
        times=times[good] - times[good][0],
        rotations=continuous(rotations),
        translation=way[good] @ ours.T,
        leg=SMPL_LEG,
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
    poses = arrays[POSES] if POSES in arrays else joined_parts(arrays, path)
    shape = poses.shape
    joints = joints_of(shape)
    if poses.dtype.kind not in "fiu" or joints not in JOINT_NAMES or not 0 < shape[0] <= MOST_FRAMES:
        raise InputError(
            f"motion: {path} holds poses of {poses.dtype} {shape}; [T, 3 J] numbers with J one of "
            f"{', '.join(map(str, JOINT_NAMES))} and T up to {MOST_FRAMES} are read"
        )
    way = next((arrays[name] for name in TRANSLATIONS if name in arrays), np.zeros((shape[0], 3)))
    if way.dtype.kind not in "fiu" or way.shape != (shape[0], 3):
        raise InputError(
            f"motion: {path} holds trans of {way.dtype} {way.shape}; [{shape[0]}, 3] numbers are needed"
        )
    return poses.reshape(shape[0], -1, 3).astype(np.float64), way.astype(np.float64)


def joined_parts(arrays: dict[str, np.ndarray], path: Path) -> np.ndarray:
    """Poses [T, 3 J] of a file that names root, body and hands apart; without a root it stays as it is.

    Raises:
        InputError: there is no body, or a part is of another length or size.
    """
    parts = {part: flat(arrays[name]) for part, names in PARTS.items() for name in names if name in arrays}
    if "body" not in parts:
        raise InputError(
            f"motion: {path} holds no {POSES!r}, nor {' or '.join(PARTS['body'])}; save [T, 3 J] axis-angle "
            "in radians under it"
        )
    body = parts["body"]
    frames, size = body.shape
    root = parts.get("root", np.zeros((frames, 3)))
    hands = parts.get("hands")
    if hands is None and all(part.shape[1] == HAND_SIZE for part in sides(parts)):
        hands = np.concatenate(sides(parts), axis=1)
    found = [root, body, *([] if hands is None or size != BODY_SIZES[0] else [hands])]
    wanted = [3, size, 2 * HAND_SIZE][: len(found)]
    if size not in BODY_SIZES or [part.shape for part in found] != [(frames, width) for width in wanted]:
        raise InputError(
            f"motion: {path} holds parts of a pose of {[part.shape for part in found]}; [T, 3] of "
            "a root, [T, 63] or [T, 69] of a body and [T, 90] of hands are read"
        )
    return np.concatenate(found, axis=1)


def sides(parts: dict[str, np.ndarray]) -> list[np.ndarray]:
    """The left and the right hand, each [T, 0] where it is missing."""
    return [parts.get(f"{side} hand", np.zeros((0, 0))) for side in ("left", "right")]


def flat(array: np.ndarray) -> np.ndarray:
    """[T, J, 3] as [T, 3 J]; what has no frames as one without numbers, which is refused for its shape."""
    return array.reshape(len(array), -1) if array.ndim > 1 else array.reshape(1, -1)


def upward_axis(root: Float64[np.ndarray, "T 3"]) -> Up:
    """The axis along which the pelvis' own y points; z, as AMASS has it, where that is no clear one."""
    upward = Rotation.from_rotvec(root).apply([0.0, 1.0, 0.0]).mean(axis=0)
    return "y" if upward[1] > UPRIGHT else "z"


def require_angles(poses: Float64[np.ndarray, "T J 3"], path: Path) -> None:
    """Raises InputError where axis-angle turns further than joints do."""
    largest = float(np.median(np.linalg.norm(poses, axis=2).max(axis=1)))
    if largest > IN_DEGREES:
        raise InputError(
            f"motion: {path} turns a joint by {largest:.0f} radians in most frames, as if in degrees; save "
            "axis-angle in radians"
        )


def require_metres(way: Float64[np.ndarray, "T 3"], rate: float, up: Up, path: Path) -> None:
    """Raises InputError where the pelvis is higher or faster than a person's."""
    height = float(np.median(np.abs(way[:, "xyz".index(up)])))
    speed = float(np.median(np.linalg.norm(np.diff(way, axis=0), axis=1))) * rate if len(way) > 1 else 0.0
    if height > HIGHEST or speed > FASTEST_WAY:
        raise InputError(
            f"motion: {path} has the pelvis {height:.0f} m high and {speed:.0f} m/s fast in most frames, as "
            "if in millimetres or centimetres; save trans in metres"
        )


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
