"""A case of the stress test: what it is, what has to happen, and the check that says what did happen."""

from collections.abc import Callable
from dataclasses import dataclass

from avatargen.errors import AvatarGenError

SECONDS, MEGABYTES = 60.0, 1500.0


class Wrong(Exception):
    """Something else happened than what had to."""


@dataclass(frozen=True, kw_only=True)
class Case:
    """`check` returns what happened, in words; it raises `Wrong` where that is not right.

    `error` names the kind of error and a word of its message where an error is the right end.
    """

    name: str
    expected: str
    check: Callable[[], str]
    error: tuple[type[AvatarGenError], str] | None = None
    seconds: float = SECONDS  # of the processor, at most
    megabytes: float = MEGABYTES  # at most
    slow: bool = False  # left out of the quick run


def require(holds: object, found: str) -> None:
    """Raises Wrong with what was found, unless the condition holds."""
    if not holds:
        raise Wrong(found)
