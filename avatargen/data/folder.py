"""A data set's pictures are PNG, made in processes of their own."""

import io
import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from contextlib import contextmanager
from multiprocessing import get_context
from typing import Any, TypeVar

import numpy as np
from PIL import Image

Result = TypeVar("Result")


def in_processes(
    workers: int,
    start: tuple[Callable[..., None], tuple[Any, ...]],
    work: Callable[..., Result],
    jobs: Sequence[tuple[Any, ...]],
) -> Iterator[Result]:
    """Call `work(*job)` for every job in processes that `start` made ready; yields what it returns, in any
    order. What `work` raises ends it all.
    """
    function, arguments = start
    with (
        single_threaded(),
        ProcessPoolExecutor(
            workers, mp_context=get_context("spawn"), initializer=function, initargs=arguments
        ) as pool,
    ):
        futures = [pool.submit(work, *job) for job in jobs]
        try:
            for future in as_completed(futures):
                yield future.result()
        finally:
            for future in futures:
                future.cancel()


@contextmanager
def single_threaded() -> Iterator[None]:
    """Processes started meanwhile use one thread each: a process a core is faster than threads that share."""
    before = os.environ.get("OMP_NUM_THREADS")
    os.environ["OMP_NUM_THREADS"] = "1"
    try:
        yield
    finally:
        del os.environ["OMP_NUM_THREADS"]
        if before is not None:
            os.environ["OMP_NUM_THREADS"] = before


def png(pixels: np.ndarray) -> bytes:
    """PNG of [S S 3] or [S S] in 8 bits, or [S S] in 16; quick rather than small."""
    stream = io.BytesIO()
    Image.fromarray(pixels).save(stream, format="png", compress_level=1)
    return stream.getvalue()
