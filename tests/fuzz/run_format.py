"""One format's share of a run: worker processes one after the other until its budget is spent."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path

from formats import Format
from isolated import died
from limits import STUCK_SECONDS
from recorder import Recorder

BATCH = 30_000
"""Inputs per process: what libraries leak is returned."""

LOOK = 0.5
"""s between looks at a worker."""

START = 1.0
"""s below which no worker is begun."""


ENDED_BY_OTHERS = (-signal.SIGTERM, -signal.SIGINT, -signal.SIGHUP)
"""Statuses of a worker that no input caused."""

UNGUIDED = 1000
"""Inputs within which libFuzzer keeps some beside the seeds, unless coverage does not reach it."""


@dataclass(frozen=True, slots=True)
class Budget:
    """What may be spent: inputs, and seconds of wall clock."""

    count: int
    seconds: float

    def of(self, format: Format, formats: list[Format]) -> Budget:
        """This format's part: inputs by their shares, time in equal parts."""
        share = format.share / sum(other.share for other in formats)
        return Budget(max(int(self.count * share), 1), self.seconds / len(formats))


@dataclass(frozen=True, slots=True)
class Course:
    """How all workers of a run work: by which engine, from which seed, with which folders."""

    engine: str
    seed: int
    state: Path
    around: Path


def run_format(format: Format, budget: Budget, course: Course) -> dict[str, float]:
    """Figures of this run; finds lie in the format's folder."""
    folder = course.state / format.name
    shutil.rmtree(folder / "finds", ignore_errors=True)
    recorder = Recorder(folder, format.name, fresh=True)
    began, used, batch = time.monotonic(), 0.0, 0
    while recorder.inputs < budget.count and budget.seconds - used > START:
        before = recorder.inputs
        rest = Budget(min(budget.count - before, BATCH), budget.seconds - used)
        _one_worker(format, rest, course, course.seed + 1000 * batch, recorder)
        batch, used = batch + 1, time.monotonic() - began
        if recorder.inputs == before:
            raise SystemExit(f"{format.name}: the worker ran nothing: see {folder / 'log'}")
    figures = recorder.figures()
    if course.engine == "atheris" and figures["inputs"] > UNGUIDED and not _is_guided(folder):
        raise SystemExit(f"{format.name}: no input reached new code: is psdmc imported uninstrumented?")
    return {**figures, "seconds": round(used, 1), "per_second": round(figures["inputs"] / max(used, 1e-9), 1)}


def _is_guided(folder: Path) -> bool:
    """Whether libFuzzer kept an input beside the seeds."""
    return any(not path.name.startswith("seed-") for path in (folder / "corpus").iterdir())


def _one_worker(format: Format, budget: Budget, course: Course, seed: int, recorder: Recorder) -> None:
    """One process; if it dies, its current input is the find."""
    folder = course.state / format.name
    words = [sys.executable, str(Path(__file__).with_name("worker.py")), format.name, str(folder)]
    words += [str(course.around), "--engine", course.engine, "--seed", str(seed)]
    words += ["--count", str(budget.count), "--seconds", str(budget.seconds)]
    with (folder / "log").open("ab") as log:
        process = subprocess.Popen(
            words, stdout=log, stderr=log, stdin=subprocess.DEVNULL, env=_environment(course.state)
        )
        status = _watched(process, recorder)
    if status in ENDED_BY_OTHERS:
        raise SystemExit(f"{format.name}: the worker was ended from outside")
    if status != 0 and recorder.is_running:
        recorder.lost(died(-status, (folder / "fault").read_text(encoding="utf-8", errors="replace")))
    elif status not in (0, -signal.SIGKILL):
        raise SystemExit(
            f"{format.name}: the worker ended with {status} outside of inputs: see {folder / 'log'}"
        )


def _watched(process: subprocess.Popen[bytes], recorder: Recorder) -> int:
    """The status of the process, which is ended where its inputs do not go on."""
    inputs, since = recorder.inputs, time.monotonic()
    while True:
        try:
            return process.wait(LOOK)
        except subprocess.TimeoutExpired:
            if recorder.inputs != inputs:
                inputs, since = recorder.inputs, time.monotonic()
            elif time.monotonic() - since > STUCK_SECONDS:
                process.kill()


def _environment(state: Path) -> dict[str, str]:
    """One thread, and caches of its own."""
    own = {"PSDMC_CACHE_DIR": str(state / "cache"), "MPLCONFIGDIR": str(state / "matplotlib")}
    return os.environ | own | {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
