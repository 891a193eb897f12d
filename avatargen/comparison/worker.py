"""A process that trains some of the runs in turns, so that all of them are equally far at any time, and then
asks each for the pictures that it is judged by.

    open every run -> turns, the least advanced first -> all agree on a number of pictures -> show -> write

A run that fails is told and left out. What is told to the conductor, and learned of the others, stands in
memory that all processes share.
"""

import os
import time
import traceback
from collections.abc import Callable, Sequence
from ctypes import Array, c_double, c_int64
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch

from avatargen.avatar import training_body
from avatargen.comparison.packed import Result, encode, write_shown
from avatargen.comparison.plan import Run
from avatargen.comparison.training import SLICE, TrainingRun
from avatargen.data.dataset import open_pictures
from avatargen.errors import AvatarGenError
from avatargen.metrics.shown import CHUNK, Shown, show_in_parts, together

FAILED = -1  # in place of a number of pictures
LOADING, TRAINING, STOPPED, SHOWN = range(4)  # where a worker is
AHEAD = 2  # turns by which a run may be ahead of the last one
WAIT = 0.02  # seconds
BROKEN = 70  # status of a process whose GPU does not answer
SAVE_EVERY = 90.0  # seconds between states of a run on the disk
TIME_EVERY = 40.0  # seconds between looks at how long showing takes
MARGIN = 1.3  # by which showing may take longer than it did


EXPECTED = (
    *(AvatarGenError, RuntimeError, OSError, AssertionError),
    *(ValueError, TypeError, ArithmeticError, LookupError, AttributeError),
)  # of a run that fails; others end the process


@dataclass(frozen=True, kw_only=True, eq=False)
class Shared:
    """What all processes see: a place a run, then a place a worker, then single numbers. Without locks, which
    a process that dies would keep: each number has one writer.
    """

    images: "Array[c_int64]"  # pictures shown in training; FAILED
    stage: "Array[c_int64]"
    active: "Array[c_int64]"  # the run that a worker is busy with
    show_seconds: "Array[c_double]"  # that its runs will need to show
    stop: c_int64  # 1: no further turn
    common: c_int64  # at how many pictures all are judged; -1: not yet told
    show_until: c_double  # time.time() after which nothing more is shown

    def least(self, ends: Sequence[int]) -> int:
        """How far the last run is of those that have not failed and are not at their end; the furthest end
        where there is none."""
        on = [own for own, end in zip(self.images, ends, strict=True) if own != FAILED and own < end]
        return min(on, default=max(ends))


@dataclass(frozen=True, kw_only=True)
class Job:
    """What a worker is told: its number, its runs by their places in the plan, and where things lie."""

    worker: int
    runs: dict[int, Run]
    ends: tuple[int, ...]  # pictures of every run of the plan
    data: Path
    held_out: Path
    out: Path

    def folder(self, place: int) -> Path:
        return self.out / "runs" / self.runs[place].key

    def log(self, line: str) -> None:
        with (self.out / "log.txt").open("a") as log:
            log.write(f"{time.strftime('%H:%M:%S')} worker {self.worker}: {line}\n")


def work(job: Job, shared: Shared) -> None:
    """A worker's life."""
    torch.set_num_threads(1)
    team = Team(job, shared)
    shared.stage[job.worker] = TRAINING
    team.train()
    shared.stage[job.worker] = STOPPED
    while shared.common.value < 0:
        time.sleep(WAIT)
    team.show(shared.common.value)
    shared.stage[job.worker] = SHOWN
    team.save(all_of_them=True)


class Team:
    """The runs of a worker."""

    def __init__(self, job: Job, shared: Shared) -> None:
        from accelerate import Accelerator

        self.job, self.shared = job, shared
        first = next(iter(job.runs.values())).config
        size, body = first.render.image_size, training_body()
        accelerator = Accelerator(cpu=not torch.cuda.is_available())
        self.held_out = open_pictures(job.held_out, size)
        pictures = open_pictures(job.data, size)
        self.open: dict[int, TrainingRun] = {}
        self.saved: dict[int, float] = {}
        self.cost: dict[int, float] = {}
        self.timed: dict[int, float] = {}
        self.spent = dict.fromkeys(job.runs, 0.0)
        for place, run in job.runs.items():
            opened = self.guarded(
                place,
                lambda run=run, place=place: TrainingRun(run, pictures, body, job.folder(place), accelerator),
            )
            if opened is not None:
                self.open[place] = opened
                self.saved[place] = time.time()
                shared.images[place] = opened.images
        for place in [*self.open, *self.open]:  # the first time is slower
            if place in self.open:
                self.estimate(place)

    def guarded(self, place: int, do: Callable[[], Any]) -> Any:
        """What `do` returns; None where it fails, and then the run is out."""
        self.shared.active[self.job.worker] = place
        try:
            return do()
        except EXPECTED as error:
            self.job.log(f"{self.job.runs[place].key} failed: {error}\n{traceback.format_exc()}")
            leave_broken_device()
            self.drop(place)
        finally:
            self.shared.active[self.job.worker] = FAILED
        return None

    def drop(self, place: int) -> None:
        self.shared.images[place] = FAILED
        run = self.open.pop(place, None)
        if run is not None:
            run.close()

    def estimate(self, place: int) -> None:
        """Ask a run for its first pictures, encode them, and time it: how long showing them all will take."""
        started = time.perf_counter()
        if self.guarded(place, lambda: encode(Result(facts={}, shown=self.first_part(place)))) is not None:
            parts = -(-min(self.open[place].run.show.pictures, len(self.held_out)) // CHUNK)
            self.cost[place] = parts * (time.perf_counter() - started)
        self.timed[place] = time.time()
        total = sum(self.cost.get(each, 0.0) for each in self.open)
        self.shared.show_seconds[self.job.worker] = total * MARGIN

    def first_part(self, place: int) -> Shown:
        run = self.open[place]
        return next(show_in_parts(run.state.average, self.held_out, run.run.show))

    def train(self) -> None:
        """Turns until all runs are at their ends, or the conductor says stop."""
        ends = self.job.ends
        while not self.shared.stop.value:
            on = {place: run.images for place, run in self.open.items() if run.images < ends[place]}
            if not on:
                return
            place = min(on, key=lambda place: on[place])
            turn = SLICE * self.open[place].run.config.batch
            if on[place] >= self.shared.least(ends) + AHEAD * turn:
                time.sleep(WAIT)
                continue
            started = time.perf_counter()
            self.guarded(place, self.open[place].turn)
            self.spent[place] += time.perf_counter() - started
            if place in self.open:
                self.shared.images[place] = self.open[place].images
            self.save()
            self.time_again()

    def time_again(self) -> None:
        """Now and then how long showing takes, as other processes leave more or less of the machine."""
        for place in list(self.open):
            if time.time() - self.timed[place] > TIME_EVERY:
                self.estimate(place)
                return

    def save(self, *, all_of_them: bool = False) -> None:
        """Write states that are due."""
        for place in list(self.open):
            if all_of_them or time.time() - self.saved[place] > SAVE_EVERY:
                self.guarded(place, self.open[place].save)
                self.saved[place] = time.time()

    def show(self, common: int) -> None:
        """Ask all runs for their pictures, a part of each in turns, until the time is up; write what is
        there."""
        models = {
            place: self.guarded(place, lambda p=place: self.open[p].averaged_at(common))
            for place in list(self.open)
        }
        coming = {
            place: show_in_parts(found[0], self.held_out, self.open[place].run.show)
            for place, found in models.items()
            if found is not None
        }
        parts: dict[int, list[Shown]] = {place: [] for place in coming}
        while coming and time.time() < self.shared.show_until.value:
            for place in list(coming):
                part = self.guarded(place, lambda p=place: next(coming[p], None))
                if part is None:
                    del coming[place]
                else:
                    parts[place].append(part)
        for place, own in parts.items():
            if own and place in self.open:
                self.guarded(place, lambda p=place, own=own: self.write(p, models[p][1], together(own)))

    def write(self, place: int, images: int, shown: Shown) -> None:
        run = self.open[place]
        facts = {
            "name": run.run.name,
            "model": run.run.model,
            "seed": run.run.seed,
            "images": images,
            "seconds": self.spent[place],
            "device": device_name(run.device),
            "parameters": sum(each.numel() for each in run.state.average.parameters()),
            "last": run.last,
        }
        write_shown(self.job.folder(place), Result(facts=facts, shown=shown))
        run.state.average.save(
            self.job.folder(place) / "weights.safetensors", {"training": f"adversarial, {images} pictures"}
        )
        run.restore_average()


def leave_broken_device() -> None:
    """End the process, whose other runs the conductor gives to a new one, where the GPU answers nothing any
    more."""
    if torch.cuda.is_available():
        try:
            torch.cuda.synchronize()
        except RuntimeError:
            os._exit(BROKEN)


def device_name(device: torch.device) -> str:
    return torch.cuda.get_device_name(device) if device.type == "cuda" else "CPU"
