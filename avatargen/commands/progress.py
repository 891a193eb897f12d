"""Progress of a command: one live line on a terminal, nothing at all in a pipe."""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

Show = Callable[[str], None]


@contextmanager
def progress_line() -> Iterator[Show]:
    """Gives a function that shows what is being done now; the line is gone at the end."""
    if not sys.stderr.isatty():
        yield lambda doing: None
        return
    from rich.console import Console  # only a terminal pays for it

    with Console(stderr=True).status("") as status:
        yield status.update
