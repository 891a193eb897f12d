"""Read arrays from .npz files that nobody vouches for: headers are checked before data is read."""

import io
import zipfile
import zlib
from pathlib import Path
from tokenize import TokenError

import numpy as np
from numpy.lib import format as npy

from avatargen.errors import InputError

MAX_FILE_BYTES = 1 << 28  # of all members read; SMPL-X with 400 shapes in float64 takes 0.23 GB
MAX_NUMBERS = MAX_FILE_BYTES // 8  # of all members: readers make them float64, whatever the file holds
READ_BYTES = 1 << 20  # at a time, so that unpacking takes no more memory than the array
MAX_HEADER_BYTES = 4096
MAX_MEMBERS = 1000
KINDS = "fiuU"  # floats, integers, text; never objects


def read_npz(path: Path, keys: tuple[str, ...], what: str, most: int = MAX_NUMBERS) -> dict[str, np.ndarray]:
    """Read those of `keys` that the file holds; every other member is left unread.

    `most` numbers are read, and eight times as many bytes.

    A member is read only if its header is a plain numeric or text array whose size is that of the stored
    data, within the limit: a forged header cannot ask for memory.

    Raises:
        InputError: missing, unreadable or damaged file, or a member whose header does not fit its data.
    """
    try:
        with zipfile.ZipFile(path) as archive:
            if len(archive.infolist()) > MAX_MEMBERS:
                raise InputError(
                    f"{what}: {path} holds {len(archive.infolist())} members; at most {MAX_MEMBERS} are read"
                )
            members = {info.filename: info for info in archive.infolist()}
            wanted = {key: members[f"{key}.npy"] for key in keys if f"{key}.npy" in members}
            total = sum(info.file_size for info in wanted.values())
            if total > 8 * most:
                raise InputError(
                    f"{what}: {path} says it holds {total:.3g} bytes; at most {8 * most:.3g} are read"
                )
            arrays = {key: read_member(archive, info, what) for key, info in wanted.items()}
    except OSError as error:
        raise InputError(f"{what}: cannot read {path}: {error.strerror or error}; check the path") from error
    except (
        zipfile.BadZipFile,
        zlib.error,
        EOFError,
        NotImplementedError,
        RuntimeError,
        UnicodeError,
    ) as error:
        raise InputError(
            f"{what}: {path} is no whole .npz file ({error}); save it again with numpy.savez"
        ) from error
    if (numbers := sum(array.size for array in arrays.values())) > most:
        raise InputError(f"{what}: {path} holds {numbers:.3g} numbers; at most {most:.3g} are read")
    return arrays


def read_member(archive: zipfile.ZipFile, info: zipfile.ZipInfo, what: str) -> np.ndarray:
    """Read one .npy member after checking its header against its stored size."""
    with archive.open(info) as stream:
        head = io.BytesIO(stream.read(MAX_HEADER_BYTES + 12))
        shape, fortran_order, dtype = read_header(head, f"{what}: {info.filename}")
        if dtype.kind not in KINDS or dtype.hasobject or not dtype.itemsize:
            raise InputError(f"{what}: {info.filename} holds {dtype}; only numbers and text are read")
        count = 1
        for length in shape:
            count *= length  # Python integers: no overflow
        stored = info.file_size - head.tell()
        if min(shape, default=0) < 0 or count * dtype.itemsize != stored:
            raise InputError(
                f"{what}: {info.filename} says {dtype} {shape} but stores {stored} bytes; the file is damaged"
            )
        data, filled = np.empty(stored, dtype=np.uint8), 0
        for part in iter(lambda: head.read() or stream.read(READ_BYTES), b""):
            data[filled : filled + len(part)] = np.frombuffer(part, dtype=np.uint8)
            filled += len(part)
    if filled != stored:
        raise InputError(
            f"{what}: {info.filename} ends after {filled} of {stored} bytes; the file is cut off"
        )
    array = data.view(dtype)
    return array.reshape(shape, order="F" if fortran_order else "C")


def read_header(stream: io.BytesIO, what: str) -> tuple[tuple[int, ...], bool, np.dtype]:
    """Shape, order and type from an .npy header of version 1 or 2.

    Raises:
        InputError: anything that is not such a header.
    """
    readers = {(1, 0): npy.read_array_header_1_0, (2, 0): npy.read_array_header_2_0}
    try:
        version = npy.read_magic(stream)
        if version not in readers:
            raise InputError(f"{what}: .npy version {version} is not read; save it again with numpy.savez")
        return readers[version](stream, max_header_size=MAX_HEADER_BYTES)
    except InputError:
        raise
    except (ValueError, SyntaxError, TypeError, RecursionError, MemoryError, KeyError, TokenError) as error:
        raise InputError(
            f"{what}: its .npy header is damaged ({error}); save it again with numpy.savez"
        ) from error
