"""Independent jobs in processes of their own, which Ctrl-C ends without a word."""

from __future__ import annotations

import contextlib
import multiprocessing
import signal
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from typing import TypeVar

Job = TypeVar("Job")
Result = TypeVar("Result")


def in_processes(work: Callable[[Job], Result], jobs: Sequence[Job], workers: int) -> Iterator[Result]:
    """`work` of each job, in order; in this process where one worker or one job is all there is.

    Where the caller stops early, by an error or by Ctrl-C, the workers are ended.
    """
    if workers <= 1 or len(jobs) <= 1:
        yield from map(work, jobs)
        return
    yield from _elsewhere(work, jobs, workers)


def in_a_new_process(work: Callable[[Job], Result], job: Job) -> Result:
    """`work` of one job, in a process that has done nothing before; ended with this one's by Ctrl-C."""
    (result,) = _elsewhere(work, [job], 1)
    return result


def _elsewhere(work: Callable[[Job], Result], jobs: Sequence[Job], workers: int) -> Iterator[Result]:
    with ProcessPoolExecutor(workers, multiprocessing.get_context("spawn")) as pool:
        try:
            with _deaf_to_interrupts():
                results = pool.map(work, jobs)
            yield from results
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            for process in multiprocessing.active_children():
                process.terminate()
            raise


@contextlib.contextmanager
def _deaf_to_interrupts() -> Iterator[None]:
    """Processes started inside never hear Ctrl-C: this one answers for all. What comes meanwhile is heard behind."""
    if not hasattr(signal, "pthread_sigmask"):  # Windows: its consoles send Ctrl-C to every process
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})  # which new processes inherit
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
