"""Where the files are that come with the package: weights, body, measured curves."""

from importlib import resources
from pathlib import Path


def shipped(name: str) -> Path:
    """A file that comes with the package."""
    return Path(str(resources.files("avatargen"))) / "pretrained" / name
