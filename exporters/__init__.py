"""Asset -> files. `export` picks the format by the file's suffix; encoders turn an asset into bytes."""

from exporters.export import FORMATS, Format, encode, export, files_of, find_format

__all__ = ["FORMATS", "Format", "encode", "export", "files_of", "find_format"]
