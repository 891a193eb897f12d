"""The same work on many pieces, by as many threads as torch may use, with results that do not depend on how
many."""

import functools
import os
import threading
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

import torch

Piece = TypeVar("Piece")
Result = TypeVar("Result")


def spread(work: Callable[[Piece], Result], pieces: Sequence[Piece]) -> list[Result]:
    """`work` on each piece, in order. Within it torch has one thread: each sees the same arithmetic."""
    threads = torch.get_num_threads()
    if threads == 1:
        return [work(piece) for piece in pieces]
    return list(workers(threads, os.getpid()).map(work, pieces))


@functools.cache
def workers(count: int, process: int) -> ThreadPoolExecutor:
    """Threads in which torch has one, kept: a new one takes longer to start than small work takes.
    A forked child has none of its parent's threads, so they belong to a process."""
    pool, met = ThreadPoolExecutor(count), threading.Barrier(count)
    list(pool.map(lambda _: limit_torch(met), range(count)))
    torch.set_num_threads(count)  # what they set is also what other threads to come begin with
    return pool


def limit_torch(met: threading.Barrier) -> None:
    """Give torch one thread in this one, and wait for the others."""
    torch.set_num_threads(1)
    torch.get_num_threads()  # a thread takes over what was set last when it first asks
    met.wait()
