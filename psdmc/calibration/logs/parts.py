"""Computes the parts of a log at once: in two threads of this process, or on the workers of a Dask cluster."""

from __future__ import annotations

import pickle
import warnings
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from functools import partial
from operator import call
from typing import Any, TypeVar

from psdmc.workers import Lost, at_once, connected, result_of, submitted

AT_ONCE = 2
"""Parts in this process: NumPy and compiled functions let other threads run, and each part needs memory."""

Part = TypeVar("Part")
Result = TypeVar("Result")


@dataclass(slots=True, eq=False)
class Workers:
    """The workers of a Dask cluster.

    client  distributed.Client of their scheduler
    ahead   number of parts that the workers are given at once
    said    function that is called with a sentence if the cluster is lost
    lost    whether the cluster was lost; this process then computes the rest
    """

    client: Any
    ahead: int
    said: Callable[[str], None]
    lost: bool = False

    def submitted(self, function: Any, *given: Any) -> Any:
        """Return the future result of a function; None if the cluster is lost."""
        if self.lost:
            return None
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", "Sending large graph")  # a part has 10 MB, and is sent once
            try:
                return submitted(self.client, function, *given)
            except Lost:
                self._lose()
                return None

    def result(self, future: Any, again: Callable[[], Any]) -> Any:
        """Return the result of a part. If the cluster is lost, `again` computes it."""
        if not self.lost:
            try:
                return result_of(future)
            except Lost:
                self._lose()
        return again()

    def _lose(self) -> None:
        self.lost = True
        self.said(LOST)


LOST = "the Dask cluster was lost: this process computed the rest"

_workers: ContextVar[Workers | None] = ContextVar("workers", default=None)


@contextmanager
def on_cluster(scheduler: str | None, said: Callable[[str], None]) -> Iterator[Workers | None]:
    """Within the block, the workers of a Dask scheduler compute the parts of logs; None: this process does.

    scheduler  address, such as tcp://host:8786; see psdmc.workers.connected for its errors
    said       function that is called with a sentence if the cluster is lost
    """
    if scheduler is None:
        yield None
        return
    with connected(scheduler) as client:
        workers = Workers(client, at_once(client), said)
        before = _workers.set(workers)
        try:
            yield workers
        finally:
            _workers.reset(before)


def each_part(parts: Iterable[Part], work: Callable[[Part], Result]) -> Iterator[tuple[Part, Result]]:
    """Yield each part with what `work` computes from it, in the order of the parts. Few parts are in memory at once."""
    workers = _workers.get()
    if workers is None or workers.lost:
        yield from in_threads(parts, work)
        return
    import cloudpickle

    function = workers.submitted(pickle.loads, cloudpickle.dumps(work))
    for part, future in _ahead(parts, lambda part: workers.submitted(call, function, part), workers.ahead):
        yield part, workers.result(future, partial(work, part))


def in_threads(parts: Iterable[Part], work: Callable[[Part], Result]) -> Iterator[tuple[Part, Result]]:
    """Yield each part with what `work` computes from it in this process, in the order of the parts."""
    with ThreadPoolExecutor(AT_ONCE) as pool:
        for part, future in _ahead(parts, lambda part: pool.submit(work, part), AT_ONCE):
            yield part, future.result()


def _ahead(parts: Iterable[Part], submit: Callable[[Part], Any], ahead: int) -> Iterator[tuple[Part, Any]]:
    """Parts and their future results, of which `ahead` are waited for at once."""
    waiting: deque[tuple[Part, Any]] = deque()
    for part in parts:
        waiting.append((part, submit(part)))
        if len(waiting) > ahead:
            yield waiting.popleft()
    yield from waiting
