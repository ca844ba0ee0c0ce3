"""One input under the rule: psdmc succeeds, or refuses in one line with a hint; anything else is a find."""

from __future__ import annotations

import os
import stat
import traceback
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from limits import TooSlow, limited_time

from psdmc import errors
from psdmc.errors import PsdmcError

Run = Callable[[], None]

PACKAGE = Path(errors.__file__).parent
SUCCESS = "success"
LONGEST_MESSAGE = 20_000
"""characters; what is longer than a few screens was not written for people."""


class BrokenRule(Exception):
    """A target saw something that no exception told: a wrong torque, a file written outside its folder."""

    def __init__(self, rule: str, where: str, said: str) -> None:
        super().__init__(said)
        self.rule, self.where, self.said = rule, where, said


@dataclass(frozen=True, slots=True)
class Outcome:
    """What became of one input.

    kind    "success", the class of a refusal, or of what should not have been raised
    where   file:function of psdmc that a find comes from (innermost frame); "" for the rest
    said    the message
    trace   the traceback of a find
    """

    kind: str
    where: str = ""
    said: str = ""
    trace: str = ""

    @property
    def is_find(self) -> bool:
        return bool(self.where)

    @property
    def key(self) -> str:
        """Finds with one key are taken for one fault."""
        return f"{self.kind} {self.where}"


@contextmanager
def warnings_are_errors() -> Iterator[None]:
    """Every warning raises but those about other libraries' future."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for of_others in (DeprecationWarning, PendingDeprecationWarning, ResourceWarning):
            warnings.simplefilter("ignore", of_others)
        yield


def outcome_of(run: Run) -> Outcome:
    """Run it within the time limit and classify how it ended; memory is limited per process (limits.py)."""
    before = _bytes_on_stderr()
    found = _ended(run)
    if not found.is_find and _bytes_on_stderr() > before:
        return Outcome("Noise", found.where or "standard error", found.said)
    return found


def _bytes_on_stderr() -> int:
    """Size of what stands behind file descriptor 2 where that is a file: C++ libraries talk past Python."""
    kind = os.fstat(2)
    return kind.st_size if stat.S_ISREG(kind.st_mode) else 0


def _ended(run: Run) -> Outcome:
    try:
        with limited_time():
            run()
    except TooSlow as error:
        return _find("TooSlow", error)
    except BrokenRule as error:
        return Outcome(error.rule, error.where, error.said, _trace(error))
    except PsdmcError as error:
        return refusal(error)
    except Exception as error:
        return _find(type(error).__name__, error)
    return Outcome(SUCCESS)


def refusal(error: PsdmcError) -> Outcome:
    """A refusal, held against what a refusal has to be."""
    if not error.message.strip() or not error.hint:
        return _find("NoHint", error)
    if "\n" in error.message or "\n" in error.hint:
        return _find("SeveralLines", error)
    if len(error.message) + len(error.hint) > LONGEST_MESSAGE:
        return _find("EndlessLine", error)
    if _ran_out_of_memory(error):
        return _find("MemoryError", error)
    return Outcome(type(error).__name__, said=error.message)


def _ran_out_of_memory(error: BaseException | None) -> bool:
    """Whether this process's memory limit, which users do not have, made the refusal."""
    while error is not None:
        if isinstance(error, MemoryError):
            return True
        error = error.__cause__ or error.__context__
    return False


def _find(kind: str, error: BaseException) -> Outcome:
    return Outcome(kind, innermost(error), str(error), _trace(error))


def innermost(error: BaseException) -> str:
    """file:function of the innermost frame inside psdmc; "outside psdmc" where there is none."""
    frames = traceback.extract_tb(error.__traceback__)
    for frame in reversed(frames):
        if Path(frame.filename).is_relative_to(PACKAGE):
            return f"{Path(frame.filename).relative_to(PACKAGE.parent)}:{frame.name}"
    return "outside psdmc"


def _trace(error: BaseException) -> str:
    return "".join(traceback.format_exception(error, limit=-12))
