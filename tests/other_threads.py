"""Whether other threads run while C computes."""

import sys
import threading
import time
from collections.abc import Callable


def counted_during(call: Callable[[], object]) -> int:
    """How often another thread counted meanwhile. Nobody has to give up the GIL for 30 s: with it held, at most once."""
    counts, stop = [0], threading.Event()

    def count() -> None:
        while not stop.is_set():
            counts[0] += 1
            time.sleep(0)

    counter = threading.Thread(target=count)
    interval = sys.getswitchinterval()
    counter.start()
    try:
        sys.setswitchinterval(30)
        before = counts[0]
        call()
        return counts[0] - before
    finally:
        sys.setswitchinterval(interval)
        stop.set()
        counter.join()
