"""The same work on many pieces, by as many threads as torch may use, with results that do not depend on how
many."""

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
    try:
        with ThreadPoolExecutor(
            min(threads, len(pieces)), initializer=torch.set_num_threads, initargs=(1,)
        ) as pool:
            return list(pool.map(work, pieces))
    finally:
        torch.set_num_threads(threads)  # what the workers set is also what threads to come begin with
