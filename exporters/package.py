"""USD's package, .usdz: a zip whose files are stored plain, each beginning at a multiple of 64 bytes.

Written here because USD's own packager puts the time of day into the file and leaves half a file on failure.
"""

import io
import zipfile
from collections.abc import Sequence

from exporters.file import File

ALIGNMENT = 64
HEADER = 30  # bytes of a local file header before the name
PADDING_ID = 0x1986  # what USD's packager calls its padding, too
EPOCH = (1980, 1, 1, 0, 0, 0)  # zip's first moment: the same files give the same bytes


def pack(files: Sequence[File]) -> bytes:
    """The files as one package; the first is the one that readers open."""
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_STORED) as package:
        for name, data in files:
            entry = zipfile.ZipInfo(name, EPOCH)
            entry.external_attr = 0o644 << 16
            entry.create_system = 3
            entry.extra = padding(stream.tell() + HEADER + len(name.encode()))
            package.writestr(entry, data)
    return stream.getvalue()


def padding(start: int) -> bytes:
    """An extra field that moves data from `start` to the next multiple of the alignment."""
    size = -start % ALIGNMENT
    if size == 0:
        return b""
    if size < 4:  # the field's own head takes four bytes
        size += ALIGNMENT
    return PADDING_ID.to_bytes(2, "little") + (size - 4).to_bytes(2, "little") + bytes(size - 4)
