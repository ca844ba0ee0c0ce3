"""Independent jobs in processes of their own, which end quietly on Ctrl-C."""

from __future__ import annotations

import contextlib
import multiprocessing
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from typing import TypeVar

Job = TypeVar("Job")
Result = TypeVar("Result")


def in_processes(work: Callable[[Job], Result], jobs: Sequence[Job], workers: int) -> Iterator[Result]:
    """The results of `work` for each job, in order. They are computed in this process where there is one worker or one
    job.

    Where the caller stops early, by an error or by Ctrl-C, the workers are ended.
    """
    if workers <= 1 or len(jobs) <= 1:
        yield from map(work, jobs)
        return
    yield from _elsewhere(work, jobs, workers)


def in_a_new_process(work: Callable[[Job], Result], job: Job) -> Result:
    """The result of `work` for one job, computed in a new process, which ends with this one on Ctrl-C."""
    (result,) = _elsewhere(work, [job], 1)
    return result


def _elsewhere(work: Callable[[Job], Result], jobs: Sequence[Job], workers: int) -> Iterator[Result]:
    spawn, others = multiprocessing.get_context("spawn"), set(multiprocessing.active_children())
    with ProcessPoolExecutor(workers, spawn, initializer=_leave_interrupts_to_programs) as pool:
        try:
            with _deaf_to_interrupts():
                futures = [pool.submit(work, job) for job in jobs]
            for future in futures:
                yield future.result()
        except BaseException:
            # The pool notices the ended workers and fails its remaining futures. They must not be cancelled besides, as
            # pool.map does: a cancelled future raises in the pool's own thread, and another thread then keeps writing
            # to workers that have ended.
            for process in set(multiprocessing.active_children()) - others:
                process.terminate()
            raise


@contextlib.contextmanager
def _deaf_to_interrupts() -> Iterator[None]:
    """Block Ctrl-C in processes that are started inside, until they are ready. One sent to this process meanwhile is raised
    at the end."""
    if not hasattr(signal, "pthread_sigmask"):  # Windows: its consoles send Ctrl-C to every process
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})  # which new processes inherit
    heard: list[int] = []
    try:
        with _noted(heard):
            yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
    if heard:
        signal.raise_signal(signal.SIGINT)


@contextlib.contextmanager
def _noted(heard: list[int]) -> Iterator[None]:
    """Append Ctrl-C to `heard` where it reaches another thread of this process, as this one blocks it."""
    is_main = threading.current_thread() is threading.main_thread()
    is_pythons = signal.getsignal(signal.SIGINT) is not None
    # Only the main thread may set a handler, and a handler that is not Python's could not be set again.
    if not (is_main and is_pythons):
        yield
        return
    handler = signal.signal(signal.SIGINT, lambda number, frame: heard.append(number))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, handler)


def _leave_interrupts_to_programs() -> None:
    """Ignore Ctrl-C in a worker, which the process that started it ends; the compilers that it runs get the system's
    default again, and end by themselves."""
    signal.signal(signal.SIGINT, lambda number, frame: None)
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
