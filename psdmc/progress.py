"""Progress of long work, told step by step."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable

START = time.monotonic()

Progress = Callable[[str], None]
"""Called with the name of each step as it begins, and again as it goes on; a Step says how far it is."""


class Step(str):
    """A step's text that also says which share of its stage's work is done, 0 to 1."""

    __slots__ = ("share",)
    share: float

    def __new__(cls, text: str, share: float) -> Step:
        step = super().__new__(cls, text)
        step.share = min(max(share, 0.0), 1.0)
        return step

    def within(self, stage: str) -> Step:
        """The same share under a longer text, `stage: text`."""
        return Step(f"{stage}: {self}", self.share)


def within(stage: str, progress: Progress) -> Progress:
    """Progress whose steps are told as `stage: step`."""

    def tell(step: str) -> None:
        progress(step.within(stage) if isinstance(step, Step) else f"{stage}: {step}")

    return tell


def silent(step: str) -> None:
    """Ignore progress: the default where none is asked for."""


def on_standard_error(step: str) -> None:
    """Print the step, after the seconds since this module was loaded."""
    print(f"{time.monotonic() - START:6.0f} s  {step}", file=sys.stderr, flush=True)
