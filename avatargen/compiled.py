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


def inner(function: Callable, **options: Any) -> Callable:
    """A function for compiled ones alone, which take it in: nothing of its own on disk, and no way in from
    Python, where only `.py_func` may be called; a sixth less time to compile."""
    without_wrapper: dict[str, Any] = {"nogil": True, "no_cpython_wrapper": True}
    return njit(**without_wrapper, **options)(inspect.unwrap(function))
