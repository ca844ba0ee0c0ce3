"""Makes Python search less often for reference cycles (unused objects that refer to each other), while psdmc creates
millions of small objects.

The PROGRAMs (lists of operations) of psdmc are tuples of tuples, and neither they nor traces have cycles. By default Python
searches for cycles each time 700 more tuples exist. For a humanoid this search takes a fifth of the time to generate the C
code.
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
    """Within the `with` block, let Python search for reference cycles only each time RARELY more objects exist.

    Blocks can be nested or run in several threads. After the last block ends, Python's settings from before the first
    block are restored. If Python already searches less often, or never, nothing is changed.
    """
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
