"""Read and write body files: .npz in SMPL's form, or SMPL's own .pkl through the safe converter."""

import io
from pathlib import Path

import numpy as np

from avatargen.atomic import write_atomically
from avatargen.body.arrays import read_npz
from avatargen.body.conventions import in_our_convention
from avatargen.body.joints import JOINT_NAMES
from avatargen.body.model import Body, require_shape
from avatargen.body.pickle import KEYS, convert_pickle
from avatargen.errors import InputError

NEEDED = ("v_template", "weights", "J_regressor", "shapedirs")
EITHER = (("faces", "f"), ("parents", "kintree_table"))
OPTIONAL = ("posedirs", "joint_names")
MAX_JOINTS = 1000
WEIGHT_SUM_TOLERANCE = 1e-3  # of a file; rows are rescaled to 1 after the check
LEAST_WEIGHT = -1e-6  # a weight from here to 0 is one that was rounded, and 0
WEIGHT_SUM_ROUNDING = 1e-6  # rows this near to 1 are left as they are


def load_body(path: str | Path) -> Body:
    """Read a body from .npz or, converted in a subprocess that runs none of the file's code, from SMPL's
    .pkl. Its convention becomes ours: see `avatargen.body.conventions`.

    Raises:
        InputError: missing, damaged, incomplete or inconsistent file.
    """
    path = Path(path)
    if path.suffix == ".npz":
        return in_our_convention(body_from_arrays(read_npz(path, file_keys(), what="body"), path))
    if path.suffix == ".pkl":
        return in_our_convention(body_from_arrays(convert_pickle(path, KEYS, what="body"), path))
    raise InputError(f"body: {path} has suffix {path.suffix!r}; a body is an .npz or SMPL's .pkl")


def save_body(body: Body, path: str | Path) -> None:
    """Write a body as .npz, whole or not at all; `load_body` reads back the same arrays."""
    arrays = {
        "v_template": body.v_template,
        "f": body.faces.astype(np.int32),
        "weights": body.weights,
        "kintree_table": np.stack([body.parents, np.arange(body.joint_count)]).astype(np.int32),
        "J_regressor": body.J_regressor,
        "shapedirs": body.shapedirs,
        "joint_names": np.array(body.joint_names),
    }
    if body.posedirs is not None:
        arrays["posedirs"] = body.posedirs
    stream = io.BytesIO()
    np.savez_compressed(stream, **arrays)
    write_atomically(Path(path), stream.getvalue())


def file_keys() -> tuple[str, ...]:
    """Every key of a body file that is read."""
    return (*NEEDED, *OPTIONAL, *(key for pair in EITHER for key in pair))


def body_from_arrays(arrays: dict[str, np.ndarray], path: Path) -> Body:
    """Bring a file's arrays to the types of `Body`, which then checks that they agree.

    Raises:
        InputError: a key is missing, or an array has the wrong number of axes or type.
    """
    missing = [key for key in NEEDED if key not in arrays]
    missing += [" or ".join(pair) for pair in EITHER if not any(key in arrays for key in pair)]
    if missing:
        raise InputError(f"body: {path} lacks {', '.join(missing)}; it must be a body in SMPL's form")
    weights = numbers(arrays, "weights", (None, None))
    weights = np.where((weights < 0) & (weights >= LEAST_WEIGHT), 0.0, weights)
    sums = weights.sum(axis=1, keepdims=True)
    sums = np.where(np.abs(sums - 1) < WEIGHT_SUM_ROUNDING, 1.0, sums)
    if not (np.abs(sums - 1) < WEIGHT_SUM_TOLERANCE).all():
        raise InputError(f"body: weights of {path} do not sum to 1 per vertex; the file is damaged")
    V, J = weights.shape
    blends = numbers(arrays, "posedirs", (V, 3, 9 * (J - 1))) if "posedirs" in arrays else None
    return Body(
        v_template=as_type(numbers(arrays, "v_template", (V, 3)), np.float32),
        faces=whole_numbers(arrays, "faces" if "faces" in arrays else "f", (None, 3)),
        weights=(weights / sums).astype(np.float32),
        parents=read_parents(arrays, J),
        joint_names=read_joint_names(arrays, J),
        J_regressor=as_type(numbers(arrays, "J_regressor", (J, V)), np.float32),
        shapedirs=as_type(numbers(arrays, "shapedirs", (V, 3, None)), np.float32),
        posedirs=None if blends is None else as_type(blends, np.float32),
    )


def numbers(arrays: dict[str, np.ndarray], key: str, shape: tuple[int | None, ...]) -> np.ndarray:
    """One array as float64, checked for its type and shape; None stands for any length."""
    array = arrays[key]
    if array.dtype.kind not in "fiu" or array.size == 0:
        raise InputError(f"body: {key} is {array.dtype} {array.shape}; numbers are needed")
    require_shape(key, array, shape)
    return as_type(array, np.float64)


def as_type(array: np.ndarray, kind: type) -> np.ndarray:
    """The array in another type; what is NaN or too large for it comes out so, and `Body` refuses that."""
    with np.errstate(invalid="ignore", over="ignore"):
        return array.astype(kind)


def whole_numbers(arrays: dict[str, np.ndarray], key: str, shape: tuple[int | None, ...]) -> np.ndarray:
    """One array as int64, with the largest unsigned numbers of 32 and 64 bits, which SMPL's files have for no
    parent, read as -1."""
    values = numbers(arrays, key, shape)
    values = np.where(values == float(2**64 - 1), -1.0, values)
    if not (np.abs(values) <= 2**32).all() or (values != np.rint(values)).any():
        raise InputError(f"body: {key} holds values that are no indices; the file is damaged")
    indices = values.astype(np.int64)
    return np.where(indices == 2**32 - 1, -1, indices)


def read_parents(arrays: dict[str, np.ndarray], joint_count: int) -> np.ndarray:
    """Parents from `parents` [J] or SMPL's `kintree_table` [2 J]: a row of parents, a row of joints."""
    if joint_count > MAX_JOINTS:
        raise InputError(f"body: {joint_count} joints; at most {MAX_JOINTS} are read")
    if "parents" in arrays:
        parents = whole_numbers(arrays, "parents", (joint_count,))
    else:
        table = whole_numbers(arrays, "kintree_table", (2, joint_count))
        place = {joint: index for index, joint in enumerate(table[1].tolist())}
        if len(place) != joint_count:
            raise InputError("body: kintree_table names a joint twice; each joint once is needed")
        parents = np.array([place.get(parent, -1) for parent in table[0].tolist()], dtype=np.int64)
    parents[0] = -1
    return parents


def read_joint_names(arrays: dict[str, np.ndarray], joint_count: int) -> tuple[str, ...]:
    """The file's joint names, or those of SMPL, SMPL-H or SMPL-X (their files name none), or joint_00 ..."""
    if "joint_names" in arrays:
        names = arrays["joint_names"]
        if names.dtype.kind != "U" or names.ndim != 1:
            raise InputError(f"body: joint_names are {names.dtype} {names.shape}; a list of text is needed")
        return tuple(names.tolist())
    return JOINT_NAMES.get(joint_count, tuple(f"joint_{index:02d}" for index in range(joint_count)))
