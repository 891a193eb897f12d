"""Numbers of a configuration, checked where it is made: before anything is loaded or written."""

from collections.abc import Mapping
from typing import Any

from avatargen.errors import InputError

Range = tuple[float | int, float | int]  # from, to
MANY = 10**9


def require_ranges(settings: Any, what: str, ranges: Mapping[str, Range]) -> None:
    """See that attributes, or every one of a tuple's numbers, lie within [low, high]; None is let through.

    Raises:
        InputError: one does not, or is NaN.
    """
    for name, (low, high) in ranges.items():
        found = getattr(settings, name)
        for value in found if isinstance(found, tuple) else (found,):
            if value is not None and not low <= value <= high:
                raise InputError(f"{what}: found {name} {value}, wanted {low} to {high}")
