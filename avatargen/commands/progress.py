"""Progress of a command: one live line on a terminal; in a pipe nothing at all, or a line now and then."""

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from datetime import timedelta

Show = Callable[[str, float], None]  # what is being done now, share of the work behind it, 0..1
EVERY = 10.0  # seconds between lines in a pipe


@contextmanager
def progress_line(*, quiet: bool = False, in_pipes: bool = False) -> Iterator[Show]:
    """Gives a function that shows what is being done now; on a terminal the line is gone at the end. In pipes
    it is silent, or tells every ten seconds at most. Quiet, it is silent everywhere."""
    if quiet or not sys.stderr.isatty():
        yield now_and_then() if in_pipes and not quiet else lambda doing, share: None
        return
    with ExitStack() as line:
        shown: list[Show] = []

        def show(doing: str, share: float) -> None:
            if not shown:
                shown.append(line.enter_context(live_line()))
            shown[0](doing, share)

        yield show


def now_and_then() -> Show:
    """Prints what is being done where ten seconds have gone since the last line, and how long the rest takes
    at this rate. Who does not listen any more is no reason to stop."""
    started = told = time.monotonic()

    def show(doing: str, share: float) -> None:
        nonlocal told
        now = time.monotonic()
        if now - told < EVERY or not 0 < share < 1:
            return
        told = now
        spent, left = (clock(seconds) for seconds in (now - started, (now - started) * (1 / share - 1)))
        with suppress(OSError):
            print(f"{doing} in {spent}, about {left} left", file=sys.stderr, flush=True)

    return show


def clock(seconds: float) -> str:
    """Hours, minutes and seconds, as in 0:01:23."""
    return str(timedelta(seconds=round(seconds)))


@contextmanager
def live_line() -> Iterator[Show]:
    """The line itself: only who shows something pays for its library."""
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (TextColumn("{task.description:20}"), BarColumn(), TimeElapsedColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as progress:
        task = progress.add_task("", total=1.0)
        yield lambda doing, share: progress.update(task, description=doing, completed=share)
