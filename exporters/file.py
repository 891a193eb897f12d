"""What an encoder makes: bytes under a name."""

from typing import NamedTuple


class File(NamedTuple):
    """One file of an export; names have no folder."""

    name: str
    data: bytes
