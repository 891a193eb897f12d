"""Loops in machine code, by numba, where numpy would need many passes over memory.

    @compiled       Python calls it: compiled on the first call for its arguments' types, then kept on disk
    @inner          only compiled functions call it: it becomes part of each of them

Such functions take arrays, numbers and named tuples of these. They carry no annotations, which machine code
would not check: their docstrings give shapes and units. Code on disk is renewed when the file of the compiled
function changes. So after a change to an inner function of another file, delete `__pycache__` there.

A named tuple is best unpacked at the start of a function that uses its arrays in a loop: every `tuple.array`
there counts references of its own, which takes time to compile.
"""

import inspect
from collections.abc import Callable
from typing import Any, Protocol, overload, runtime_checkable

from numba import njit


@runtime_checkable
class Kernel(Protocol):
    """A function in machine code, with the Python function that it was made of."""

    py_func: Callable[..., Any]

    def __call__(self, *args: Any) -> Any: ...


def compiled(function: Callable[..., Any]) -> Kernel:
    """The function in machine code, kept on disk for the next process where there is a place for it."""
    function = inspect.unwrap(function)  # under test, checks are wrapped around it
    try:
        return njit(cache=True, nogil=True)(function)
    except RuntimeError:  # neither this folder nor the user's can be written
        return njit(nogil=True)(function)


@overload
def inner(function: Callable[..., Any]) -> Kernel: ...
@overload
def inner(*, inline: str = ..., forceinline: bool = ...) -> Callable[[Callable[..., Any]], Kernel]: ...
def inner(function: Callable[..., Any] | None = None, **options: Any) -> Any:
    """A function for compiled ones alone: nothing of its own on disk, and no way in from Python, where only
    `.py_func` may be called. That takes a sixth less time to compile.

    Options are numba's: with `inline="always"` numba puts the body in the caller before types are known, with
    `forceinline=True` LLVM does so afterwards, which compiles faster where the body is long or has loops.
    """

    def decorate(function: Callable[..., Any]) -> Kernel:
        settings: dict[str, Any] = {"nogil": True, "no_cpython_wrapper": True, **options}
        return njit(**settings)(inspect.unwrap(function))

    return decorate if function is None else decorate(function)
