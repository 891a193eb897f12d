"""Names of pictures as labels and keypoints give them, to the photographs that are there.

A photograph's name is its path below the folder, without suffix. Others may leave folders out, put some
before or say a number alone, as COCO does: 397133 is 000000397133.jpg.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import PurePosixPath
from typing import TypeVar

from avatargen.errors import InputError

Value = TypeVar("Value")
SUFFIXES = (".png", ".jpg", ".jpeg", ".webp", ".bmp", ".tif", ".tiff")


def without_suffix(name: object) -> str:
    """A picture's name without its suffix; what follows another dot belongs to it."""
    path = PurePosixPath(str(name).replace("\\", "/"))
    return str(path.with_suffix("")) if path.suffix.lower() in SUFFIXES else str(path)


def parts(name: str) -> tuple[str, ...]:
    """The last part of a name, a number without zeros before it; then its folders from the inside out."""
    last, *folders = reversed(name.split("/"))
    return (last.lstrip("0") or "0" if last.isascii() and last.isdigit() else last, *folders)


def given_to(photographs: Sequence[str], found: Mapping[str, Value], what: str) -> dict[str, Value]:
    """What was found for each photograph that is meant: by the whole name; else by its end, where one name
    is the end of the other, no other entry's is, and the entry is of no other photograph.

    Raises:
        InputError: there are entries, and none is of a photograph.
    """
    alike: dict[str, list[str]] = {}  # entries by the last part of their names
    for entry in found:
        alike.setdefault(parts(entry)[0], []).append(entry)
    meant = {name: name for name in photographs if name in found}
    ends = {}
    for name in photographs:
        entries = [one for one in alike.get(parts(name)[0], ()) if one not in meant and is_end(name, one)]
        if name not in meant and len(entries) == 1:
            ends[name] = entries[0]
    times = Counter(ends.values())
    meant |= {name: entry for name, entry in ends.items() if times[entry] == 1}
    if found and not meant:
        raise InputError(
            f"data prepare: the {what} name pictures such as {next(iter(found))!r}, and the photographs are "
            f"called {photographs[0]!r}; name them alike"
        )
    return {name: found[entry] for name, entry in meant.items()}


def is_end(a: str, b: str) -> bool:
    """Whether one name is the end of the other."""
    return all(one == other for one, other in zip(parts(a), parts(b), strict=False))
