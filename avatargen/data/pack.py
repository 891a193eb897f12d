"""Put a data set's pictures into one file, see `avatargen.data.packed`.

    OUT/dataset.json            as it was        OUT/pictures.safetensors

Pictures are read, made smaller and written a few at a time, so a set may be larger than memory.
"""

import shutil
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
from jaxtyping import UInt16

from avatargen.atomic import write_together
from avatargen.data.dataset import KINDS, Pictures, open_pictures
from avatargen.data.labels import FILE_NAME
from avatargen.data.packed import CHANNELS, PACK_NAME, read_pack, write_pack
from avatargen.errors import InputError

BATCH = 128  # pictures in memory


def pack(
    folder: Path, out: Path, *, size: int | None, depth: bool, report: Callable[[int, int], None]
) -> Pictures:
    """Pack a data set's pictures, and its masks where it has them, at `size` pixels a side or their own.

    Depth is packed if it is asked for. `report` is told how many pictures are done, of how many. Both files
    appear whole, or neither does.

    Raises:
        InputError: the folder holds no such data set, `out` holds something else, or a picture is broken or
            of no multiple of the size.
    """
    pictures = open_pictures(folder, size or 1)
    if size is None:
        pictures = open_pictures(folder, pictures.own_size())
    shapes = {kind: (pictures.size,) * 2 + CHANNELS[kind] for kind in KINDS if pictures.holds(kind)}
    if depth and "depth" not in shapes:
        raise InputError(f"data pack: {folder} holds no depth; leave it out")
    if not depth:
        shapes.pop("depth", None)
    elif size is None:
        shapes["depth"] = tuple(pictures.depth(0).shape)
    try:
        out.mkdir(parents=True, exist_ok=True)
        others = sorted({entry.name for entry in out.iterdir() if not entry.name.startswith(".")})
    except OSError as error:
        raise InputError(f"data pack: cannot use {out} ({error.strerror}); name another folder") from error
    if others not in ([], [FILE_NAME, PACK_NAME]) and out.resolve() != folder.resolve():
        raise InputError(f"data pack: {out} holds other files, such as {others[0]}; name a new folder")
    names = pictures.labels.names
    write_together(
        [
            (
                out / PACK_NAME,
                lambda stream: write_pack(stream, names, shapes, batches(pictures, shapes, report)),
            ),
            (out / FILE_NAME, (folder / FILE_NAME).read_bytes()),
        ]
    )
    return open_pictures(out, pictures.size)


def batches(
    pictures: Pictures, shapes: dict[str, tuple[int, ...]], report: Callable[[int, int], None]
) -> Iterator[dict[str, np.ndarray]]:
    """All pictures by kind, some at a time."""
    for low in range(0, len(pictures), BATCH):
        indices = range(low, min(low + BATCH, len(pictures)))
        found = {kind: pictures.read(kind, indices) for kind in shapes if kind != "depth"}
        if "depth" in shapes:
            found["depth"] = np.stack(
                [smaller_depth(pictures.depth_steps(i), shapes["depth"][0]) for i in indices]
            )
        yield found
        report(indices.stop, len(pictures))


def smaller_depth(depth: UInt16[np.ndarray, "H H"], size: int) -> UInt16[np.ndarray, "s s"]:
    """The mean of what is not 0, where that is at least half of a pixel.

    Raises:
        InputError: the depth's size is no multiple of this one, or not that of the others.
    """
    if len(depth) % size or depth.shape[0] != depth.shape[1]:
        raise InputError(f"data pack: depth of {depth.shape} pixels; a square multiple of {size} is needed")
    blocks = depth.reshape(size, len(depth) // size, size, -1).astype(np.int64)
    hit = (blocks > 0).sum(axis=(1, 3))
    mean = np.rint(blocks.sum(axis=(1, 3)) / np.maximum(hit, 1))
    return (mean * (2 * hit >= (len(depth) // size) ** 2)).astype(np.uint16)


def pack_in_place(folder: Path, report: Callable[[int, int], None]) -> None:
    """Pack all of a data set beside its labels, then remove the files that the pictures were in."""
    path, pictures = folder / PACK_NAME, open_pictures(folder, 1)
    if not path.exists() or not read_pack(path).holds(pictures.labels.names):
        pack(folder, folder, size=None, depth=pictures.holds("depth"), report=report)
    for kind in KINDS:
        shutil.rmtree(folder / kind, ignore_errors=True)
