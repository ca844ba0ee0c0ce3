"""What one input may cost: processor time, and memory beyond what the libraries take."""

from __future__ import annotations

import os
import resource
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

SECONDS = 10.0
"""Processor time for a file under 1 MB: other work on the machine does not count against it."""

CHECK_SECONDS = 40.0
"""Processor time for the check of a derived model: it compares every function with Pinocchio, and takes 12 s for a chain
of 51 joints. Users wait for what is read and derived; a check is for their tests."""

STUCK_SECONDS = 180.0
"""Wall clock after which the parent ends a process that hangs where no signal is looked at (compiled code)."""

MEMORY = 2 * 1024**3
"""bytes of address space beyond what stands after the imports."""

LARGEST_INPUT = 1_000_000
"""bytes"""


class TooSlow(BaseException):
    """Time is up; no `except Exception` on the way stops it."""


@contextmanager
def limited_time(seconds: float = SECONDS) -> Iterator[None]:
    """TooSlow is raised in here after so much processor time. Main thread only. What runs in here does not count
    against a limit around it."""

    def stop(number: int, frame: object) -> None:
        raise TooSlow(f"more than {seconds:g} s")

    before = signal.signal(signal.SIGPROF, stop)
    left, _ = signal.setitimer(signal.ITIMER_PROF, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, before)
        signal.setitimer(signal.ITIMER_PROF, left)


@contextmanager
def limited_memory(extra: int = MEMORY) -> Iterator[None]:
    """MemoryError instead of more than `extra` bytes of new address space."""
    before = resource.getrlimit(resource.RLIMIT_AS)
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[0])
    bound = pages * os.sysconf("SC_PAGE_SIZE") + extra
    resource.setrlimit(resource.RLIMIT_AS, (bound, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_AS, before)
