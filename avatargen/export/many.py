"""Many seeds: worker processes that load libraries and weights once, and a parent that hands out seeds.

A worker that dies takes one seed with it: the parent writes that down and starts another worker. Seeds that
failed, and those that an interrupted run left, are made by the same request.
"""

import multiprocessing
import os
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from pathlib import Path

from assets.pipeline import Progress
from avatargen.errors import AvatarGenError, InputError
from avatargen.export.fingerprint import fingerprint
from avatargen.export.manifest import NAME, Row, open_manifest
from avatargen.export.on_ray import ray_outcomes
from avatargen.export.one import silent
from avatargen.export.request import ExportRequest
from avatargen.export.sheet import open_sheet, picture_of, write_sheet
from avatargen.export.worker import work
from avatargen.extras import require_extra

PATIENCE = 10.0  # seconds that a worker gets to leave
SPAWN = multiprocessing.get_context("spawn")  # a fork would copy a parent's locks, and CUDA forbids it


@dataclass(frozen=True, kw_only=True)
class Batch:
    """What the folder holds of the seeds asked for."""

    manifest: Path
    rows: tuple[Row, ...]  # one a seed, in their order
    made: int  # of them now
    seconds: float

    @property
    def failed(self) -> tuple[Row, ...]:
        return tuple(row for row in self.rows if row.error is not None)


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


def unheard(row: Row) -> None:
    """A row that nobody waits for."""


def export_many(
    request: ExportRequest, progress: Progress = silent, each: Callable[[Row], None] = unheard
) -> Batch:
    """Make every seed that the folder does not hold yet; with a sheet, also those whose picture it does not
    hold. `each` hears a row as it is written.

    A seed that fails is a row that says why, and fails no other; the same request tries it again. Worker
    processes import the calling script, so a script calls this under `if __name__ == "__main__":`.

    Raises:
        AvatarGenError: the request or a file is bad, the folder was made by another request, workers cannot
            start, or the sheet cannot be written.
    """
    if isinstance(request.seeds, int) or request.out is None:
        raise InputError("export_many: found one seed, wanted many; see export_avatar")
    if request.ray is not None:
        require_extra("ray")
    started, seeds, out, sheet = time.monotonic(), request.seeds, request.out, request.sheet
    with open_manifest(out, fingerprint(request)) as manifest:
        if sheet is not None:
            open_sheet(request, out, seeds)
        todo = [
            seed
            for seed in seeds
            if not manifest.holds(seed) or (sheet is not None and not picture_of(out, seed).exists())
        ]
        ray = request.ray
        rows = outcomes(request, todo) if ray is None else ray_outcomes(ray, request, todo)
        for count, row in enumerate(rows, start=1):
            manifest.add(row)
            each(row)
            progress(f"{count} of {len(todo)}", count / len(todo))
        if sheet is not None:
            write_sheet(sheet, out, (seed for seed in seeds if manifest.rows[seed].error is None))
        return Batch(
            manifest=out / NAME,
            rows=tuple(manifest.rows[seed] for seed in seeds),
            made=len(todo),
            seconds=time.monotonic() - started,
        )


def outcomes(request: ExportRequest, todo: list[int]) -> Iterator[Row]:
    """A row for each seed, in the order they are done.

    Raises:
        AvatarGenError: workers cannot start.
    """
    left = list(reversed(todo))
    workers: list[Worker] = []
    try:
        while left or any(worker.seed is not None for worker in workers):
            idle = sum(worker.seed is None for worker in workers)
            more = min((request.jobs or 1) - len(workers), len(left) - idle)
            workers += [start_worker(request) for _ in range(more)]
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


def start_worker(request: ExportRequest) -> Worker:
    """A process of its own; the processors are shared out among the jobs."""
    processors = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    os.environ.setdefault("OMP_NUM_THREADS", str(max(1, processors // (request.jobs or 1))))
    here, there = SPAWN.Pipe()
    process = SPAWN.Process(target=work, args=(there,))
    process.start()
    there.close()  # so that a dead worker's pipe ends
    with suppress(OSError):  # it has just died; its pipe's end will be heard next
        here.send(request)
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
