"""What a run leaves behind to be judged by: its pictures at held-out labels, in files that are small.

    RUN/shown/run.json               which run it is, how long it took, the last line of its log
    RUN/shown/labels.json            the labels' numbers
    RUN/shown/first-image ...        one picture of all of them, row by row, without loss; mask likewise
    RUN/shown/first-depth            16 bits, in steps of DEPTH_UNIT; 0 where nobody solid is

    PACKED/part-0.zip ...                 the same of many runs, each below its key; few parts, none too large

Letters: N pictures, S pixels a side.
"""

import io
import json
import zipfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Shaped
from PIL import Image, features

from avatargen.atomic import write_atomically
from avatargen.errors import InputError
from avatargen.metrics.clothes import SOLID
from avatargen.metrics.shown import Shown, Views

KINDS = ("first", "turned", "reposed")
FOLDER = "shown"
PARTS = 8
LARGEST_PART = 16 << 20  # bytes
ROOM = 512  # bytes that a part needs beside its files, and for each of them
COLUMNS = 16


@dataclass(frozen=True, kw_only=True, eq=False)
class Result:
    """A run's pictures, and what is told of the run."""

    facts: dict[str, Any]
    shown: Shown


def encode(result: Result) -> dict[str, bytes]:
    """The files, by name."""
    files = {
        "run.json": json.dumps(result.facts, indent=1).encode(),
        "labels.json": json.dumps(result.shown.chosen.tolist()).encode(),
    }
    for kind in KINDS:
        views: Views = getattr(result.shown, kind)
        if len(views):
            files |= encode_views(kind, views)
    return files


def encode_views(kind: str, views: Views) -> dict[str, bytes]:
    solid = views.mask > 0.95 * 255 * SOLID  # depth is asked for nowhere else
    return {
        f"{kind}-image": encode_tiles(views.image, lossless_format()),
        f"{kind}-mask": encode_tiles(np.repeat(views.mask[..., None], 3, 3), lossless_format()),
        f"{kind}-depth": encode_tiles(np.where(solid, views.depth, 0).astype(np.uint16), "png"),
    }


def lossless_format() -> str:
    """WebP, which is a third smaller, where Pillow was built with it."""
    return "webp" if features.check("webp") else "png"


def encode_tiles(pictures: Shaped[np.ndarray, "N S S *c"], format: str) -> bytes:
    """All in one picture, so many in a row; what is left of the last row is black."""
    rows = -(-len(pictures) // COLUMNS)
    size = pictures.shape[1]
    whole = np.zeros((rows * COLUMNS, *pictures.shape[1:]), pictures.dtype)
    whole[: len(pictures)] = pictures
    whole = whole.reshape(rows, COLUMNS, *pictures.shape[1:]).swapaxes(1, 2)
    stream = io.BytesIO()
    one = Image.fromarray(whole.reshape(rows * size, COLUMNS * size, *pictures.shape[3:]))
    one.save(stream, format=format, **({"lossless": True} if format == "webp" else {"optimize": True}))
    return stream.getvalue()


def decode_tiles(data: bytes, count: int) -> Shaped[np.ndarray, "N S S *c"]:
    with Image.open(io.BytesIO(data)) as picture:
        whole = np.asarray(picture)
    size = whole.shape[1] // COLUMNS
    tiles = whole.reshape(-1, size, COLUMNS, size, *whole.shape[2:]).swapaxes(1, 2)
    return np.ascontiguousarray(tiles.reshape(-1, size, size, *whole.shape[2:])[:count])


def decode(files: Mapping[str, bytes]) -> Result:
    """The way back. Raises InputError where a file is missing or damaged."""
    try:
        facts, labels = (json.loads(files[name]) for name in ("run.json", "labels.json"))
        chosen = np.array(labels, dtype=np.int64)
        views = {kind: decode_views(files, kind, int(facts["pictures"][kind])) for kind in KINDS}
        return Result(facts=facts, shown=Shown(chosen=chosen, **views))
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise InputError(
            f"eval: a run's pictures are damaged ({str(error)[:200]}); make them anew"
        ) from error


def decode_views(files: Mapping[str, bytes], kind: str, count: int) -> Views:
    if count == 0:
        first = decode_views(files, "first", 1)
        return first.part(slice(0))
    image, mask, depth = (decode_tiles(files[f"{kind}-{name}"], count) for name in ("image", "mask", "depth"))
    return Views(image=image[..., :3].copy(), mask=mask[..., 0].copy(), depth=depth.astype(np.uint16))


def with_counts(result: Result) -> Result:
    """The same, its facts telling how many pictures there are."""
    counts = {kind: len(getattr(result.shown, kind)) for kind in KINDS}
    return Result(facts={**result.facts, "pictures": counts}, shown=result.shown)


def write_shown(folder: Path, result: Result) -> None:
    """Into a run's folder; run.json, which says that all is there, comes last."""
    files = encode(with_counts(result))
    (folder / FOLDER).mkdir(parents=True, exist_ok=True)
    (folder / FOLDER / "run.json").unlink(missing_ok=True)
    for name in sorted(files, key=lambda name: name == "run.json"):
        write_atomically(folder / FOLDER / name, files[name])


def read_shown(folder: Path) -> Result | None:
    """From a run's folder; none where nothing whole is there."""
    files = shown_files(folder)
    return None if files is None else decode(files)


def shown_files(folder: Path) -> dict[str, bytes] | None:
    """A run's files by name; none where nothing whole is there."""
    if not (folder / FOLDER / "run.json").exists():
        return None
    return {path.name: path.read_bytes() for path in (folder / FOLDER).iterdir()}


def pack(whole: Mapping[str, Mapping[str, bytes]], folder: Path, limit: int) -> list[Path]:
    """Write the files of all runs in parts of together at most `limit` bytes, as they are; where they need
    more, every run keeps the same share of its people.

    Raises:
        InputError: the limit holds next to nothing.
    """
    files, share = whole, 1.0
    for _ in range(8):
        parts = spread(files, limit)
        if parts is not None:
            return write_parts(files, parts, folder)
        total = sum(sum(map(len, own.values())) for own in files.values())
        share *= min(0.9, 0.95 * limit / max(total, 1))
        files = {key: encode(with_counts(keep(decode(own), share))) for key, own in whole.items()}
    raise InputError(f"eval: {len(whole)} runs do not fit in {limit} bytes; allow more, or fewer runs")


def keep(result: Result, share: float) -> Result:
    """With this share of the people."""
    counts = [round(share * len(getattr(result.shown, kind))) for kind in ("first", "turned")]
    return result if share == 1 else Result(facts=result.facts, shown=result.shown.upto(*counts))


def spread(files: Mapping[str, Mapping[str, bytes]], limit: int) -> list[list[str]] | None:
    """Which run goes into which part, the largest first; none where they do not fit."""
    sizes = {key: sum(len(data) + ROOM for data in own.values()) for key, own in files.items()}
    if sum(sizes.values()) + PARTS * ROOM > limit:
        return None
    parts: list[list[str]] = [[] for _ in range(PARTS)]
    room = [LARGEST_PART - ROOM] * PARTS
    for key in sorted(sizes, key=lambda key: (-sizes[key], key)):
        part = int(np.argmax(room))
        if room[part] < sizes[key]:
            return None
        parts[part].append(key)
        room[part] -= sizes[key]
    return [part for part in parts if part]


def write_parts(
    files: Mapping[str, Mapping[str, bytes]], parts: Sequence[Sequence[str]], folder: Path
) -> list[Path]:
    folder.mkdir(parents=True, exist_ok=True)
    written = []
    for number, keys in enumerate(parts):
        stream = io.BytesIO()
        with zipfile.ZipFile(stream, "w") as archive:
            for key in sorted(keys):
                for name, data in files[key].items():
                    archive.writestr(f"{key}/{name}", data)
        written.append(folder / f"part-{number}.zip")
        write_atomically(written[-1], stream.getvalue())
    for old in set(folder.glob("part-*.zip")) - set(written):
        old.unlink()
    return written


def read_packed(folder: Path) -> Iterator[tuple[str, Result]]:
    """Every run of the parts in a folder, by its key.

    Raises:
        InputError: there are none, or one is damaged.
    """
    paths = sorted(folder.glob("*.zip"))
    if not paths:
        raise InputError(f"eval: {folder} holds no part-*.zip; make the runs first")
    for path in paths:
        try:
            with zipfile.ZipFile(path) as archive:
                names = archive.namelist()
                for key in sorted({name.rsplit("/", 1)[0] for name in names}):
                    own = [name for name in names if name.rsplit("/", 1)[0] == key]
                    yield key, decode({name.rsplit("/", 1)[1]: archive.read(name) for name in own})
        except (OSError, zipfile.BadZipFile) as error:
            raise InputError(f"eval: {path} is damaged ({error}); fetch or make it anew") from error
