"""Poses: axis-angle rotations by joint, the named poses, and pose files.

Conventions: a pose is [J 3] axis-angle in radians, one row a joint, each relative to the joint's parent; all
zeros is the T-pose (arms out along x, legs straight down). y up, the person faces +z, so the person's left is
+x.
"""

from pathlib import Path

import numpy as np
from jaxtyping import Float, Float32

from avatargen.body.arrays import read_npz
from avatargen.body.joints import JOINT_NAMES, driving_name
from avatargen.errors import InputError

Z_AXIS_POSES = {  # radians about z, by joint name; every joint not named stays at zero
    "t": {},
    "x": {"left_hip": 0.4, "right_hip": -0.4},
    "a": {
        "left_shoulder": -0.87,
        "right_shoulder": 0.87,
        "left_hip": 0.035,
        "right_hip": -0.035,
    },
}
POSE_KEYS = ("pose", "poses")
LARGEST_ANGLE = 1e3  # radians; a pose beyond this is not axis-angle in radians


def axis_angle_to_matrix(axis_angle: Float[np.ndarray, "*batch 3"]) -> Float[np.ndarray, "*batch 3 3"]:
    """Rotation matrices by Rodrigues' formula in float64, exact and smooth at angle zero."""
    vector = np.asarray(axis_angle, dtype=np.float64)
    angle = np.linalg.norm(vector, axis=-1)[..., None, None]
    zero = np.zeros(vector.shape[:-1])
    x, y, z = vector[..., 0], vector[..., 1], vector[..., 2]
    cross = np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=-1).reshape(*vector.shape[:-1], 3, 3)
    sine_over_angle = np.sinc(angle / np.pi)
    versine_over_square = 0.5 * np.sinc(angle / (2 * np.pi)) ** 2
    return np.eye(3) + sine_over_angle * cross + versine_over_square * (cross @ cross)


def named_pose(name: str, joint_names: tuple[str, ...]) -> Float[np.ndarray, "J 3"]:
    """The pose `x` (canonical: legs apart), `t` or `a` for a skeleton with these joint names.

    Joints the skeleton does not have are skipped, so any joint set that uses SMPL's names works.

    Raises:
        InputError: the pose has no such name.
    """
    if name not in Z_AXIS_POSES:
        raise InputError(
            f"pose: no pose is named {name!r}; use one of {', '.join(Z_AXIS_POSES)} or an .npz file"
        )
    rotations = np.zeros((len(joint_names), 3), dtype=np.float32)
    for joint, angle in Z_AXIS_POSES[name].items():
        if joint in joint_names:
            rotations[joint_names.index(joint), 2] = angle
    return rotations


def load_pose(path: str | Path, joint_names: tuple[str, ...]) -> Float[np.ndarray, "J 3"]:
    """Read one pose for a skeleton with these joints from an .npz file.

    The file holds `pose` or `poses` ([J 3] or [3J]; of a sequence [T ...] the first frame is taken), or
    `global_orient` and `body_pose`, in axis-angle radians. A pose of another count than the skeleton's is
    matched by the names of SMPL's, SMPL-H's or SMPL-X's joints where it has one of their counts, and in order
    elsewhere; joints that it does not have stay at zero.

    Raises:
        InputError: the file is missing, damaged, has none of the keys, or the numbers fit no pose of this
        body.
    """
    arrays = read_npz(Path(path), (*POSE_KEYS, "global_orient", "body_pose"), what="pose")
    found = next((arrays[key] for key in POSE_KEYS if key in arrays), None)
    if found is None and "body_pose" in arrays:
        root = arrays.get("global_orient", np.zeros(3))
        found = np.concatenate([first_frame(root, 3), first_frame(arrays["body_pose"], None)])
    if found is None:
        raise InputError(
            f"pose: {path} holds none of pose, poses, body_pose; save one of them as [J, 3] axis-angle"
        )
    angles = first_frame(found, None)
    if not (np.abs(angles) < LARGEST_ANGLE).all():  # also catches NaN
        raise InputError(f"pose: {path} holds NaN, infinite or huge angles; save axis-angle in radians")
    J = len(joint_names)
    known = JOINT_NAMES.get(angles.size // 3, ())
    if angles.size % 3 or not angles.size or (angles.size > 3 * J and not set(known) & set(joint_names)):
        raise InputError(f"pose: {path} holds {angles.size} numbers; the body takes up to {J} x 3")
    return on_joints(angles.reshape(-1, 3), joint_names)


def on_joints(angles: Float[np.ndarray, "K 3"], joint_names: tuple[str, ...]) -> Float32[np.ndarray, "J 3"]:
    """A pose of K joints for a skeleton of J, by name where both are known by SMPL's names, else in order."""
    rotations = np.zeros((len(joint_names), 3), dtype=np.float32)
    known = JOINT_NAMES.get(len(angles), ())
    if len(angles) == len(joint_names) or not set(known) & set(joint_names):
        rotations[: len(angles)] = angles
        return rotations
    for joint, name in enumerate(joint_names):
        driver = driving_name(name, known)
        if driver is not None:
            rotations[joint] = angles[known.index(driver)]
    return rotations


def first_frame(array: np.ndarray, size: int | None) -> Float[np.ndarray, " numbers"]:
    """Flatten [J 3], [3J], [T 3J] or [T J 3] to the numbers of the first frame.

    Raises:
        InputError: not numeric, empty, of more than three dimensions, or not `size` numbers.
    """
    if array.dtype.kind not in "fiu" or array.ndim not in (1, 2, 3) or array.size == 0:
        raise InputError(
            f"pose: an array of {array.dtype} {array.shape} is no pose; save axis-angle as [J, 3] floats"
        )
    framed = array.ndim == 3 or (array.ndim == 2 and array.shape[1] != 3)
    if array.ndim == 2 and array.shape[1] == 3 and size == 3:
        framed = True
    flat = np.asarray(array[0] if framed else array, dtype=np.float64).reshape(-1)
    if size is not None and flat.size != size:
        raise InputError(f"pose: global_orient holds {flat.size} numbers; three are needed")
    return flat
