"""Asset -> files. `export` picks the format by the file's suffix; encoders turn an asset into bytes."""

from avatargen.shadow import require_ours

require_ours()  # before `assets` is imported from here on

from exporters.export import FORMATS, Format, encode, export, files_of, find_format  # noqa: E402

__all__ = ["FORMATS", "Format", "encode", "export", "files_of", "find_format"]
