"""All pictures of a data set in one file, mapped into memory: `pictures.safetensors` beside dataset.json.

The file is of the safetensors format: `images` [N S S 3] and `masks` [N S S] in 8 bits, `depth` [N H H] in
16; its metadata hold the names of the pictures, as JSON in the order of the rows, and the SHA-256 of every
tensor. Pixels are read from the disk when they are asked for, and processes share them.

Letters: N pictures, S pixels a side, H pixels a side of the depth.
"""

import hashlib
import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from jaxtyping import Shaped, UInt8, UInt16
from PIL import Image

from avatargen.errors import InputError

PACK_NAME = "pictures.safetensors"
FORMAT = "avatargen-pictures-1"
TYPES = {"depth": ("U16", np.dtype("<u2")), "images": ("U8", np.dtype("u1")), "masks": ("U8", np.dtype("u1"))}
CHANNELS = {"depth": (), "images": (3,), "masks": ()}
LONGEST_HEADER = 1 << 30  # bytes


@dataclass(frozen=True, kw_only=True, eq=False)
class Pack:
    """The pictures of one file, by their names in dataset.json."""

    path: Path
    rows: dict[str, int]
    arrays: dict[str, Shaped[np.ndarray, "N ..."]]  # by kind: images, and masks and depth where it has them
    digests: dict[str, str]  # SHA-256 of each as it was written

    def holds(self, names: Sequence[str]) -> bool:
        return all(name in self.rows for name in names)

    def read(self, kind: str, names: Sequence[str], size: int) -> UInt8[np.ndarray, "n S S *c"]:
        """Images or masks at `size` pixels a side.

        Raises:
            InputError: it holds none, or their size is no multiple of this one.
        """
        found = self.array(kind)[[self.rows[name] for name in names]]
        stored = found.shape[1]
        if stored % size:
            raise InputError(
                f"data: {self.path} holds {stored} pixels a side; a multiple of {size} is needed"
            )
        if stored == size:
            return found
        return np.stack([np.asarray(Image.fromarray(one).reduce(stored // size)) for one in found])

    def depth(self, name: str) -> UInt16[np.ndarray, "H H"]:
        """In steps of DEPTH_UNIT."""
        return np.array(self.array("depth")[self.rows[name]])

    def array(self, kind: str) -> Shaped[np.ndarray, "N ..."]:
        if kind not in self.arrays:
            raise InputError(f"data: {self.path} holds no {kind}; pack the data set anew, with them")
        return self.arrays[kind]

    def check(self) -> None:
        """Raises InputError where the pixels are no longer those that were written."""
        for kind, array in self.arrays.items():
            if hashlib.sha256(array.data).hexdigest() != self.digests[kind]:
                raise InputError(
                    f"data: the {kind} in {self.path} are damaged; pack or copy the data set anew"
                )


def read_pack(path: Path) -> Pack:
    """Raises InputError where the file is cut off or none of packed pictures."""
    try:
        size = path.stat().st_size
        with path.open("rb") as stream:
            length = int.from_bytes(stream.read(8), "little")
            if not 0 < length <= min(size - 8, LONGEST_HEADER):
                raise ValueError(f"{size} bytes with a header of {length}")
            header = json.loads(stream.read(length))
        notes = header.pop("__metadata__")
        names = [str(name) for name in json.loads(notes["names"])]
        if notes["format"] != FORMAT or "images" not in header or not set(header) <= set(TYPES):
            raise ValueError(f"it is of the format {str(notes['format'])[:40]!r}")
        end = 8 + length + sum(array_bytes(kind, header[kind]["shape"]) for kind in header)
        if end != size:
            raise ValueError(f"it has {size} bytes and should have {end}")
        arrays = {kind: mapped(path, kind, header[kind], 8 + length, len(names)) for kind in header}
        rows = {name: row for row, name in enumerate(names)}
        return Pack(path=path, rows=rows, arrays=arrays, digests={kind: str(notes[kind]) for kind in arrays})
    except OSError as error:
        raise InputError(f"data: cannot read {path} ({error.strerror}); pack the data set anew") from error
    except (ValueError, KeyError, TypeError, AttributeError, OverflowError, RecursionError) as error:
        reason = str(error)[:200]
        raise InputError(
            f"data: {path} is no whole file of packed pictures ({reason}); pack or copy the data set anew"
        ) from error


def mapped(path: Path, kind: str, entry: Mapping[str, Any], start: int, count: int) -> np.ndarray:
    """One tensor of the file. Raises ValueError where it is not what its kind asks for."""
    name, dtype = TYPES[kind]
    shape: tuple[int, ...] = tuple(entry["shape"])
    low, high = entry["data_offsets"]
    square = len(shape) >= 3 and shape[1] == shape[2] and shape[3:] == CHANNELS[kind]
    if (
        entry["dtype"] != name
        or not square
        or shape[:1] != (count,)
        or high - low != array_bytes(kind, shape)
    ):
        raise ValueError(f"{kind} of {entry['dtype']} {shape} for {count} names")
    return np.asarray(np.memmap(path, dtype, "r", offset=start + low, shape=shape))


def array_bytes(kind: str, shape: Sequence[Any]) -> int:
    """Of a tensor of non-negative whole sizes. Raises ValueError for any other."""
    if not all(type(length) is int and length > 0 for length in shape):
        raise ValueError(f"{kind} of shape {shape}")
    return int(np.prod(shape, dtype=object)) * TYPES[kind][1].itemsize


def write_pack(
    stream: BinaryIO,
    names: Sequence[str],
    shapes: Mapping[str, tuple[int, ...]],
    batches: Iterable[Mapping[str, np.ndarray]],
) -> None:
    """Write the file, a batch of pictures at a time: by kind, in the order of the names.

    `shapes` are those of one picture. What does not fit the stream raises OSError.
    """
    kinds = [kind for kind in TYPES if kind in shapes]  # 16 bits before 8, so that all are aligned
    sizes = {kind: array_bytes(kind, (len(names), *shapes[kind])) for kind in kinds}
    ends = dict(zip(kinds, np.cumsum(list(sizes.values())).tolist(), strict=True))
    entries: dict[str, Any] = {
        kind: {
            "dtype": TYPES[kind][0],
            "shape": [len(names), *shapes[kind]],
            "data_offsets": [ends[kind] - sizes[kind], ends[kind]],
        }
        for kind in kinds
    }
    found = {kind: hashlib.sha256() for kind in kinds}
    start = len(header_bytes(names, entries, found))
    place = {kind: start + ends[kind] - sizes[kind] for kind in kinds}
    for batch in batches:
        for kind in kinds:
            pixels = np.ascontiguousarray(batch[kind], dtype=TYPES[kind][1])
            stream.seek(place[kind])
            place[kind] += stream.write(pixels.data)
            found[kind].update(pixels.data)
    if place != {kind: start + end for kind, end in ends.items()}:
        raise RuntimeError(f"pictures of {len(names)} names end at {place}")
    stream.seek(0)
    stream.write(header_bytes(names, entries, found))


def header_bytes(names: Sequence[str], entries: Mapping[str, Any], digests: Mapping[str, Any]) -> bytes:
    """Of a length that does not depend on the digests."""
    notes = {"format": FORMAT, "names": json.dumps(list(names))}
    notes |= {kind: digest.hexdigest() for kind, digest in digests.items()}
    text = json.dumps({"__metadata__": notes, **entries}).encode()
    text += b" " * (-len(text) % 8)
    return len(text).to_bytes(8, "little") + text
