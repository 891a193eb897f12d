"""One table says how each suffix is written; only `export` touches the disk."""

import hashlib
import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from assets.asset.asset import PlainAsset, part_names
from assets.content import Content
from avatargen.atomic import write_together
from avatargen.errors import InputError
from exporters import glb, gltf_files, obj, ply, stl, vrm
from exporters.encoding import PLAIN, SUFFIXES, Encoding, PictureFormat
from exporters.file import File
from exporters.slicer import for_slicers

Map = Literal["normal", "occlusion"]
Encoder = Callable[[PlainAsset, tuple[str, ...], Encoding], tuple[File, ...]]

# what other files cannot name a file by
UNPRINTABLE = r"[\x00-\x1f\x7f\ud800-\udfff]"  # lone surrogates stand for bytes that are no UTF-8
USD_SYNTAX = rf"{UNPRINTABLE}|[\[\]<>@]"  # packages, tiles, and the quotes of paths
NO_PLAIN_WORD = r"^-|[^A-Za-z0-9._-]"  # readers of OBJ end a name at a space, and take -x for an option


@dataclass(frozen=True)
class Format:
    """How one suffix is written.

    `encode` gets the asset and the names of all files there may be, the one asked for first, and returns
    those that the asset needs, in that order; it touches neither the disk nor the asset. `beside` ends the
    names of the files that stand beside the one asked for: person.usda brings person_base_color.png. `unkept`
    matches what such a name must not hold, or some reader of the format does not find the file.
    `content` is the most that the format can hold, `maps` the pictures among it beside the base colour,
    `rest_pose` the one pose that it must have. `pictures` are the ways it can hold pictures in, `quantize`
    whether it can hold rounded numbers; only formats with `levels` hold coarser levels of detail, the others
    write the finest. Formats with `units` say what theirs are, so that all their readers agree. Formats with
    `parts` hold several meshes, each with pictures of its own.
    """

    encode: Encoder
    beside: tuple[str, ...] = ()
    unkept: str = UNPRINTABLE
    content: Content = "rigged"
    maps: tuple[Map, ...] = ("normal", "occlusion")
    rest_pose: str | None = None
    pictures: tuple[PictureFormat, ...] = ("png", "jpeg")
    quantize: bool = False
    levels: bool = False
    units: bool = True
    parts: bool = False


def one_file(encode: Callable[[PlainAsset, Encoding], bytes]) -> Encoder:
    """An encoder that needs no names."""
    return lambda asset, names, encoding: (File(names[0], encode(asset, encoding)),)


def mesh_file(encode: Callable[[PlainAsset], bytes]) -> Encoder:
    """An encoder of a format that has one way to be written in."""
    return lambda asset, names, encoding: (File(names[0], encode(asset)),)


def encode_usd(asset: PlainAsset, names: tuple[str, ...], encoding: Encoding) -> tuple[File, ...]:
    from exporters import usd  # its library takes a quarter of a second to load

    return usd.encode(asset, names, encoding)


FORMATS: dict[str, Format] = {
    ".glb": Format(one_file(glb.encode), pictures=tuple(SUFFIXES), quantize=True, levels=True, parts=True),
    ".gltf": Format(
        gltf_files.encode,
        beside=(".bin", "_base_color.png", "_normal.png", "_occlusion.png"),
        pictures=tuple(SUFFIXES),
        quantize=True,
        levels=True,
    ),
    ".vrm": Format(vrm.encode_files, beside=(".vrma",), rest_pose=vrm.REST_POSE, parts=True),
    ".usda": Format(
        encode_usd, beside=("_base_color.png", "_normal.png", "_occlusion.png"), unkept=USD_SYNTAX
    ),
    ".usdc": Format(
        encode_usd, beside=("_base_color.png", "_normal.png", "_occlusion.png"), unkept=USD_SYNTAX
    ),
    ".usdz": Format(encode_usd, parts=True),
    ".obj": Format(
        obj.encode,
        beside=(".mtl", "_base_color.png", "_normal.png"),
        unkept=NO_PLAIN_WORD,
        content="textured",
        maps=("normal",),
        units=False,
    ),
    ".ply": Format(mesh_file(ply.encode), content="textured", maps=(), pictures=("png",), units=False),
    ".stl": Format(one_file(stl.encode), content="mesh", maps=(), pictures=("png",), units=False),
}


def find_format(path: str | Path) -> Format:
    """The format of the path's suffix, upper or lower case.

    Raises:
        InputError: no encoder writes such files.
    """
    suffix = Path(path).suffix.lower()
    if suffix not in FORMATS:
        raise InputError(
            f"export: {Path(path).name!r} has no known suffix; use one of {', '.join(sorted(FORMATS))}"
        )
    return FORMATS[suffix]


def require_encoding(path: str | Path, encoding: Encoding) -> None:
    """Raises InputError where the path's format cannot be written that way."""
    wanted, suffix = find_format(path), Path(path).suffix.lower()
    if encoding.pictures not in wanted.pictures:
        raise InputError(
            f"export: {suffix} holds no {encoding.pictures} pictures; use {' or '.join(wanted.pictures)}"
        )
    if encoding.quantize and not wanted.quantize:
        raise InputError(f"export: {suffix} holds no rounded numbers; leave that out, or use .glb or .gltf")
    if encoding.for_slicers and wanted.units:
        raise InputError(
            f"export: {suffix} is in metres, which slicers ask for; write them .stl, .obj or .ply"
        )


def files_of(path: str | Path, encoding: Encoding = PLAIN) -> list[Path]:
    """Every file that exporting to `path` can write, `path` itself first.

    Raises:
        InputError: the suffix is unknown, or the format cannot be written that way.
    """
    path = Path(path)
    require_encoding(path, encoding)
    wanted = find_format(path)
    stem = name_for_others(path.stem, wanted.unkept)
    endings = (e.replace(".png", SUFFIXES[encoding.pictures]) for e in wanted.beside)
    return [path, *(path.with_name(stem + ending) for ending in endings)]


def name_for_others(stem: str, unkept: str) -> str:
    """The stem where all of it can be kept; else with _ for what cannot, and a hash, so that "my avatar" and
    "my_avatar" side by side do not share files."""
    kept = re.sub(unkept, "_", stem)
    if kept == stem:
        return stem
    return f"{kept}_{hashlib.sha256(stem.encode(errors='surrogateescape')).hexdigest()[:8]}"


def encode(asset: PlainAsset, path: str | Path, encoding: Encoding = PLAIN) -> list[tuple[Path, bytes]]:
    """Every file that exporting to `path` writes, with its bytes; `path` comes last.

    Written in this order, a file that is there finds the files it names.

    Raises:
        InputError: the suffix is unknown, or the format cannot carry the asset or the file's name.
    """
    paths = files_of(path, encoding)
    if part_names(asset) and not find_format(path).parts:
        raise InputError(f"export: {paths[0].suffix} holds one mesh, not parts; use .glb, .vrm or .usdz")
    asset = for_slicers(asset) if encoding.for_slicers else asset
    files = find_format(path).encode(asset, tuple(file.name for file in paths), encoding)
    return [(paths[0].with_name(file.name), file.data) for file in reversed(files)]


def export(asset: PlainAsset, path: str | Path, encoding: Encoding = PLAIN) -> int:
    """Write the asset to `path` and the files that belong beside it, all or none; returns the bytes in all.

    Raises:
        InputError: as `encode` does, or a file cannot be written; existing files stay as they were.
    """
    files = encode(asset, path, encoding)
    write_together(files)
    return sum(len(data) for _, data in files)
