"""One table maps a file's suffix to its encoder; only `export` touches the disk."""

from collections.abc import Callable
from pathlib import Path

from assets.asset import Asset
from avatargen.atomic import write_atomically
from avatargen.errors import InputError
from exporters import glb

ENCODERS: dict[str, Callable[[Asset], bytes]] = {".glb": glb.encode}


def find_encoder(path: str | Path) -> Callable[[Asset], bytes]:
    """The encoder for the path's suffix, upper or lower case.

    Raises:
        InputError: no encoder writes such files.
    """
    suffix = Path(path).suffix.lower()
    if suffix not in ENCODERS:
        raise InputError(
            f"export: {Path(path).name!r} has no known suffix; use one of {', '.join(sorted(ENCODERS))}"
        )
    return ENCODERS[suffix]


def export(asset: Asset, path: str | Path) -> int:
    """Write the asset to `path`, whole or not at all; returns the number of bytes written.

    Raises:
        InputError: the suffix is unknown or the path cannot be written; an existing file stays as it was.
    """
    data = find_encoder(path)(asset)
    write_atomically(path, data)
    return len(data)
