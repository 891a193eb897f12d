"""Progress of a command: one live line on a terminal, nothing at all in a pipe."""

import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager

Show = Callable[[str, float], None]  # what is being done now, share of the work behind it, 0..1


@contextmanager
def progress_line() -> Iterator[Show]:
    """Gives a function that shows what is being done now; the line is gone at the end."""
    if not sys.stderr.isatty():
        yield lambda doing, share: None
        return
    with ExitStack() as line:
        shown: list[Show] = []

        def show(doing: str, share: float) -> None:
            if not shown:
                shown.append(line.enter_context(live_line()))
            shown[0](doing, share)

        yield show


@contextmanager
def live_line() -> Iterator[Show]:
    """The line itself: only who shows something pays for its library."""
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (TextColumn("{task.description:20}"), BarColumn(), TimeElapsedColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as progress:
        task = progress.add_task("", total=1.0)
        yield lambda doing, share: progress.update(task, description=doing, completed=share)
