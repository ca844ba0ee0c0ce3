"""Reports the progress of long computations to the user, one step at a time."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable

START = time.monotonic()

Progress = Callable[[str], None]
"""Called with the name of each step as it begins, and again as it goes on; a Step says how far it is."""


class Step(str):
    """The text of a step of a computation, and the share of the work that is done then, from 0 to 1."""

    __slots__ = ("share",)
    share: float

    def __new__(cls, text: str, share: float) -> Step:
        step = super().__new__(cls, text)
        step.share = min(max(share, 0.0), 1.0)
        return step

    def within(self, stage: str) -> Step:
        """Return a step with the text `stage: text`. The share of the work that is done stays unchanged."""
        return Step(f"{stage}: {self}", self.share)


def within(stage: str, progress: Progress) -> Progress:
    """Return a progress function that puts the name of a stage before each text, as `stage: step`."""

    def tell(step: str) -> None:
        progress(step.within(stage) if isinstance(step, Step) else f"{stage}: {step}")

    return tell


def silent(step: str) -> None:
    """Do nothing with the text of a step. This function is the default if the caller asks for no progress."""


def on_standard_error(step: str) -> None:
    """Print the text of a step to standard error, preceded by the number of seconds since psdmc was loaded."""
    print(f"{time.monotonic() - START:6.0f} s  {step}", file=sys.stderr, flush=True)
