"""Read SMPL's pickles without running what they hold.

A pickle is a program that may call anything it can import. The reader here resolves an exact list of names
and nothing else, each to an inert stand-in or a guarded copy, so the program can only build arrays. Since
even that can ask for any amount of memory or time, it runs in a subprocess with limits on both, which writes
the arrays as .npz for the parent to read and check:

    python -m avatargen.body.pickle model.pkl model.npz v_template f ...
"""

import os
import pickle
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from avatargen.body.arrays import read_npz
from avatargen.errors import InputError

KEYS = ("v_template", "f", "weights", "kintree_table", "J_regressor", "shapedirs", "posedirs")
MAX_PICKLE_BYTES = 1 << 30
MEMORY_LIMIT_BYTES = 1 << 30  # SMPL-X with 400 shapes takes two thirds of it
TIME_LIMIT_SECONDS = 120


def convert_pickle(path: Path, keys: tuple[str, ...], what: str) -> dict[str, np.ndarray]:
    """The arrays under these keys of a pickle that holds a mapping, those that it has, read in a subprocess
    under memory and time limits.

    Raises:
        InputError: the file is missing, too large, no such pickle, asks for code, or goes over a limit.
    """
    if not path.is_file():
        raise InputError(f"{what}: cannot read {path}; check the path")
    if path.stat().st_size > MAX_PICKLE_BYTES:
        raise InputError(
            f"{what}: {path} has {path.stat().st_size:.3g} bytes; at most {MAX_PICKLE_BYTES:.3g} are read"
        )
    with tempfile.TemporaryDirectory(prefix="avatargen-pickle-") as folder:
        target = Path(folder) / "arrays.npz"
        error = run_limited(path.resolve(), target, *keys)
        if error is not None:
            raise InputError(
                f"{what}: {path} was not read: {error}; convert it to .npz if it is yours to trust"
            )
        return read_npz(target, keys, what=what)


def run_limited(source: Path, target: Path, *keys: str, module: str = "avatargen.body.pickle") -> str | None:
    """Convert in a subprocess that runs a module; None, or what went wrong in one line."""
    root = Path(__file__).resolve().parents[2]
    # each of numpy's threads takes memory as it loads, before any limit but this could be set
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1", "PYTHONPATH": str(root)}
    command = [sys.executable, "-m", module, str(source), str(target), *keys]
    try:
        done = subprocess.run(
            command,
            env=environment,
            cwd=target.parent,
            capture_output=True,
            timeout=TIME_LIMIT_SECONDS,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return f"it took more than {TIME_LIMIT_SECONDS} seconds"
    if done.returncode == 0:
        return None
    lines = done.stderr.decode(errors="replace").strip().splitlines()
    return lines[-1][:300] if lines else f"the reader ended with status {done.returncode}"


class Inert:
    """Stands in for an object of a library: keeps the attributes the pickle gives it and does nothing."""


class ChumpyArray(Inert):
    """Stands in for chumpy.ch.Ch; its numbers are in `x`."""


class SparseColumns(Inert):
    """Stands in for scipy's csc_matrix; its parts are in `data`, `indices`, `indptr` and `_shape`."""


def reconstruct_array(kind: object, shape: object, code: object) -> np.ndarray:
    """An empty array for the pickle to fill; numpy's own only ever asks for shape (0,)."""
    if kind is not np.ndarray or shape != (0,):
        raise pickle.UnpicklingError("an array is built in an unusual way")
    return np.ndarray((0,), dtype=np.int8)


def array_from_buffer(
    buffer: object, dtype: object, shape: object, order: object, axes: object = None
) -> np.ndarray:
    """numpy's array for protocol 5."""
    if not isinstance(dtype, np.dtype) or dtype.hasobject or axes is not None:
        raise pickle.UnpicklingError("an array is built in an unusual way")
    return np.frombuffer(buffer, dtype=dtype).reshape(shape, order=order)  # pyright: ignore


def scalar(dtype: object, data: object) -> np.generic:
    """numpy's scalar, for plain numbers only."""
    if not isinstance(dtype, np.dtype) or dtype.kind not in "fiub":
        raise pickle.UnpicklingError("a scalar is no number")
    raw = data.encode("latin1") if isinstance(data, str) else data
    return np.frombuffer(raw, dtype=dtype, count=1)[0]  # pyright: ignore


def reconstruct_inert(kind: object, base: object, state: object) -> Inert:
    """copy_reg's reconstructor, for the stand-ins only."""
    if not (isinstance(kind, type) and issubclass(kind, Inert)) or base is not object:
        raise pickle.UnpicklingError("an object is built in an unusual way")
    return object.__new__(kind)


def encode_latin1(text: object, encoding: object = "latin1") -> bytes:
    """Bytes that Python 3 wrote as text into an old protocol."""
    if not isinstance(text, str) or encoding != "latin1":
        raise pickle.UnpicklingError("text is encoded in an unusual way")
    return text.encode("latin1")


ALLOWED = {
    **{(f"numpy.{core}.multiarray", "_reconstruct"): reconstruct_array for core in ("core", "_core")},
    **{(f"numpy.{core}.multiarray", "scalar"): scalar for core in ("core", "_core")},
    **{(f"numpy.{core}.numeric", "_frombuffer"): array_from_buffer for core in ("core", "_core")},
    ("numpy", "ndarray"): np.ndarray,
    ("numpy", "dtype"): np.dtype,
    ("scipy.sparse.csc", "csc_matrix"): SparseColumns,
    ("scipy.sparse._csc", "csc_matrix"): SparseColumns,
    ("chumpy.ch", "Ch"): ChumpyArray,
    **{(module, "_reconstructor"): reconstruct_inert for module in ("copy_reg", "copyreg")},
    **{(module, "object"): object for module in ("__builtin__", "builtins")},
    **{(module, "set"): set for module in ("__builtin__", "builtins")},
    ("_codecs", "encode"): encode_latin1,
}


class ArrayUnpickler(pickle.Unpickler):
    """An unpickler to which only the names in `ALLOWED` exist."""

    def find_class(self, module: str, name: str) -> object:
        if (module, name) not in ALLOWED:
            raise pickle.UnpicklingError(
                f"it asks for {module}.{name}, which is not on the list of harmless names"
            )
        return ALLOWED[module, name]


def read_pickle(path: Path, keys: Sequence[str] = KEYS) -> dict[str, np.ndarray]:
    """The arrays under these keys of a pickle, dense. Call it only under limits: see `convert_pickle`.

    Raises:
        pickle.UnpicklingError: the pickle asks for anything but arrays, or holds no mapping.
    """
    with path.open("rb") as stream:
        content = ArrayUnpickler(stream, encoding="latin1").load()
    if not isinstance(content, dict):
        raise pickle.UnpicklingError(f"it holds a {type(content).__name__}, not a mapping of arrays")
    return {key: dense(content[key], key) for key in keys if key in content}


def dense(value: object, key: str) -> np.ndarray:
    """A plain numeric array from an array, a number, a chumpy array or a sparse matrix."""
    if isinstance(value, ChumpyArray):
        value = getattr(value, "x", None)
    if isinstance(value, SparseColumns):
        value = dense_from_columns(value)
    if isinstance(value, int | float | np.generic):
        value = np.asarray(value)
    if not isinstance(value, np.ndarray) or value.dtype.kind not in "fiu":
        raise pickle.UnpicklingError(f"{key} is no array of numbers")
    return np.ascontiguousarray(value)


def dense_from_columns(sparse: SparseColumns) -> np.ndarray:
    """Expand compressed sparse columns, checking every index."""
    rows, columns = sparse._shape  # pyright: ignore
    data, indices, indptr = (np.asarray(getattr(sparse, name)) for name in ("data", "indices", "indptr"))
    sound = len(indptr) == columns + 1 and indptr[0] == 0 and indptr[-1] == len(indices) == len(data)
    if (
        not sound
        or (np.diff(indptr) < 0).any()
        or (len(indices) and not 0 <= indices.min() <= indices.max() < rows)
    ):
        raise pickle.UnpicklingError("a sparse matrix is damaged")
    matrix = np.zeros((rows, columns))
    np.add.at(matrix, (indices, np.repeat(np.arange(columns), np.diff(indptr))), data)
    return matrix


def limit_resources() -> None:
    """Bound this process's memory, processor time and file size: no pickle can exhaust the machine."""
    try:
        import resource
    except ImportError as error:
        raise InputError("limits need a POSIX system; convert the file to .npz there") from error
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY_LIMIT_BYTES, MEMORY_LIMIT_BYTES))
    resource.setrlimit(resource.RLIMIT_CPU, (TIME_LIMIT_SECONDS, TIME_LIMIT_SECONDS))
    resource.setrlimit(resource.RLIMIT_FSIZE, (MAX_PICKLE_BYTES, MAX_PICKLE_BYTES))


def main() -> int:
    """The subprocess: 0 when the .npz is written, 2 with one line on standard error otherwise."""
    source, target = map(Path, sys.argv[1:3])
    try:
        limit_resources()
        np.savez(target, **read_pickle(source, sys.argv[3:]))  # pyright: ignore
    except Exception as error:  # noqa: BLE001  a hostile pickle may raise anything; the parent reports the line
        sys.stderr.write(f"{type(error).__name__}: {error}"[:300].replace("\n", " ") + "\n")
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
