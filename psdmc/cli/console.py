"""Shows on standard error at which step a command is, how long the step will take, and which command comes next.

A step is a changing line on a terminal. Elsewhere psdmc prints one line for each stage that takes long.
"""

from __future__ import annotations

import os
import re
import shlex
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress

from psdmc.progress import Progress, Step

PATIENCE = 2.0
"""s that a command may take before anything is said, and between two lines where there is no terminal."""

TICK = 0.2
"""s between two looks at the clock."""

WORTH_SAYING = 1.0
"""s that a stage must still take for a line about it: one that is about to end says so by ending."""

FIRST_SHARE = 0.02
"""Share of the work from which the time left is estimated."""


class Estimate:
    """The current stage of a command, and an estimate of the time that it still takes.

    A new stage begins if a step's text differs in more than its numbers, or if its share of the work is smaller than
    before.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._key = ""
        self._share: float | None = None
        self._first: tuple[float, float] | None = None
        self.begun = clock()
        self.text = ""
        self.stage = 0

    def tell(self, step: str) -> None:
        """A step began or went on."""
        share = step.share if isinstance(step, Step) else None
        key = "" if share is not None and self._share is not None else re.sub(r"[\d.,]+", "", step)
        fell = share is not None and (self._share is None or share < self._share)
        if fell or (share is None and key != self._key):
            self.stage += 1
            self.begun = self._clock()
            self._first = None if share is None else (self.begun, share)
        self.text, self._share, self._key = one_line(str(step)), share, key or self._key

    def spent(self) -> float:
        """s since the stage began."""
        return self._clock() - self.begun

    def left(self) -> float | None:
        """Estimate the time in s until the end of the stage from its pace so far; None if it has only begun."""
        if self._share is None or self._first is None:
            return None
        begun, first = self._first
        done = self._share - first
        if done < FIRST_SHARE:
            return None
        return (self._clock() - begun) * (1.0 - self._share) / done


def in_words(seconds: float) -> str:
    """About so long: '40 s', '3 min'."""
    return f"{seconds:.0f} s" if seconds < 100 else f"{seconds / 60:.0f} min"


class Lines:
    """Shows progress without a terminal: one line for each long stage, none in the first PATIENCE seconds."""

    def __init__(self, say: Callable[[str], None], clock: Callable[[], float] = time.monotonic) -> None:
        self._say, self._clock = say, clock
        self._lock = threading.Lock()
        self._estimate = Estimate(clock)
        self._last, self._told = clock(), 0

    def tell(self, step: str) -> None:
        with self._lock:
            self._estimate.tell(step)

    def look(self) -> None:
        """Print the current stage of the command if it has not been printed yet, at most one line per PATIENCE seconds."""
        with self._lock:
            now, at = self._clock(), self._estimate
            if now - self._last < PATIENCE or at.stage == self._told:
                return
            left = at.left()
            if left is not None and left < WORTH_SAYING:
                return
            self._last, self._told = now, at.stage
            ending = "" if left is None else f", about {in_words(left)} left"
            self._say(f"{at.text} ...{ending}")


@contextmanager
def steps() -> Iterator[Progress]:
    """Return a function that shows progress on standard error, unless the variable PSDMC_PROGRESS is 'off'."""
    if sys.stderr is None or os.environ.get("PSDMC_PROGRESS", "").lower() == "off":
        yield lambda step: None
    elif sys.stderr.isatty():
        with _on_a_terminal() as tell:
            yield tell
    else:
        with _in_lines() as tell:
            yield tell


@contextmanager
def _in_lines() -> Iterator[Progress]:
    lines, done = Lines(_say), threading.Event()

    def watch() -> None:
        while not done.wait(TICK):
            lines.look()

    watcher = threading.Thread(target=watch, daemon=True)
    watcher.start()
    try:
        yield lines.tell
    finally:
        done.set()
        watcher.join()


def _say(text: str) -> None:
    with suppress(OSError, ValueError):  # whoever closed it does not want to know
        print(text, file=sys.stderr, flush=True)


@contextmanager
def _on_a_terminal() -> Iterator[Progress]:
    from rich.console import Console
    from rich.progress import Progress as Bar
    from rich.progress import SpinnerColumn, TextColumn, TimeElapsedColumn

    columns = (
        SpinnerColumn(),
        TextColumn("{task.description}", markup=False),
        TimeElapsedColumn(),
        TextColumn("{task.fields[left]}", markup=False),
    )
    console, estimate = Console(stderr=True), Estimate()
    with Bar(*columns, console=console, transient=True, disable=not console.is_terminal) as progress:
        task = progress.add_task("", total=None, left="")

        def tell(step: str) -> None:
            estimate.tell(step)
            left = estimate.left() if estimate.spent() >= PATIENCE else None
            text = "" if left is None else f"about {in_words(left)} left"
            progress.update(task, description=estimate.text, left=text)

        yield tell


def say_next(*words: object) -> None:
    """Print `next: psdmc WORDS`, quoted for a shell, to standard error, because standard output has only results."""
    say_next_line(shlex.join(["psdmc", *map(str, words)]))


def quoted(word: object) -> str:
    """A word as a shell takes it."""
    return shlex.quote(str(word))


def say_next_line(line: str) -> None:
    """Print `next: LINE` to standard error, after the results. Print nothing if the results cannot be written."""
    sys.stdout.flush()
    with suppress(OSError):  # whoever closed it does not want to know
        if sys.stderr is not None:
            print(f"next: {one_line(line)}", file=sys.stderr)


def one_line(text: str) -> str:
    """Return untrusted text without control characters, which are escaped, so that it fits on one line of a terminal."""
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)
