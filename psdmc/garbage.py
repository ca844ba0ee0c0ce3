"""Python's search for reference cycles, made rarely while a stage makes millions of small objects.

PROGRAMs and traces have no cycles, but Python counts how many tuples there are, and looks through all of them again each
time that 700 more are alive: a fifth of the time that a humanoid's C takes.
"""

from __future__ import annotations

import gc
from collections.abc import Iterator
from contextlib import contextmanager
from threading import Lock

RARELY = 5_000_000
"""Objects made, beyond those that are gone again, before Python looks for cycles: some 500 MB."""

_lock = Lock()
_stages = 0
_usual = (0, 0, 0)


@contextmanager
def collecting_rarely() -> Iterator[None]:
    """Let Python look for cycles every RARELY objects. The process's own thresholds are set again when the last of the
    stages that run at a time, in each other or in several threads, has ended. A process that looks for cycles more rarely,
    or never, is left as it is."""
    global _stages, _usual
    with _lock:
        if _stages == 0:
            _usual = gc.get_threshold()
            if 0 < _usual[0] < RARELY:
                gc.set_threshold(RARELY, *_usual[1:])
        _stages += 1
    try:
        yield
    finally:
        with _lock:
            _stages -= 1
            if _stages == 0:
                gc.set_threshold(*_usual)
