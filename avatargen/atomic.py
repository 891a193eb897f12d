"""Write a file so that no reader ever sees half of it.

The bytes go to a part file beside the target, are flushed to disk, and take the target's name in one step. A
process that is killed on the way leaves the target as it was, and a part file that the next write to the same
target sweeps away: a living writer holds a lock on its part file, a dead one cannot.
"""

import fcntl
import os
import tempfile
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path

from avatargen.errors import InputError

PART_SUFFIX = ".part"


def write_atomically(path: str | Path, data: bytes) -> None:
    """Put `data` at `path`, whole or not at all; an existing file stays untouched on any failure.

    The file gets the permissions the umask allows; a symbolic link is followed, not replaced.

    Raises:
        InputError: the folder is missing, is no folder, is not writable, or the disk is full.
    """
    write_together([(path, data)])


def write_together(files: Sequence[tuple[str | Path, bytes]]) -> None:
    """Write several files as `write_atomically` does: none takes its name before all are safe on disk.

    They take their names in the order given, microseconds apart, so the one that names the others comes last.

    Raises:
        InputError: one of them cannot be written, and then none is; or two are the same file.
    """
    targets = [resolve_target(path) for path, _ in files]
    if len(set(targets)) < len(targets):
        raise InputError(f"cannot write {', '.join(str(path) for path, _ in files)}: two are the same file")
    with ExitStack() as parts:
        staged = [
            stage(path, target, data, parts) for (path, data), target in zip(files, targets, strict=True)
        ]
        for (path, _), target, part in zip(files, targets, staged, strict=True):
            try:
                os.replace(part, target)
            except OSError as error:
                raise unwritable(path, error) from error
        for folder in {target.parent for target in targets}:
            flush_folder(folder)


def stage(path: str | Path, target: Path, data: bytes, parts: ExitStack) -> Path:
    """Put the data in a part file beside the target, on the disk; `parts` removes it if it is still there."""
    sweep_leftovers(target)
    try:
        handle, name = tempfile.mkstemp(prefix=part_prefix(target), suffix=PART_SUFFIX, dir=target.parent)
        part = Path(name)
        parts.callback(part.unlink, missing_ok=True)
        with os.fdopen(handle, "wb") as stream:
            fcntl.flock(stream, fcntl.LOCK_EX)
            stream.write(data)
            stream.flush()
            os.fchmod(stream.fileno(), target_mode(target))
            os.fsync(stream.fileno())
    except OSError as error:
        raise unwritable(path, error) from error
    return part


def check_writable(path: str | Path) -> None:
    """Find out before long work whether `write_atomically(path, ...)` can succeed; leaves nothing behind.

    Raises:
        InputError: it cannot, for the reasons given there.
    """
    target = resolve_target(path)
    try:
        with tempfile.NamedTemporaryFile(
            prefix=part_prefix(target), suffix=PART_SUFFIX, dir=target.parent
        ) as probe:
            probe.write(b"x")
    except OSError as error:
        raise unwritable(path, error) from error


def resolve_target(path: str | Path) -> Path:
    """The real place `path` points at. Raises InputError where no regular file can stand there."""
    try:
        target = Path(path).resolve()
        if target.is_dir():
            raise InputError(f"cannot write {path}: it is a folder; give the name of a file")
        if target.exists() and not target.is_file():
            raise InputError(f"cannot write {path}: it is a device or pipe; give the name of a plain file")
    except (OSError, ValueError, RuntimeError) as error:  # a loop of links, a null byte, a name too long
        if isinstance(error, InputError):
            raise
        raise InputError(
            f"cannot write {str(path)!r}: {error}; give the name of a file in a writable folder"
        ) from error
    return target


def unwritable(path: str | Path, error: OSError) -> InputError:
    reason = error.strerror or str(error)
    return InputError(f"cannot write {path}: {reason}; choose a place that exists, is writable and has room")


def part_prefix(target: Path) -> str:
    """Names no other target's leftovers: the length tells `a` from `a.b`. Short enough for any disk."""
    name = os.fsencode(target.name)[:150].decode(errors="ignore")
    return f".{name}.{len(target.name)}-"


def sweep_leftovers(target: Path) -> None:
    """Remove part files of this target that a killed process left behind."""
    try:
        for entry in list(os.scandir(target.parent)):
            if entry.name.startswith(part_prefix(target)) and entry.name.endswith(PART_SUFFIX):
                remove_unlocked(entry.path)
    except OSError:
        return  # a folder that cannot be listed or swept may still be written to; the write itself will tell


def remove_unlocked(part: str) -> None:
    with open(part, "rb") as stream:
        try:
            fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return  # another process is writing it now
        os.unlink(part)


def target_mode(target: Path) -> int:
    """The mode of the file that is replaced, or what the umask allows for a new one."""
    if target.exists():
        return target.stat().st_mode & 0o777
    umask = os.umask(0)
    os.umask(umask)
    return 0o666 & ~umask


def flush_folder(folder: Path) -> None:
    """Make the new name itself survive a power cut, where the system can flush folders."""
    try:
        handle = os.open(folder, os.O_RDONLY)
    except OSError:
        return
    try:
        os.fsync(handle)
    except OSError:
        return
    finally:
        os.close(handle)
