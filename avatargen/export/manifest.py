"""The list of what a run over many seeds has made: manifest.jsonl, one JSON object a line and seed.

Lines are only ever added, each in one write that is flushed to disk. A later line of a seed takes the place
of an earlier one. What a killed run left of its last line is cut off by the next run. A lock keeps two runs
from one folder.
"""

import hashlib
import json
import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass, fields
from io import FileIO
from pathlib import Path

from avatargen.atomic import only_writer, unwritable
from avatargen.errors import InputError
from avatargen.run_folder import claim

NAME, SETTINGS_NAME = "manifest.jsonl", "settings.json"


@dataclass(frozen=True, kw_only=True)
class Row:
    """One seed's outcome: a file, or the reason why there is none."""

    seed: int
    file: str | None = None  # name in the folder
    sha256: str | None = None  # of its bytes
    bytes: int | None = None  # with the files beside it
    faces: int | None = None
    error_mm: dict[str, float] | None = None  # mesh to field: mean, p99, max
    height_m: float | None = None  # of the body, crown of the head to the soles
    error: str | None = None
    seconds: float = 0.0


@dataclass(frozen=True)
class Manifest:
    """An open, locked manifest and what it held when it was opened."""

    folder: Path
    stream: FileIO  # at its end, without a buffer
    rows: dict[int, Row]

    def add(self, row: Row) -> None:
        """Append a line and flush it to disk. Raises InputError where the disk is full."""
        line = json.dumps(asdict(row)).encode() + b"\n"
        try:
            if self.stream.write(line) < len(line):
                raise OSError(0, "the disk is full")
            os.fsync(self.stream.fileno())
        except OSError as error:
            raise unwritable(self.folder / NAME, error) from error
        self.rows[row.seed] = row

    def holds(self, seed: int) -> bool:
        """The seed's file is there, whole and as it was written."""
        row = self.rows.get(seed)
        if row is None or row.file is None or row.error is not None:
            return False
        try:
            return hashlib.sha256((self.folder / row.file).read_bytes()).hexdigest() == row.sha256
        except (OSError, ValueError):  # ValueError: no name of a file
            return False


@contextmanager
def open_manifest(folder: Path, settings: dict[str, object]) -> Iterator[Manifest]:
    """The folder's manifest, made with its folder where there is none.

    Raises:
        InputError: the folder cannot be written, was made with other settings, is in use or is damaged.
    """
    path = folder / NAME
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise unwritable(path, error) from error
    with only_writer(path), open_end(path) as stream:
        rows = read_rows(path, stream)
        claim(folder, SETTINGS_NAME, settings, "batch", made=[NAME] if rows else [])
        yield Manifest(folder, stream, rows)


def open_end(path: Path) -> FileIO:
    """The file to append to, made where there is none. Raises InputError where it cannot be opened."""
    try:
        return path.open("ab", buffering=0)
    except OSError as error:
        raise unwritable(path, error) from error


def read_rows(path: Path, stream: FileIO) -> dict[int, Row]:
    """Every whole line's row, the last of each seed; half a line at the end is cut off.

    Raises:
        InputError: a whole line is no row.
    """
    data = path.read_bytes()
    whole = data.rfind(b"\n") + 1
    if whole < len(data):
        stream.truncate(whole)
    rows = {}
    for number, line in enumerate(data[:whole].splitlines(), start=1):
        row = parse_row(line)
        if row is None:
            raise InputError(
                f"{path}: line {number} is no row of a manifest; remove it or use another folder"
            )
        rows[row.seed] = row
    return rows


def parse_row(line: bytes) -> Row | None:
    """The row of a line, or None."""
    try:
        found = json.loads(line)
    except (ValueError, RecursionError):
        return None
    names = {field.name for field in fields(Row)}
    if not isinstance(found, dict) or set(found) != names or type(found["seed"]) is not int:
        return None
    if not is_number(found["seconds"]) or not (found["height_m"] is None or is_number(found["height_m"])):
        return None
    for kind, optional in (
        (str, ("file", "sha256", "error")),
        (int, ("bytes", "faces")),
        (dict, ("error_mm",)),
    ):
        if any(found[name] is not None and type(found[name]) is not kind for name in optional):
            return None
    if found["file"] is not None and Path(found["file"]).name != found["file"]:
        return None
    if not all(map(is_number, (found["error_mm"] or {}).values())):
        return None
    error_mm = found["error_mm"] and {name: float(value) for name, value in found["error_mm"].items()}
    height_m = None if found["height_m"] is None else float(found["height_m"])
    seconds = float(found["seconds"])
    return Row(**found | {"seconds": seconds, "error_mm": error_mm, "height_m": height_m})


def is_number(value: object) -> bool:
    """A number that JSON can hold as such."""
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < 1e300
