"""Runs independent jobs elsewhere: in processes of this machine, which end without a traceback on Ctrl-C, or on the
workers of a Dask cluster. A cluster that is not there, or that ends, is an error of one line."""

from __future__ import annotations

import contextlib
import logging
import multiprocessing
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import CancelledError
from contextlib import contextmanager
from multiprocessing.connection import Connection, wait
from multiprocessing.resource_tracker import ensure_running
from typing import Any, TypeVar, cast

from psdmc.errors import InputError, ToolchainError

AHEAD, CONNECT = 2, "10s"
"""Jobs that each thread of a worker is given at once, and the time that a scheduler has to answer."""

Job = TypeVar("Job")
Result = TypeVar("Result")


def in_processes(work: Callable[[Job], Result], jobs: Sequence[Job], workers: int) -> Iterator[Result]:
    """Yield the result of `work` for each job, in the order of the jobs, computed in up to `workers` processes. With
    one worker or one job, no other process is started.

    If the caller stops early, by an error or by Ctrl-C, the worker processes are ended.
    """
    if workers <= 1 or len(jobs) <= 1:
        yield from map(work, jobs)
        return
    yield from _elsewhere(work, jobs, workers)


def in_a_new_process(work: Callable[[Job], Result], job: Job) -> Result:
    """Return the result of `work` for one job in a new process, which Ctrl-C in this process also ends."""
    (result,) = _elsewhere(work, [job], 1)
    return result


def _elsewhere(work: Callable[[Job], Result], jobs: Sequence[Job], workers: int) -> Iterator[Result]:
    """Compute by one pipe to each worker and no further thread. A pool's thread that writes a long job to a worker which
    has ended waits for ever (Python before 3.11.5, gh-94777): here writing to an ended worker is an error."""
    spawn = multiprocessing.get_context("spawn")
    processes, pipes = [], []
    try:
        with _deaf_to_interrupts():
            for _ in range(min(workers, len(jobs))):
                ours, theirs = spawn.Pipe()
                process = spawn.Process(target=_serve, args=(work, theirs))
                process.start()
                processes.append(process)
                pipes.append(ours)
                theirs.close()
        yield from _answers(pipes, jobs)
    except BaseException:
        for process in processes:
            process.terminate()
        raise
    finally:
        for pipe in pipes:
            pipe.close()
        for process in processes:
            process.join()


def _answers(pipes: Sequence[Connection], jobs: Sequence[Job]) -> Iterator[Any]:
    """Give each worker that asks its next job; the results, in order."""
    waiting = iter(enumerate(jobs))
    answers: dict[int, tuple[Any, Exception | None]] = {}
    for number in range(len(jobs)):
        while number not in answers:
            for pipe in cast(list[Connection], wait(pipes)):
                try:
                    answers |= pipe.recv()
                    following = next(waiting, None)
                    if following is not None:
                        pipe.send(following)
                except (EOFError, ConnectionError):
                    raise ToolchainError(
                        "a process that psdmc started was ended from outside",
                        "close other programs if memory was short, then try again",
                    ) from None
        result, error = answers.pop(number)
        if error is not None:
            raise error
        yield result


def _serve(work: Callable[[Job], Result], pipe: Connection) -> None:
    """Ask for a job with the last one's answer, {} at first, until the caller needs no more."""
    _leave_interrupts_to_programs()
    answer: dict[int, tuple[Any, Exception | None]] = {}
    with contextlib.suppress(EOFError, ConnectionError):
        while True:
            pipe.send(answer)
            number, job = pipe.recv()
            try:
                answer = {number: (work(job), None)}
            except Exception as error:
                answer = {number: (None, error)}


@contextlib.contextmanager
def _deaf_to_interrupts() -> Iterator[None]:
    """Block Ctrl-C in processes that are started inside, until they are ready. One sent to this process meanwhile is raised
    at the end."""
    if not hasattr(signal, "pthread_sigmask"):  # Windows: its consoles send Ctrl-C to every process
        yield
        return
    ensure_running()  # multiprocessing's resource tracker, whose start would unblock the signal
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


@contextmanager
def connected(scheduler: str) -> Iterator[Any]:
    """Yield a client (distributed.Client) of the Dask scheduler with this address, such as tcp://host:8786.

    Raises InputError if Dask's distributed is not installed. Raises ToolchainError if the scheduler does not answer, or
    if the scheduler or several workers end within the block. Dask gives the jobs of one worker that ends to others.
    """
    try:
        from distributed import Client, KilledWorker
    except ImportError as error:
        raise InputError("--scheduler needs Dask's distributed", "pip install 'psdmc[cluster]'") from error
    try:
        client: Any = Client(scheduler, timeout=CONNECT, set_as_default=False)  # type: ignore[no-untyped-call]
    except (OSError, ValueError) as error:
        reason = str(error).splitlines()[0]
        raise ToolchainError(
            f"--scheduler {scheduler}: does not answer: {reason}",
            "start one: dask scheduler, then dask worker",
        ) from error
    with _without_its_own_messages(), client:
        try:
            yield client
        except KilledWorker as error:
            raise ToolchainError(
                f"--scheduler {scheduler}: several workers died: {error}",
                "look into their logs, then type it again",
            ) from error
        except CancelledError as error:
            raise ToolchainError(
                f"--scheduler {scheduler}: the connection was lost", "start it anew, then type it again"
            ) from error


@contextmanager
def _without_its_own_messages() -> Iterator[None]:
    """Dask writes tracebacks of a lost connection to the console: the error above says it in a line."""
    loggers = [logging.getLogger(f"distributed.{name}") for name in ("client", "utils", "comm")]
    before = [logger.level for logger in loggers]
    for logger in loggers:
        logger.setLevel(logging.CRITICAL + 1)
    try:
        yield
    finally:
        for logger, level in zip(loggers, before, strict=True):
            logger.setLevel(level)


class Lost(Exception):
    """The cluster, or several of its workers, ended before a result was there."""


def submitted(client: Any, function: Any, *given: Any) -> Any:
    """Return the future result of a job. Raises Lost if the connection to the scheduler is closed."""
    try:
        return client.submit(function, *given, pure=False)
    except (OSError, RuntimeError) as error:
        raise Lost(str(error)) from error


def result_of(future: Any) -> Any:
    """Return the result of a job. Raises Lost if the cluster or several workers end before it is there."""
    from distributed import KilledWorker

    try:
        return future.result()
    except (CancelledError, KilledWorker) as error:
        raise Lost(str(error)) from error


def at_once(client: Any) -> int:
    """Return how many jobs the workers of a client are given at once."""
    return AHEAD * max(1, sum(map(int, client.nthreads().values())))
