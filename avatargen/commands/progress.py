"""Progress of a command: one live line on a terminal, nothing at all in a pipe."""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

Show = Callable[[str, float], None]  # what is being done now, share of the work behind it, 0..1


@contextmanager
def progress_line() -> Iterator[Show]:
    """Gives a function that shows what is being done now; the line is gone at the end."""
    if not sys.stderr.isatty():
        yield lambda doing, share: None
        return
    from rich.console import Console  # only a terminal pays for it
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (TextColumn("{task.description:20}"), BarColumn(), TimeElapsedColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as progress:
        task = progress.add_task("", total=1.0)
        yield lambda doing, share: progress.update(task, description=doing, completed=share)
