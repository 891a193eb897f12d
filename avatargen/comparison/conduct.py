"""The processes that train the runs, and the time.

Every worker gets its share of the runs. When all are at their ends, or when the time that is left is needed
to show and to pack, everybody stops; all are judged at the number of pictures that the last run reached. The
runs of a worker that dies go on in a new one, from their last states, but for the one that it was busy with.
"""

import multiprocessing
import time
from collections.abc import Callable, Sequence
from ctypes import c_double, c_int64
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from avatargen.comparison.packed import pack, read_shown, shown_files
from avatargen.comparison.plan import Plan, Run
from avatargen.comparison.worker import FAILED, LOADING, SHOWN, STOPPED, Job, Shared, work
from avatargen.data.folder import single_threaded
from avatargen.errors import TrainingError

LOOK_EVERY = 0.2  # seconds
TELL_EVERY = 10.0  # seconds between lines of the log
PACKING = 0.1  # seconds that packing a run takes, at most: its files are taken as they are
TO_STOP = 20.0  # seconds that a turn under way may take to end
MOST_SHOWING = 0.35  # of the time
STUCK, LEAST_STUCK = 0.2, 60.0  # share of the time, and seconds, after which a worker is taken to be stuck
LIVES = 3  # times that a worker may be started
PACKED = "packed"  # folder of the packed pictures
STAGES = ("loading", "training", "stopped", "done")
FOREVER = 1e12


@dataclass(frozen=True, kw_only=True)
class Conditions:
    """How much may be used."""

    jobs: int  # processes
    minutes: float | None  # for everything; none: as long as it takes
    megabytes: int  # of packed pictures


@dataclass(frozen=True, kw_only=True)
class Places:
    """Where things lie."""

    data: Path
    held_out: Path
    out: Path


class Conductor:
    """The workers of a comparison, from their start to the packed pictures."""

    def __init__(self, plan: Plan, places: Places, conditions: Conditions) -> None:
        self.plan, self.places, self.conditions = plan, places, conditions
        self.started = time.time()
        minutes = conditions.minutes
        self.end = self.started + (60 * minutes if minutes is not None else FOREVER)
        self.todo = [place for place, run in enumerate(plan.runs) if not self.is_done(run)]
        self.jobs = max(min(conditions.jobs, len(self.todo)), 1)
        self.context = multiprocessing.get_context("spawn")
        self.shared = self.share()
        self.workers: dict[int, Any] = {}
        self.shares: dict[int, list[int]] = {}
        self.lives: dict[int, int] = {}
        self.seen: dict[int, tuple[Any, float]] = {}  # what a worker was last seen at, and since when

    def folder(self, run: Run) -> Path:
        return self.places.out / "runs" / run.key

    def is_done(self, run: Run) -> bool:
        """Whether its pictures are there, of its last weights."""
        result = read_shown(self.folder(run))
        return result is not None and result.facts["images"] >= run.config.images

    def share(self) -> Shared:
        make, count = self.context, len(self.plan.runs)
        shared = Shared(
            images=make.RawArray(c_int64, count),
            stage=make.RawArray(c_int64, self.jobs),
            active=make.RawArray(c_int64, [FAILED] * self.jobs),
            show_seconds=make.RawArray(c_double, self.jobs),
            stop=make.RawValue(c_int64, 0),
            common=make.RawValue(c_int64, -1),
            show_until=make.RawValue(c_double, self.end),
        )
        for place, run in enumerate(self.plan.runs):
            shared.images[place] = 0 if place in self.todo else run.config.images
        return shared

    @property
    def ends(self) -> tuple[int, ...]:
        return tuple(run.config.images for run in self.plan.runs)

    def start(self, worker: int, places: Sequence[int]) -> None:
        """A worker for some of the runs."""
        job = Job(
            worker=worker,
            runs={place: self.plan.runs[place] for place in places},
            ends=self.ends,
            data=self.places.data,
            held_out=self.places.held_out,
            out=self.places.out,
        )
        self.shared.stage[worker] = LOADING
        self.shares[worker] = list(places)
        with single_threaded():
            self.workers[worker] = self.context.Process(target=work, args=(job, self.shared), daemon=True)
            self.workers[worker].start()

    def run(self, tell: Callable[[str], None]) -> list[Path]:
        """Train, show and pack; returns the packed files.

        Raises:
            TrainingError: no run left pictures.
        """
        try:
            if self.todo:
                for worker in range(self.jobs):
                    self.start(worker, self.todo[worker :: self.jobs])
                self.wait(tell, self.at_end, self.time_to_stop)
                self.shared.stop.value = 1
                at_rest = time.time() + TO_STOP
                self.wait(tell, lambda: self.all_at(STOPPED), lambda: at_rest)
                self.agree(tell)
                self.wait(tell, lambda: self.all_at(SHOWN), lambda: self.end - self.packing())
        finally:
            packed = self.pack(tell)
            self.finish()
        return packed

    def at_end(self) -> bool:
        """Whether no run has anything left to learn."""
        on = zip(self.shared.images, self.ends, strict=True)
        return all(images == FAILED or images >= end for images, end in on)

    def all_at(self, stage: int) -> bool:
        return all(own >= stage for own in self.shared.stage)

    def packing(self) -> float:
        """Seconds that are kept to pack and to write."""
        return 3.0 + PACKING * len(self.plan.runs)

    def time_to_stop(self) -> float:
        """When training ends, so that there is time to show and to pack; where showing would take most of it,
        fewer people are shown."""
        whole = self.end - self.started - self.packing()
        return self.end - self.packing() - min(max(self.shared.show_seconds), MOST_SHOWING * whole) - 2.0

    def wait(self, tell: Callable[[str], None], done: Callable[[], bool], until: Callable[[], float]) -> None:
        """Until it is done or the time has come; workers that die are replaced."""
        told = 0.0
        while not done() and time.time() < until():
            if time.time() - told > TELL_EVERY:
                tell(self.state())
                told = time.time()
            time.sleep(LOOK_EVERY)
            self.end_stuck(tell)
            self.replace_dead(tell)

    def state(self) -> str:
        """A line of the log."""
        images = [self.shared.images[place] for place in self.todo]
        on = [own for own in images if own != FAILED]
        stages = ", ".join(
            f"{list(self.shared.stage).count(stage)} {name}" for stage, name in enumerate(STAGES)
        )
        seconds = time.time() - self.started
        return (
            f"{seconds:.0f} s: {min(on, default=0):,} to {max(on, default=0):,} pictures in {len(on)} runs, "
            f"{len(images) - len(on)} failed; {sum(on) / seconds:.0f} pictures/s in all; workers: {stages}; "
            f"showing will take {max(self.shared.show_seconds):.0f} s"
        )

    def end_stuck(self, tell: Callable[[str], None]) -> None:
        """End workers that have been busy with one run, which gets nowhere, for a large part of the time: all
        others wait for it."""
        for worker, process in self.workers.items():
            busy = self.shared.active[worker]
            now = (busy, self.shared.images[busy] if busy != FAILED else time.time())
            if self.seen.get(worker, (None, 0.0))[0] != now:
                self.seen[worker] = (now, time.time())
            elif time.time() - self.seen[worker][1] > max(STUCK * (self.end - self.started), LEAST_STUCK):
                tell(f"worker {worker} is stuck")
                process.kill()
                process.join()

    def replace_dead(self, tell: Callable[[str], None]) -> None:
        """Start new workers for the runs of those that ended before they had shown them."""
        for worker, process in list(self.workers.items()):
            if process.is_alive() or self.shared.stage[worker] >= SHOWN:
                continue
            busy, self.lives[worker] = self.shared.active[worker], self.lives.get(worker, LIVES) - 1
            left = [place for place in self.shares[worker] if self.shared.images[place] != FAILED]
            out = [busy] if busy in left else [] if self.lives[worker] else left
            for place in out:
                self.shared.images[place] = FAILED
            left = [place for place in left if place not in out]
            names = ", ".join(self.plan.runs[place].key for place in out) or "no run"
            tell(f"worker {worker} died with status {process.exitcode}, {names} is lost with it")
            if left and self.lives[worker]:
                self.start(worker, left)
            else:
                self.shared.stage[worker] = SHOWN

    def agree(self, tell: Callable[[str], None]) -> None:
        """Tell all at how many pictures they are judged: what the last run reached."""
        reached = [self.shared.images[place] for place in self.todo if self.shared.images[place] != FAILED]
        self.shared.show_until.value = self.end - self.packing() - 1.0
        self.shared.common.value = min(reached, default=0)
        tell(f"{time.time() - self.started:.0f} s: judged at {self.shared.common.value:,} pictures")

    def pack(self, tell: Callable[[str], None]) -> list[Path]:
        results = {run.key: shown_files(self.folder(run)) for run in self.plan.runs}
        there = {key: result for key, result in results.items() if result is not None}
        if not there:
            raise TrainingError(f"eval: no run left pictures; {self.places.out / 'log.txt'} tells why")
        packed = pack(there, self.places.out / PACKED, self.conditions.megabytes << 20)
        size = sum(path.stat().st_size for path in packed) / 2**20
        seconds = time.time() - self.started
        tell(f"{seconds:.0f} s: {len(there)} of {len(results)} runs in {len(packed)} files, {size:.1f} MiB")
        return packed

    def finish(self) -> None:
        """Let workers write their states, if there is time, and end them."""
        for process in self.workers.values():
            process.join(None if self.conditions.minutes is None else max(self.end - time.time(), 0.1))
            if process.is_alive():
                process.terminate()
