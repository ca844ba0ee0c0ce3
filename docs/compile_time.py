"""How long the compiler itself takes: prints the tables of docs/pipeline.md. Run: python docs/compile_time.py [ROBOT ...],
or python docs/compile_time.py --large [--floating] FILE.urdf ...

User CPU time on one core, the least of several runs, each with a compile cache of its own; of whole processes, imports
included, but for the rows that name a call. The C compiler's own time is not in it. What Python and psdmc keep of modules
and templates once per installation is kept here, too, in a folder of its own: the first run makes it, later ones have it.
"""

from __future__ import annotations

import os
import resource
import subprocess
import sys
import tempfile
from pathlib import Path

ROBOTS = Path(__file__).resolve().parents[1] / "examples" / "robots"
DEFAULT = ("kr6", "lbr7")
RUNS = 4
LISTS = ("default", "all")
FUNCTIONS = "inverse_dynamics"
"""What `compile` is timed with where the C compiler runs too: all that is timed there is the second call."""

LOWER = """
from psdmc.lower.kernels import lower
begin = user()
lower(model)
print(user() - begin)
"""
SECOND = f"""
begin = user()
compile(model, functions=["{FUNCTIONS}"])
print(user() - begin, user())
"""
PRELUDE = """
import resource, sys, psdmc
def user(): return resource.getrusage(resource.RUSAGE_SELF).ru_utime
model, compile = psdmc.load(sys.argv[1]), psdmc.compile
"""


def main(robots: tuple[str, ...]) -> None:
    columns = {robot: measured(ROBOTS / f"{robot}.toml") for robot in robots}
    print("| user CPU, s |", " | ".join(columns), "|")
    print("|---|" + "---|" * len(columns))
    for row in next(iter(columns.values())):
        print(f"| {row} |", " | ".join(f"{times[row]:.2f}" for times in columns.values()), "|")


def large(words: list[str]) -> None:
    """Of robot files, each command once: user CPU time and the largest memory."""
    options = [word for word in words if word.startswith("--")]
    print(
        "| robot | joints | derive | emit-c, default functions | emit-c, all functions |\n|---|---|---|---|---|"
    )
    for file in (Path(word).resolve() for word in words if word not in options):
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            model, psdmc = folder / "model.npz", (sys.executable, "-m", "psdmc")
            runs = [with_memory(folder, *psdmc, "derive", str(file), "-o", str(model), *options)]
            for number, functions in enumerate(LISTS):
                command = (*psdmc, "emit-c", str(model), "-o", f"package{number}", "--functions", functions)
                runs.append(with_memory(folder, *command))
            joints = "import psdmc, sys; print(psdmc.load(sys.argv[1]).n)"
            count = subprocess.check_output([sys.executable, "-c", joints, str(model)], text=True).strip()
        cells = " | ".join(f"{seconds:.1f} s, {megabytes:.0f} MB" for seconds, megabytes in runs)
        print(f"| {file.stem} | {count} | {cells} |", flush=True)


def with_memory(folder: Path, *words: str) -> tuple[float, float]:
    """User CPU time of a command in s, and its largest memory in MB."""
    with subprocess.Popen(words, cwd=folder, env=surroundings(folder), stdout=subprocess.DEVNULL) as process:
        _, status, used = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        sys.exit(process.returncode)
    return used.ru_utime, used.ru_maxrss / 1024


def measured(robot: Path) -> dict[str, float]:
    """Seconds by what was done, the least of RUNS."""
    runs = []
    with tempfile.TemporaryDirectory() as code:
        os.environ["PYTHONPYCACHEPREFIX"] = code
        for _ in range(RUNS):
            with tempfile.TemporaryDirectory() as folder:
                runs.append(one_run(robot, Path(folder)))
    return {row: min(run[row] for run in runs) for row in runs[0]}


def one_run(robot: Path, folder: Path) -> dict[str, float]:
    model = folder / "model.npz"
    command = (sys.executable, "-m", "psdmc")
    times = {"`psdmc --version`": process(folder, *command, "--version")}
    times["`psdmc derive`"] = process(folder, *command, "derive", str(robot), "-o", str(model))
    times["`lower`, every function: the call"] = python(folder, model, LOWER)[0]
    emit = (*command, "emit-c", str(model), "-o")
    times["`psdmc emit-c`, empty cache"] = process(folder, *emit, "first")
    times["`psdmc emit-c`, again"] = process(folder, *emit, "second")
    python(folder, model, SECOND)
    call, whole = python(folder, model, SECOND)
    times["`psdmc.compile`, again: the call"] = call
    times["`psdmc.compile`, again: the process"] = whole
    return times


def process(folder: Path, *words: str) -> float:
    """User CPU time of a command."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
    subprocess.run(words, cwd=folder, env=surroundings(folder), check=True, stdout=subprocess.DEVNULL)
    return resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before


def python(folder: Path, model: Path, code: str) -> list[float]:
    """What a piece of code prints of its own time."""
    words = [sys.executable, "-c", PRELUDE + code, str(model)]
    done = subprocess.run(
        words, cwd=folder, env=surroundings(folder), check=True, stdout=subprocess.PIPE, text=True
    )
    return [float(word) for word in done.stdout.split()]


def surroundings(folder: Path) -> dict[str, str]:
    one_core = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    kept = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    return kept | one_core | {"PSDMC_CACHE_DIR": str(folder / "cache")}


if __name__ == "__main__":
    if sys.argv[1:2] == ["--large"]:
        large(sys.argv[2:])
    else:
        main(tuple(sys.argv[1:]) or DEFAULT)
