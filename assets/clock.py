"""Seconds of each stage of a build, and a word to whoever watches when one begins."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from assets.plan import Plan

Progress = Callable[[str, float], None]  # name of the stage that begins, share of the work behind it


class Clock:
    """Seconds by stage, in the order the stages ran."""

    def __init__(self, plan: Plan, progress: Progress | None) -> None:
        self.plan, self.progress = plan, progress
        self.seconds: dict[str, float] = {}

    @contextmanager
    def __call__(self, stage: str) -> Iterator[None]:
        if self.progress is not None:
            self.progress(stage, self.plan.share(len(self.seconds)))
        start = time.perf_counter()
        yield
        self.seconds[stage] = time.perf_counter() - start
