"""What a piece of work costs: seconds and memory of this process."""

import ctypes
import resource
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
    usage = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(use.ru_utime + use.ru_stime for use in usage)


def reset_peak() -> float:
    """Forget the peak so far, where the system can; MB in use now, or the peak where it cannot."""
    trim = getattr(ctypes.CDLL(None), "malloc_trim", None)  # of the GNU C library alone
    if trim is not None:
        trim(0)  # what was freed counts as free
    try:
        RESET.write_text("5")
        return status_mb("VmRSS")
    except OSError:
        return peak_mb()


def peak_mb() -> float:
    """The most memory this process has held since the last reset, MB."""
    if STATUS.exists():
        return status_mb("VmHWM")
    unit = 1 if sys.platform == "darwin" else 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit / 1e6


def status_mb(name: str) -> float:
    line = next(line for line in STATUS.read_text().splitlines() if line.startswith(name))
    return int(line.split()[1]) * 1024 / 1e6
