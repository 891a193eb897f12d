"""Loops in machine code, by numba, where numpy would need many passes over memory."""

import inspect
from collections.abc import Callable
from typing import Any

from numba import njit


def compiled(function: Callable, **options: Any) -> Callable:
    """The function in machine code, kept on disk for the next process where there is a place for it."""
    function = inspect.unwrap(function)  # under test, checks are wrapped around it
    try:
        return njit(cache=True, nogil=True, **options)(function)
    except RuntimeError:  # neither this folder nor the user's can be written
        return njit(nogil=True, **options)(function)
