"""Many seeds on a Ray cluster that is running already: one actor a job, each as a worker process is.

Every node needs this project at the same version, and the files and the folder of the command under the same
paths. A worker that dies costs the seed it was at; another takes its place.
"""

import logging
import sys
import time
from collections.abc import Iterator
from contextlib import redirect_stdout
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

from avatargen.errors import AvatarGenError, InputError
from avatargen.export.manifest import Row
from avatargen.export.request import ExportRequest


class Maker:
    """What runs in the cluster: loads once, then makes one seed after another."""

    def __init__(self, request: ExportRequest) -> None:
        from avatargen.export.seed import SeedExporter

        self.problem = ""
        try:
            self.exporter = SeedExporter(request)
        except AvatarGenError as error:
            self.problem = str(error)

    def find_problem(self) -> str:
        """Why no seed can be made, or nothing."""
        return self.problem

    def export(self, seed: int) -> Row:
        return self.exporter.export(seed)


def ray_outcomes(address: str, request: ExportRequest, todo: list[int]) -> Iterator[Row]:
    """A row for each seed, in the order they are done.

    Raises:
        InputError: Ray is not installed, the cluster does not answer, or the request or a file is bad there.
    """
    if not todo:
        return
    with redirect_stdout(sys.stderr):  # where Ray tells of what dies
        yield from made_by(connect(address), request, todo)


def made_by(ray: Any, request: ExportRequest, todo: list[int]) -> Iterator[Row]:
    try:
        count = request.jobs or int(ray.cluster_resources().get("CPU", 1))
        makers = [start(ray, request) for _ in range(min(count, len(todo)))]
        left, running = list(reversed(todo)), {}
        while left or running:
            while makers and left:
                maker, seed = makers.pop(), left.pop()
                running[maker.export.remote(seed)] = (maker, seed, time.monotonic())
            (done,), _ = ray.wait(list(running), num_returns=1)
            maker, seed, since = running.pop(done)
            try:
                row = ray.get(done)
            except ray.exceptions.RayError as error:
                maker = start(ray, request) if left else None
                row = Row(
                    seed=seed, error=f"its worker died ({kind(error)})", seconds=time.monotonic() - since
                )
            makers += [maker] if maker else []
            yield row
    finally:
        ray.shutdown()


def connect(address: str) -> Any:
    """Ray, connected to the cluster at an address.

    Raises:
        InputError: it is not installed, or nothing answers there.
    """
    import ray

    try:
        ray.init(address=address, log_to_driver=False, logging_level=logging.ERROR)
    except (ConnectionError, RuntimeError, ValueError, TimeoutError) as error:
        reason = str(error).strip().splitlines()[0][:200] if str(error).strip() else type(error).__name__
        raise InputError(
            f"found --ray {address}, where no cluster answers ({reason}); check the address"
        ) from error
    return ray


def start(ray: Any, request: ExportRequest) -> Any:
    """An actor that has loaded everything.

    Raises:
        InputError: the request or a file is bad where it runs.
    """
    maker = ray.remote(num_cpus=1, max_restarts=0)(Maker).remote(with_whole_paths(request))
    try:
        problem = ray.get(maker.find_problem.remote())
    except ray.exceptions.RayError as error:
        raise InputError(
            f"a worker of the cluster ended before its first seed ({kind(error)}); install this project there"
        ) from error
    if problem:
        raise InputError(problem)
    return maker


def with_whole_paths(request: ExportRequest) -> ExportRequest:
    """The request with paths that mean the same in any folder."""
    return replace(request, **{each.name: whole(getattr(request, each.name)) for each in fields(request)})


def whole(value: Any) -> Any:
    """A field with its paths, alone or several, from the root of the file system."""
    if isinstance(value, tuple):
        return tuple(map(whole, value))
    return value.resolve() if isinstance(value, Path) else value


def kind(error: Exception) -> str:
    return type(error).__name__
