"""What a worker leaves behind even if it is killed: counts, the input it was at, and its finds."""

from __future__ import annotations

import hashlib
import json
import re
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from limits import LARGEST_INPUT
from outcome import SUCCESS, Outcome

KINDS = (SUCCESS, "InputError", "DerivationError", "ToolchainError", "find")
_INPUTS, _DEEP, _RUNNING, _LENGTH = range(4)
_FIRST_KIND = 4


@dataclass(frozen=True, slots=True)
class Find:
    """A fault and the smallest input that showed it so far."""

    format: str
    outcome: Outcome
    folder: Path

    @property
    def data(self) -> bytes:
        return (self.folder / "input").read_bytes()


class Recorder:
    """One format's folder: `counts` and `current` are shared memory, `finds` holds a folder for each fault."""

    def __init__(self, folder: Path, format: str, fresh: bool = False) -> None:
        self.folder, self.format = folder, format
        folder.mkdir(parents=True, exist_ok=True)
        mode = "w+" if fresh or not (folder / "counts").exists() else "r+"
        self._counts = np.memmap(folder / "counts", np.int64, mode, shape=(_FIRST_KIND + len(KINDS),))
        self._current = np.memmap(folder / "current", np.uint8, mode, shape=(LARGEST_INPUT,))

    def start(self, data: bytes, deep: bool) -> None:
        """This input is being run from now on."""
        self._current[: len(data)] = np.frombuffer(data, np.uint8)
        self._counts[_LENGTH] = len(data)
        self._counts[_RUNNING] = 1
        self._counts[_INPUTS] += 1
        self._counts[_DEEP] += deep

    def end(self, data: bytes, outcome: Outcome) -> None:
        self._counts[_FIRST_KIND + KINDS.index("find" if outcome.is_find else outcome.kind)] += 1
        self._counts[_RUNNING] = 0
        if outcome.is_find:
            self.keep(data, outcome)

    def keep(self, data: bytes, outcome: Outcome) -> None:
        """Keep a find, unless a smaller input for the same fault is known."""
        place = self.folder / "finds" / slug(outcome.key)
        known = place / "input"
        if known.exists() and known.stat().st_size <= len(data):
            return
        place.mkdir(parents=True, exist_ok=True)
        known.write_bytes(data)
        (place / "find.json").write_text(json.dumps(asdict(outcome), indent=1), encoding="utf-8")

    def lost(self, outcome: Outcome) -> None:
        """The worker died at its current input, for this reason."""
        self.end(self.current, outcome)

    @property
    def inputs(self) -> int:
        return int(self._counts[_INPUTS])

    @property
    def current(self) -> bytes:
        return self._current[: self._counts[_LENGTH]].tobytes()

    @property
    def is_running(self) -> bool:
        """Whether the worker is, or was when it died, inside an input."""
        return bool(self._counts[_RUNNING])

    def figures(self) -> dict[str, int]:
        """Inputs, how many ran deep, and how many ended in which way."""
        ends = {kind: int(self._counts[_FIRST_KIND + k]) for k, kind in enumerate(KINDS)}
        return {"inputs": self.inputs, "deep": int(self._counts[_DEEP]), **ends}

    def finds(self) -> list[Find]:
        found = []
        for place in sorted((self.folder / "finds").glob("*/find.json")):
            outcome = Outcome(**json.loads(place.read_text(encoding="utf-8")))
            found.append(Find(self.format, outcome, place.parent))
        return found


def slug(key: str) -> str:
    """A key as a file name: words, and a digest that tells equal words apart."""
    words = re.sub(r"[^a-z0-9]+", "-", key.lower().replace("psdmc/", "").replace(".py", "")).strip("-")
    return f"{words[:80]}-{hashlib.sha256(key.encode()).hexdigest()[:6]}"
