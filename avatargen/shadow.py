"""Whether `assets` and `exporters` mean the packages beside this one.

Python imports the first package of a name on its path, and the folder of the script that runs, or for
`python -m` the current one, comes first: an `assets` package there shadows ours. In a process of ours its
folder leaves the path; in anybody else's nothing is changed, and what needs ours says what is in the way.
"""

import importlib.util
import os
import sys
from pathlib import Path

OURS = Path(__file__).parents[1]
BESIDE = ("assets", "exporters")


def require_ours() -> None:
    """Raises ImportError where another `assets` or `exporters` would be imported, or has been."""
    for name in BESIDE:
        place = shadow_of(name)
        if place is not None:
            raise ImportError(
                f"found {place} where avatargen needs its own package {name}; rename that one, or start "
                "Python with -P and leave its folder out of PYTHONPATH",
                name=name,
                path=str(place),
            )


def prefer_ours() -> None:
    """Take the folders off Python's path whose packages shadow ours: for a process that runs our program."""
    for name in BESIDE:
        while (place := shadow_of(name)) is not None and name not in sys.modules:
            folder = os.path.realpath(place.parent)
            kept = [entry for entry in sys.path if os.path.realpath(entry) != folder]
            if len(kept) == len(sys.path):
                break
            sys.path[:] = kept
    require_ours()


def shadow_of(name: str) -> Path | None:
    """The package or module that `import name` gives in place of ours; None where it gives ours or fails."""
    try:
        spec = importlib.util.find_spec(name)
    except ValueError:  # a module that somebody put together, of no place
        return None
    if spec is None:
        return None
    folders = list(spec.submodule_search_locations or ())
    place = Path(folders[0] if folders else spec.origin or name)
    return None if os.path.realpath(place) == os.path.realpath(OURS / name) else place
