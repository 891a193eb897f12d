"""Write a file so that no reader ever sees half of it.

The bytes go to a part file beside the target, are flushed to disk, and take the target's name in one step. A
process that is killed on the way leaves the target as it was, and a part file that the next write to the same
target sweeps away: one process at a time writes a target, so what it finds there is of a dead one.
"""

import os
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import BinaryIO

from filelock import lock_descriptor

from avatargen.errors import InputError

Contents = bytes | Callable[[BinaryIO], None]
PART_SUFFIX = ".part"
PATIENCE = 60.0  # seconds to wait for another process that writes the same file


def write_atomically(path: str | Path, data: bytes) -> None:
    """Put `data` at `path`, whole or not at all; an existing file stays untouched on any failure.

    The file gets the permissions the umask allows; a symbolic link is followed, not replaced.

    Raises:
        InputError: the folder is missing, is no folder, is not writable, or the disk is full.
    """
    write_together([(path, data)])


def write_together(files: Sequence[tuple[str | Path, Contents]]) -> None:
    """Write several files as `write_atomically` does: none takes its name before all are safe on disk.

    A file is its bytes, or what writes them to a stream where they are too many to hold.
    They take their names in the order given, microseconds apart, so the one that names the others comes last.

    Raises:
        InputError: one of them cannot be written, and then none is; or two are the same file.
    """
    targets = different_targets([path for path, _ in files])
    with ExitStack() as parts:
        for target in sorted(targets):  # in one order, so that no two processes wait for each other
            parts.enter_context(only_writer(target, PATIENCE))
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


def different_targets(paths: Sequence[str | Path]) -> list[Path]:
    """The real places of files that are to be written. Raises InputError where two are the same."""
    targets = [resolve_target(path) for path in paths]
    if len(set(targets)) < len(targets):
        raise InputError(f"cannot write {', '.join(map(str, paths))}: two are the same file")
    return targets


def stage(path: str | Path, target: Path, data: Contents, parts: ExitStack) -> Path:
    """Put the data of the target's only writer in a part file beside it, on the disk; `parts` removes it if
    it is still there."""
    sweep_leftovers(target)
    try:
        handle, name = tempfile.mkstemp(prefix=part_prefix(target), suffix=PART_SUFFIX, dir=target.parent)
        part = Path(name)
        parts.callback(part.unlink, missing_ok=True)
        with os.fdopen(handle, "wb") as stream:
            data(stream) if callable(data) else stream.write(data)
            stream.flush()
            part.chmod(target_mode(target))
            os.fsync(stream.fileno())
    except OSError as error:
        raise unwritable(path, error) from error
    return part


@contextmanager
def only_writer(target: Path, patience: float = 0.0) -> Iterator[None]:
    """Hold the target's lock, a file beside it; of a process that is killed the system lets go.

    Raises:
        InputError: another process holds it for longer than `patience` (seconds), or it cannot be made.
    """
    path = target.parent / f"{part_prefix(target)}lock"
    latest = time.monotonic() + patience
    while (handle := take_lock(target, path)) is None:
        if time.monotonic() > latest:
            raise InputError(f"{target} is being written by another process; wait for it to end")
        time.sleep(0.01)
    try:
        yield
    finally:
        removed = remove_lock(path)
        os.close(handle)
        if not removed:  # Windows keeps what is open
            remove_lock(path)


def take_lock(target: Path, path: Path) -> int | None:
    """The open lock file, locked; None while another process has it. Raises InputError as `only_writer`."""
    try:
        handle = os.open(path, os.O_RDWR | os.O_CREAT, 0o666)
    except OSError as error:
        raise unwritable(target, error) from error
    try:
        if lock_descriptor(handle, blocking=False) and os.path.samestat(os.fstat(handle), os.stat(path)):
            return handle
    except FileNotFoundError:  # its last holder has removed it meanwhile
        pass
    except OSError as error:
        os.close(handle)
        raise unwritable(target, error) from error
    os.close(handle)
    return None


def remove_lock(path: Path) -> bool:
    try:
        path.unlink()
    except OSError:
        return False
    return True


def check_writable(path: str | Path) -> None:
    """Find out before long work whether `write_atomically(path, ...)` can succeed; leaves nothing behind.

    Raises:
        InputError: it cannot, for the reasons given there.
    """
    target = resolve_target(path)
    try:
        with tempfile.TemporaryFile(dir=target.parent) as probe:
            probe.write(b"x")
    except OSError as error:
        raise unwritable(path, error) from error


def resolve_target(path: str | Path) -> Path:
    """The real place `path` points at. Raises InputError where no regular file can stand there."""
    try:
        target = Path(path).resolve()
        if target.is_symlink():  # what Python 3.13 makes of a loop; until then it is an error
            raise InputError(f"cannot write {path}: it is a loop of links; give the name of a file")
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
                os.unlink(entry.path)
    except OSError:
        return  # a folder that cannot be listed or swept may still be written to; the write itself will tell


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
