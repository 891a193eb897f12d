"""A folder that holds one run, which the same command continues: whose it is, by what it was made from, and
where its log goes on.

The settings stand in a file of the folder. Files that a run reads enter them by their contents (`digest`,
`digest_files`), arrays by their numbers (`digest_arrays`), so a changed one is another run.
"""

import hashlib
import json
import os
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np

from avatargen.atomic import write_atomically
from avatargen.errors import InputError

NAMED = 3  # differences that a refusal tells
LONGEST = 40  # characters of a value that it shows


def claim(
    folder: Path,
    name: str,
    settings: Mapping[str, Any],
    command: str,
    *,
    made: Sequence[str],
    free: Sequence[str] = (),
) -> None:
    """Make the folder this run's, or see that it is: its settings stand in the file `name`.

    `made` are patterns of names that a folder without settings must not hold, as they would be another
    run's; names that start with a dot do not count. `free` are settings, by dotted names, that may change
    from call to call.

    Raises:
        InputError: it is another run's, which differs in what the message names; or it cannot be used.
    """
    wanted = json.loads(json.dumps(settings))  # tuples become lists, as in the file
    path = folder / name
    try:
        folder.mkdir(parents=True, exist_ok=True)
        found = json.loads(path.read_bytes()) if path.exists() else None
        others = sorted(
            entry.name for one in made for entry in folder.glob(one) if not entry.name.startswith(".")
        )
    except (OSError, ValueError, RecursionError) as error:
        reason = str(error)[:200]
        raise InputError(f"{command}: cannot use {folder} ({reason}); name another folder") from error
    if found is None and others:
        raise InputError(
            f"{command}: {folder} holds other files, such as {others[0]}, and no {name} that says whose they "
            "are; name an empty or a new folder"
        )
    if found is not None and not isinstance(found, dict):
        raise InputError(f"{command}: cannot use {folder} ({name} is damaged); name another folder")
    told = [] if found is None else differences(leave_out(found, free), leave_out(wanted, free))
    if told:
        more = f" and {len(told) - NAMED} more" if len(told) > NAMED else ""
        raise InputError(
            f"{command}: {folder} was made with other settings: {', '.join(told[:NAMED])}{more}; name "
            "another folder"
        )
    if found != wanted:
        write_atomically(path, json.dumps(wanted, indent=1, sort_keys=True).encode() + b"\n")


def leave_out(settings: dict[str, Any], names: Sequence[str]) -> dict[str, Any]:
    """The settings by dotted names, groups laid flat, without some."""
    return {name: value for name, value in flat(settings) if name not in names}


def flat(settings: dict[str, Any], group: str = "") -> Iterator[tuple[str, Any]]:
    for name, value in settings.items():
        if isinstance(value, dict) and value:
            yield from flat(value, f"{group}{name}.")
        else:
            yield group + name, value


def differences(found: dict[str, Any], wanted: dict[str, Any]) -> list[str]:
    """What differs, in words."""
    names = [name for name in {**wanted, **found} if found.get(name, ...) != wanted.get(name, ...)]
    return [in_words(name, found.get(name, ...), wanted.get(name, ...)) for name in names]


def in_words(name: str, found: Any, wanted: Any) -> str:
    old, new = ("not told" if value is ... else json.dumps(value) for value in (found, wanted))
    if max(len(old), len(new)) > LONGEST:
        return f"{name} has other contents"
    return f"{name} {old}, now {new}"


def cut_log(path: Path, counter: str, reached: int, command: str) -> None:
    """Drop the lines behind a state, and a torn last one: the continued run writes them again. Each line is
    a JSON object whose `counter` says how far the run was.

    Raises:
        InputError: a whole line is none of a log.
    """
    if not path.exists():
        return
    whole = [line for line in path.read_bytes().splitlines(keepends=True) if line.endswith(b"\n")]
    try:
        kept = [line for line in whole if json.loads(line)[counter] <= reached]
    except (KeyError, TypeError, ValueError, RecursionError) as error:
        reason = str(error)[:200]
        raise InputError(f"{command}: {path} is damaged ({reason}); name another folder") from error
    write_atomically(path, b"".join(kept))


def digest(path: Path) -> str:
    """Of the contents of a file, or of all in a folder. Raises InputError where it cannot be read."""
    if path.is_dir():
        return digest_files(path, sorted(each for each in path.rglob("*") if each.is_file()))
    try:
        with path.open("rb") as stream:
            return hashlib.file_digest(stream, "sha256").hexdigest()
    except OSError as error:
        raise InputError(f"found no file {path}; check the path") from error


def digest_files(folder: Path, files: Sequence[Path]) -> str:
    """Of files below a folder, by their names there and their contents; what is missing counts as such.

    Raises:
        InputError: one cannot be read.
    """
    with ThreadPoolExecutor(os.cpu_count()) as threads:  # files are read and hashed outside Python's lock
        found = threads.map(lambda file: digest(file) if file.exists() else "missing", files)
        whole = hashlib.sha256()
        for file, contents in zip(files, found, strict=True):
            whole.update(os.fsencode(file.relative_to(folder).as_posix()) + f" {contents}\n".encode())
    return whole.hexdigest()


def digest_arrays(values: Mapping[str, Any]) -> str:
    """Of arrays by name, and of whatever else JSON holds."""
    whole = hashlib.sha256()
    for name, value in sorted(values.items()):
        if isinstance(value, np.ndarray):
            whole.update(f"{name} {value.dtype} {value.shape}\n".encode() + np.ascontiguousarray(value).data)
        else:
            whole.update(f"{name} {json.dumps(value)}\n".encode())
    return whole.hexdigest()
