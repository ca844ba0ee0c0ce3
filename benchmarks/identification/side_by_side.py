"""Compares psdmc, FIGAROH and a re-implementation of FloBaRoID's estimators on one virtual robot: docs/side_by_side.md.

python benchmarks/identification/side_by_side.py [--figaroh FIGAROH/bin/python] [--case NAME] [--folder DIR]

FIGAROH needs an environment of its own: python3 -m venv FIGAROH && FIGAROH/bin/pip install figaroh==1.0.2. Without
--figaroh, its rows are left out. The tables go to the terminal, and the numbers to DIR/scores.json (some minutes).
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import subprocess
import sys
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from scores import Score, estimate_of_file, estimate_of_model, held_out_of, score, truth_of
from shared_robot import CASES, JOINTS, TORQUE_CONSTANTS, Case, Folder, plan, read_log, read_motion, record

HERE = Path(__file__).resolve().parent
SEARCH = 20.0
"""s of CPU time for the search of the exciting motion."""
NOT_USABLE = 6
"""Exit status of `psdmc calibrate` if its verdict is: not usable."""


@dataclass(frozen=True, slots=True)
class Program:
    """One row of a table: the commands that identify the robot, and the file that they write."""

    name: str
    commands: tuple[tuple[str, ...], ...]
    out: str


@dataclass(frozen=True, slots=True)
class Row:
    """What a program gave: `seconds` is user and system CPU time, with start and imports. `failed` is "" or the reason."""

    program: str
    seconds: float
    score: Score | None
    said: str = ""


def programs(case: Case, figaroh: Path | None) -> Iterator[Program]:
    """The programs of the comparison."""
    psdmc = (sys.executable, "-m", "psdmc")
    constants = ",".join(f"{name}={k}" for name, k in zip(JOINTS, TORQUE_CONSTANTS, strict=True))
    derive = (*psdmc, "derive", "given.urdf", "--drive-inertia", "all", "--no-expand", "-o", "given.npz")
    calibrate = (*psdmc, "calibrate", "given.npz", "log.csv", "--torque-constants", constants, "--keep")
    calibrate += ("--validate", "campaign/logs/validation.csv")
    prior = ("--prior-confidence", str(case.masses))
    yield Program("psdmc", (derive, (*calibrate, "-o", "psdmc.npz")), "psdmc.npz")
    yield Program("psdmc, prior", (derive, (*calibrate, *prior, "-o", "prior.npz")), "prior.npz")
    files = ("given.urdf", "log.npz")
    if figaroh is not None:
        run = (str(figaroh), str(HERE / "run_figaroh.py"), *files)
        yield Program("FIGAROH", ((*run, "figaroh.json"),), "figaroh.json")
        yield Program("FIGAROH, weighted", ((*run, "weighted.json", "--wls"),), "weighted.json")
        physical = ("physical.json", "--wls", "--stage", "physical_fit")
        yield Program("FIGAROH, physical", ((*run, *physical),), "physical.json")
    for method, words in (("wls", "weighted"), ("essential", "essential"), ("sdp", "constrained")):
        out = f"{method}.json"
        command = (sys.executable, str(HERE / "flobaroid.py"), *files, out, "--method", method)
        yield Program(f"as FloBaRoID, {words}", (command,), out)


def cpu_seconds() -> float:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def run(program: Program, folder: Path) -> tuple[float, int, str]:
    """CPU time in s, exit status and the last line of errors of a program's commands, each with one thread."""
    one = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
    before, status, said = cpu_seconds(), 0, ""
    (folder / program.out).unlink(missing_ok=True)
    for command in program.commands:
        done = subprocess.run(
            command, cwd=folder, env=os.environ | one, capture_output=True, text=True, check=False
        )
        status, said = done.returncode, done.stderr.strip().rpartition("\n")[2]
    return cpu_seconds() - before, status, said


def compare(files: Folder, case: Case, figaroh: Path | None) -> list[Row]:
    """The rows of a case whose logs are written."""
    time, position, torque = read_log(files.log)
    np.savez(files.root / "log.npz", time=time, position=position, torque=torque)
    truth = truth_of(files.truth)
    held = held_out_of(truth, read_motion(files.motion), read_log(files.noiseless)[2])
    rows = []
    for program in programs(case, figaroh):
        seconds, status, said = run(program, files.root)
        out = files.root / program.out
        if not out.exists():
            rows.append(Row(program.name, seconds, None, said))
            continue
        estimate = (estimate_of_model if out.suffix == ".npz" else estimate_of_file)(out, truth)
        verdict = "not usable" if status == NOT_USABLE else ""
        rows.append(Row(program.name, seconds, score(estimate, truth, held, lugre=case.lugre), verdict))
    return rows


def table(case: Case, rows: Sequence[Row]) -> str:
    """A case's rows as a table in Markdown."""
    lines = [
        f"case {case.name}",
        "",
        "| program | base parameters | median | friction | torque, moving, N m | torque, all, N m | CPU s |",
        "|---|---|---|---|---|---|---|",
    ]
    for row in rows:
        if row.score is None:
            lines.append(f"| {row.program} | no result: {row.said} | | | | | {row.seconds:.1f} |")
            continue
        found = row.score
        friction = "—" if np.isnan(found.friction) else f"{100 * found.friction:.1f} %"
        moving, every = (" / ".join(f"{x:.2f}" for x in xs) for xs in (found.moving, found.torque))
        name = f"{row.program} ({row.said})" if row.said else row.program
        lines.append(
            f"| {name} | {100 * found.base:.2f} % | {100 * found.median:.1f} % | {friction} | {moving} | {every} "
            f"| {row.seconds:.1f} |"
        )
    return "\n".join(lines) + "\n"


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--figaroh", type=Path, help="python of the environment in which FIGAROH is installed"
    )
    parser.add_argument("--case", choices=[case.name for case in CASES])
    parser.add_argument("--folder", type=Path, default=Path("generated/side_by_side"))
    options = parser.parse_args()
    figaroh = options.figaroh.absolute() if options.figaroh else None
    folder = options.folder.absolute()
    if not (folder / "plan" / "campaign").is_dir():
        plan(folder / "plan", SEARCH)
    numbers = {}
    for case in CASES:
        if options.case in (None, case.name):
            files = record(folder / "plan", folder / case.name.replace(" ", "_"), case)
            rows = compare(files, case, figaroh)
            numbers[case.name] = [asdict(row) for row in rows]
            print(table(case, rows), flush=True)
    (folder / "scores.json").write_text(json.dumps(numbers, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
