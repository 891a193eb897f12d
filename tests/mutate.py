"""Files that went wrong, or were made to do harm: seeded mutations, and a reader held to its limits.

A reader may refuse a file with one of our own errors, or give something sound; anything else that it raises,
more than `SECONDS` of processor time or more than `BYTES` of new memory in one case fails the test.
"""

import io
import json
import resource
import signal
import struct
import tempfile
import zipfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from avatargen.errors import AvatarGenError

COUNT = 2000
SECONDS = 5.0
BYTES = 1 << 30
Mutator = Callable[[bytes, np.random.Generator], bytes]
NUMBERS = (
    b"\xff" * 8,
    b"\xff\xff\xff\x7f",
    b"\x00" * 8,
    b"\x00\x00\x00\x80",
    b"\xff" * 4,
    b"\x7f\xf0" + b"\x00" * 6,
)
VALUES: tuple[Any, ...] = (
    None, True, -1, 0, 0.5, 2**31, 2**63, 10**30, 10**400, -(10**30), float("nan"), float("inf"), 1e308,
    "", "x", "../../etc/passwd", "\0", "NaN", "x" * 5000, [], [[]], {}, {"a": 1}, [0] * 5000, [1e400],
)  # fmt: skip
SHAPES = ((1 << 40,), (-1,), (1 << 20, 1 << 20), (0, 3), (3,), (), (2**62, 4), (1,) * 40, (24, 3, 3))
TYPES = (
    "<f4",
    "<f8",
    "|O",
    "<U100000000",
    "|u1",
    "<c16",
    "<i8",
    "|V8",
    "<M8[s]",
    ">f4",
    "|b1",
    "[('a','<f4')]",
)


def bytes_changed(whole: bytes, rng: np.random.Generator) -> bytes:
    """Bytes changed, cut out, put in, doubled or cut off, or a number overwritten by an extreme one."""
    data = bytearray(whole)
    place, length = int(rng.integers(len(data))), int(rng.integers(1, 64))
    match int(rng.integers(6)):
        case 0:
            for spot in rng.integers(len(data), size=rng.integers(1, 9)):
                data[spot] = rng.integers(256)
        case 1:
            del data[place : place + length]
        case 2:
            data[place:place] = rng.bytes(length)
        case 3:
            data[place:place] = data[place : place + length]
        case 4:
            number = NUMBERS[rng.integers(len(NUMBERS))]
            data[place : place + len(number)] = number
        case _:
            del data[place:]
    return bytes(data)


def json_changed(whole: bytes, rng: np.random.Generator) -> bytes:
    """One value of the document replaced, dropped, renamed, doubled or buried deep."""
    document = json.loads(whole)
    container, key = random_place(document, rng)
    match int(rng.integers(6)):
        case 0 | 1 | 2:
            container[key] = VALUES[rng.integers(len(VALUES))]
        case 3:
            del container[key]
        case 4 if isinstance(container, dict):
            container[f"{key}x"] = container.pop(key)
        case 4:
            container += container[:50]
        case _:
            marker = "deep inside"
            container[key] = marker
            deep = "[" * 50_000 + "]" * 50_000
            return json.dumps(document).replace(f'"{marker}"', deep).encode()
    return json.dumps(document).encode()


def random_place(document: Any, rng: np.random.Generator) -> tuple[Any, Any]:
    """A container of the document and one of its keys; every depth is as likely."""
    found, node = [], document
    while isinstance(node, dict | list) and len(node):
        keys = list(node) if isinstance(node, dict) else range(len(node))
        key = keys[int(rng.integers(len(keys)))]
        found.append((node, key))
        node = node[key]
    return found[int(rng.integers(len(found)))]


def npz_changed(whole: bytes, rng: np.random.Generator) -> bytes:
    """An archive whose checksums are right and one of whose members is not: header, numbers or name."""
    members = unpacked(whole)
    name = list(members)[int(rng.integers(len(members)))]
    match int(rng.integers(5)):
        case 0:
            members[name] = bytes_changed(members[name], rng)
        case 1 | 2:
            members[name] = forged_header(members[name], rng)
        case 3:
            members[name] = numbers_changed(members[name], rng)
        case _:
            other = list(members)[int(rng.integers(len(members)))]
            members[name], members[other] = members[other], members[name]
    return packed(members)


def unpacked(whole: bytes) -> dict[str, bytes]:
    with zipfile.ZipFile(io.BytesIO(whole)) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


def packed(members: dict[str, bytes], kind: int = zipfile.ZIP_STORED) -> bytes:
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", kind) as archive:
        for name, data in members.items():
            archive.writestr(name, data)
    return stream.getvalue()


def forged_header(member: bytes, rng: np.random.Generator) -> bytes:
    """An .npy with another shape, type or header than its data has."""
    array = np.load(io.BytesIO(member))
    shape, kind = repr(array.shape), repr(array.dtype.str)
    match int(rng.integers(4)):
        case 0:
            shape = repr(SHAPES[rng.integers(len(SHAPES))])
        case 1:
            kind = repr(TYPES[rng.integers(len(TYPES))])
        case 2:
            shape = "(" * 900 + ")" * 900
        case _:
            kind = "__import__('os').abort()"
    return npy(f"{{'descr': {kind}, 'fortran_order': False, 'shape': {shape}, }}", array.tobytes())


def npy(header: str, data: bytes) -> bytes:
    text = header.encode() + b" " * (-(len(header) + 11) % 64) + b"\n"
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(text)) + text + data


def numbers_changed(member: bytes, rng: np.random.Generator) -> bytes:
    """Sound bytes, unsound numbers."""
    array = np.load(io.BytesIO(member)).copy()
    if array.size and array.dtype.kind in "fiu":
        extreme = (
            [np.nan, np.inf, -1e38, 0, 1e30] if array.dtype.kind == "f" else [0, np.iinfo(array.dtype).max]
        )
        array.reshape(-1)[rng.integers(array.size, size=rng.integers(1, 4))] = extreme[
            rng.integers(len(extreme))
        ]
    stream = io.BytesIO()
    np.save(stream, array)
    return stream.getvalue()


def bomb(name: str, shape: tuple[int, ...], kind: str) -> bytes:
    """An archive of a few hundred kilobytes that unpacks to an array of zeros of any size."""
    header = npy(f"{{'descr': '{kind}', 'fortran_order': False, 'shape': {shape}, }}", b"")
    stream = io.BytesIO()
    with (
        zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive,
        archive.open(f"{name}.npy", "w") as member,
    ):
        member.write(header)
        left = int(np.prod(shape)) * np.dtype(kind).itemsize
        while left > 0:
            left -= member.write(bytes(min(left, 1 << 24)))
    return stream.getvalue()


def mutations(whole: bytes, *kinds: Mutator, count: int = COUNT) -> Iterator[bytes]:
    """The same `count` files each time, the kinds in turn."""
    rng = np.random.default_rng(0)
    for number in range(count):
        yield kinds[number % len(kinds)](whole, rng)


@contextmanager
def fast_folder() -> Iterator[Path]:
    """A folder in memory where the system has one: a disk takes milliseconds a file."""
    memory = Path("/dev/shm")
    with tempfile.TemporaryDirectory(dir=memory if memory.is_dir() else None) as name:
        yield Path(name)


def assault(read: Callable[[Path], object], path: Path, files: Iterator[bytes]) -> tuple[int, int]:
    """How many of the files the reader refused, and how many there were. Raises whatever is no answer."""
    refused = seen = 0
    for data in files:
        path.write_bytes(data)
        seen += 1
        try:
            with limits():
                read(path)
        except AvatarGenError:
            refused += 1
        except BaseException as error:
            error.add_note(f"file {seen - 1} of {path.name}: {data[:2000]!r}")
            raise
    return refused, seen


@contextmanager
def limits() -> Iterator[None]:
    """No more new memory than BYTES and no more processor time than SECONDS; both end in an error."""

    def stop(*_: object) -> None:
        raise TimeoutError(f"more than {SECONDS} seconds")

    soft, hard = resource.getrlimit(resource.RLIMIT_AS)
    pages = int(Path("/proc/self/statm").read_text().split()[0]) if Path("/proc/self/statm").exists() else 0
    handler = signal.signal(signal.SIGPROF, stop)
    signal.setitimer(signal.ITIMER_PROF, SECONDS)
    if pages:
        resource.setrlimit(resource.RLIMIT_AS, (pages * resource.getpagesize() + BYTES, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_AS, (soft, hard))
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.signal(signal.SIGPROF, handler)
