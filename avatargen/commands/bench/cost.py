"""What a piece of work costs: seconds and memory of this process."""

import ctypes
import math
import os
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

STATUS, RESET = Path("/proc/self/status"), Path("/proc/self/clear_refs")


@dataclass
class Cost:
    """Known when the work is done: wall clock, processor time, and memory at its peak beyond the start's."""

    seconds: float = 0.0
    cpu_seconds: float = 0.0
    peak_mb: float = 0.0


@contextmanager
def measured() -> Iterator[Cost]:
    """Measure the body of a with statement; programs it runs count for their seconds, not their memory."""
    cost, resident = Cost(), reset_peak()
    wall, cpu = time.perf_counter(), cpu_seconds()
    yield cost
    cost.seconds, cost.cpu_seconds = time.perf_counter() - wall, cpu_seconds() - cpu
    cost.peak_mb = max(peak_mb() - resident, 0.0)


def cpu_seconds() -> float:
    """Of this process and of the finished ones that it started."""
    of_children = os.times()
    return time.process_time() + of_children.children_user + of_children.children_system


def reset_peak() -> float:
    """Forget the peak so far, where the system can; MB in use now, or the peak where it cannot."""
    trim = getattr(ctypes.CDLL(None), "malloc_trim", None) if sys.platform == "linux" else None
    if trim is not None:  # it is of the GNU C library alone
        trim(0)  # what was freed counts as free
    try:
        RESET.write_text("5")
        return status_mb("VmRSS")
    except OSError:
        return peak_mb()


def peak_mb() -> float:
    """The most memory this process has held since the last reset, MB; NaN where the system does not tell."""
    if STATUS.exists():
        return status_mb("VmHWM")
    try:
        import resource
    except ImportError:
        return math.nan
    unit = 1 if sys.platform == "darwin" else 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit / 1e6


def status_mb(name: str) -> float:
    line = next(line for line in STATUS.read_text().splitlines() if line.startswith(name))
    return int(line.split()[1]) * 1024 / 1e6
