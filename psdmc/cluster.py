"""Connects to the scheduler of a Dask cluster. A cluster that is not there, or that ends, is an error of one line."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from concurrent.futures import CancelledError
from contextlib import contextmanager
from typing import Any

from psdmc.errors import InputError, ToolchainError

AHEAD, CONNECT = 2, "10s"
"""Jobs that each thread of a worker is given at once, and the time that a scheduler has to answer."""


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
