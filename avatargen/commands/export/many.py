"""Many seeds: worker processes that load libraries and weights once, and a parent that hands out seeds.

The parent imports nothing heavy. A worker that dies takes one seed with it: the parent writes that down and
starts another worker. Seeds that failed, and those that an interrupted run left, are made by the same
command.
"""

import hashlib
import multiprocessing
import os
import signal
import sys
import time
from argparse import Namespace
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from pathlib import Path

from avatargen import __version__
from avatargen.commands.export.manifest import NAME, Row, open_manifest
from avatargen.commands.export.on_ray import ray_outcomes
from avatargen.commands.export.scenes import SCENES
from avatargen.commands.line import terminate
from avatargen.commands.progress import Show
from avatargen.errors import AvatarGenError, InputError

SETTINGS = (
    "scene",
    "content",
    "faces",
    "texture",
    "normal_map",
    "ambient_occlusion",
    "texture_format",
    "compress",
    "resolution",
    "tolerance",
    "joints",
    "pose",
    "names",
    "morphs",
    "clip",
    "fps",
    "speed",
    "mirror",
    "in_place",
)
FILES = ("weights", "body")
PATIENCE = 10.0  # seconds that a worker gets to leave
SPAWN = multiprocessing.get_context("spawn")  # a fork would copy a parent's locks, and CUDA forbids it


@dataclass
class Worker:
    """A process, the end of the pipe to it, and the seed it is at."""

    process: BaseProcess
    pipe: Connection
    seed: int | None = None
    ready: bool = False
    dead: bool = False
    since: float = field(default_factory=time.monotonic)

    def give(self, seed: int) -> None:
        self.seed, self.since = seed, time.monotonic()
        with suppress(OSError):  # it has just died; its pipe's end will be heard next
            self.pipe.send(seed)


def export_many(given: Namespace, show: Show) -> str:
    """Make every seed of the range that the folder does not hold yet; returns the closing line.

    Raises:
        AvatarGenError: an option or file is bad, or some seeds have failed; their rows say why.
    """
    started = time.monotonic()
    seeds = range(*given.seeds)
    with open_manifest(given.out, settings_of(given)) as manifest:
        todo = [seed for seed in seeds if not manifest.holds(seed)]
        rows = outcomes(given, todo) if given.ray is None else ray_outcomes(given, todo)
        for count, row in enumerate(rows, start=1):
            manifest.add(row)
            if row.error is not None:
                print(f"seed {row.seed}: {row.error}", file=sys.stderr)
            show(f"{count} of {len(todo)}", count / len(todo))
        failed = [seed for seed in seeds if manifest.rows[seed].error is not None]
    if failed:
        first = ", ".join(map(str, failed[:5])) + (", ..." if len(failed) > 5 else "")
        raise AvatarGenError(
            f"{len(failed)} of {len(seeds)} seeds failed ({first}); {given.out / NAME} says why, and the "
            "same command tries them again"
        )
    minutes = (time.monotonic() - started) / 60
    rate = f", {len(todo) / minutes:.1f} a minute" if todo else ""
    return f"{given.out}: {len(seeds)} avatars, {len(todo)} of them made now{rate}"


def settings_of(given: Namespace) -> dict[str, object]:
    """Whatever makes a seed's file another file; files by their contents."""
    plain: dict[str, object] = {name: getattr(given, name) for name in SETTINGS}
    plain |= {name: digest(path) for name in FILES if (path := getattr(given, name)) is not None}
    plain["motion"] = {path.stem: digest(path) for path in given.motion}
    return plain | {"version": __version__, "format": given.format or SCENES[given.scene].format}


def digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def outcomes(given: Namespace, todo: list[int]) -> Iterator[Row]:
    """A row for each seed, in the order they are done.

    Raises:
        AvatarGenError: workers cannot start.
    """
    left = list(reversed(todo))
    workers: list[Worker] = []
    try:
        while left or any(worker.seed is not None for worker in workers):
            idle = sum(worker.seed is None for worker in workers)
            more = min((given.jobs or 1) - len(workers), len(left) - idle)
            workers += [start_worker(given) for _ in range(more)]
            for pipe in wait([worker.pipe for worker in workers]):
                worker = next(worker for worker in workers if worker.pipe is pipe)
                row, worker.seed = hear(worker), None
                if row is not None:
                    yield row
                if worker.dead:
                    workers.remove(worker)
                elif left:
                    worker.give(left.pop())
    finally:
        stop(workers)


def hear(worker: Worker) -> Row | None:
    """What a worker says: that it is ready, or a seed's row; of one that died, the row of the seed it was at.

    Raises:
        AvatarGenError: it could not start.
    """
    try:
        said = worker.pipe.recv()
    except (EOFError, OSError):
        return bury(worker)
    if isinstance(said, str):
        raise InputError(said)
    worker.ready = True
    return said


def bury(worker: Worker) -> Row | None:
    """The row of the seed that a dead worker was at.

    Raises:
        AvatarGenError: it died before it could work, and so would the next.
    """
    worker.dead = True
    worker.process.join()
    code = worker.process.exitcode or 0
    how = f"killed by signal {-code}" if code < 0 else f"status {code}"
    if not worker.ready:
        raise AvatarGenError(f"a worker ended before its first seed ({how}); what it printed may say why")
    if worker.seed is None:
        return None
    seconds = round(time.monotonic() - worker.since, 3)
    return Row(seed=worker.seed, error=f"its worker died ({how})", seconds=seconds)


def start_worker(given: Namespace) -> Worker:
    """A process of its own; the processors are shared out among the jobs."""
    processors = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    os.environ.setdefault("OMP_NUM_THREADS", str(max(1, processors // (given.jobs or 1))))
    here, there = SPAWN.Pipe()
    process = SPAWN.Process(target=work, args=(there, given))
    process.start()
    there.close()  # so that a dead worker's pipe ends
    return Worker(process, here)


def stop(workers: list[Worker]) -> None:
    """Let idle workers go, and end busy ones."""
    for worker in workers:
        if worker.seed is None and worker.ready:
            worker.pipe.close()
        else:
            worker.process.terminate()
    for worker in workers:
        worker.process.join(PATIENCE)
        worker.process.kill()
        worker.process.join()


def work(pipe: Connection, given: Namespace) -> None:
    """The worker: load once, say None, then answer each seed with its row until the pipe ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent is interrupted too, and ends its workers
    signal.signal(signal.SIGTERM, terminate)
    from avatargen.commands.export.seed import SeedExporter

    try:
        exporter = SeedExporter(given)
    except AvatarGenError as error:
        pipe.send(str(error))
        return
    pipe.send(None)
    while True:
        try:
            pipe.send(exporter.export(pipe.recv()))
        except (EOFError, OSError):  # the parent is gone
            return
