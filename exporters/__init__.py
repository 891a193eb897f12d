"""Asset -> files. `export` picks the encoder by the file's suffix; encoders turn an asset into bytes."""

from exporters.export import ENCODERS, export, find_encoder

__all__ = ["ENCODERS", "export", "find_encoder"]
