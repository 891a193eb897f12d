"""What a request says, as plain values by field name: for the settings that a folder of many avatars keeps,
for the report and for the dry run.

Groups of settings inside a request (`BuildConfig`, `Encoding`) are laid flat, so no two fields may share a
name.
"""

from collections.abc import Callable, Iterator
from dataclasses import Field, fields, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np

from avatargen import __version__
from avatargen.export.request import NO_BYTE, ExportRequest
from avatargen.run_folder import digest, digest_arrays

OfFile = Callable[[Path], str]  # what stands for a file


def fingerprint(request: ExportRequest) -> dict[str, object]:
    """All that the bytes of a seed's files depend on; files enter by their contents, not by their paths.

    Raises:
        InputError: a file that the request names cannot be read.
    """
    found = {
        each.name: plain(value, digest) for each, value in settings(request) if NO_BYTE not in each.metadata
    }
    return {"version": __version__} | found


def facts(request: ExportRequest) -> dict[str, object]:
    """Every setting in words, files by their paths."""
    return {each.name: plain(value, str) for each, value in settings(request)}


def settings(group: Any) -> Iterator[tuple[Field[Any], Any]]:
    """Every field with its value, those of groups inside as well."""
    for each in fields(group):
        value = getattr(group, each.name)
        if is_dataclass(value):
            yield from settings(value)
        else:
            yield each, value


def plain(value: Any, of_file: OfFile) -> object:
    """A value as JSON holds it. Several files go by their names, from which animations have theirs.

    Raises:
        TypeError: there is no rule for such a value.
    """
    if value is None or isinstance(value, str | int | float):
        return value
    if isinstance(value, Path):
        return of_file(value)
    if isinstance(value, range):
        return [value.start, value.stop, value.step]
    if isinstance(value, tuple):
        if value and all(isinstance(item, Path) for item in value):
            return {path.stem: of_file(path) for path in value}
        return [plain(item, of_file) for item in value]
    if isinstance(value, np.ndarray):
        return digest_arrays({"array": value})
    raise TypeError(f"a request holds {value!r}, for which there is no rule; give it one here")
