"""Labels in pickles (`eva3d`), read without running what they hold.

A pickle is a program; `avatargen.body.pickle` says how its arrays are had safely. Many are read in one
subprocess under limits:

    python -m avatargen.data.pickles paths.json rows.npz

where `paths.json` lists them, and `rows.npz` holds under each one's number its row or, as text, why there is
none. A pickle that breaks a limit takes the others of its list with it; all are then read one by one.
"""

import json
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from jaxtyping import Float64

from avatargen.body.arrays import read_npz
from avatargen.body.pickle import ArrayUnpickler, limit_resources, run_limited
from avatargen.errors import InputError

SIZES = {"camera_rotation": 9, "camera_translation": 3, "global_orient": 3, "body_pose": 69, "betas": 10}
LARGEST = 1 << 20  # bytes of one label

Row = Float64[np.ndarray, " _"] | str  # numbers as `avatargen.data.conventions` wants them, or what is wrong


def read_rows(paths: Sequence[Path]) -> list[Row]:
    """The row of each pickle, or why there is none."""
    with tempfile.TemporaryDirectory(prefix="avatargen-labels-") as folder:
        source, target = Path(folder) / "paths.json", Path(folder) / "rows.npz"
        source.write_text(json.dumps([str(path.resolve()) for path in paths]))
        error = run_limited(source, target, module="avatargen.data.pickles")
        if error is None:
            keys = tuple(f"{i}" for i in range(len(paths)))
            rows = read_npz(target, keys, what="label")
            return [str(rows[key]) if rows[key].dtype.kind == "U" else rows[key] for key in keys]
    if len(paths) == 1:
        return [f"label: {paths[0]} was not read: {error}"]
    return [read_rows([path])[0] for path in paths]


def read_row(path: Path) -> Row:
    """One pickle's row; only in the subprocess."""
    try:
        if path.stat().st_size > LARGEST:
            return f"label: {path} has {path.stat().st_size:.3g} bytes; a label has at most {LARGEST:.3g}"
        with path.open("rb") as stream:
            content = ArrayUnpickler(stream, encoding="latin1").load()
        parts = [np.asarray(content[name]) for name in SIZES]
        if any(part.dtype.kind not in "fiu" for part in parts):
            return f"label: {path} holds something else than numbers"
        if [part.size for part in parts] != list(SIZES.values()):
            return f"label: {path} holds {[part.size for part in parts]} numbers, not {list(SIZES.values())}"
        return np.concatenate([part.ravel() for part in parts]).astype(np.float64)
    except Exception as error:  # noqa: BLE001  a hostile pickle may raise anything; the picture is skipped for it
        return f"label: {path} was not read: {type(error).__name__}: {error}"[:300].replace("\n", " ")


def main() -> int:
    """The subprocess."""
    source, target = map(Path, sys.argv[1:])
    try:
        limit_resources()
    except InputError as error:
        sys.stderr.write(str(error))
        return 2
    rows = {f"{i}": read_row(Path(line)) for i, line in enumerate(json.loads(source.read_text()))}
    np.savez(target, **rows)  # pyright: ignore[reportArgumentType]
    return 0


if __name__ == "__main__":
    sys.exit(main())
