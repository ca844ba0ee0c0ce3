"""`make fuzz`: every format under the rule, by coverage where atheris is installed and by mutation otherwise.

The rule: an input succeeds, or is refused by InputError, DerivationError or ToolchainError in one line with a hint;
no other exception, no warning, no more than 2 GiB, and for a file under 1 MB no more than 10 s of processor time (40 s
more for the check of a derived model).
Exit status 1 where something broke it; finds are left, made small, in the folder of the run.
"""

from __future__ import annotations

import argparse
import importlib.util
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from figures import print_figures, write_figures
from formats import FORMATS, chosen
from keep import keep, made_small
from recorder import Recorder
from run_format import Budget, Course, run_format
from seeds import ROOT, write_seeds

ENGINES = ("mutate", "atheris")


def main() -> None:
    given = _arguments()
    state = given.state.resolve()
    formats = chosen(given.format)
    course = Course(_engine(given.engine), given.seed, state, write_seeds(state))
    budget = Budget(given.count, given.seconds * given.jobs)
    began = time.monotonic()
    with ThreadPoolExecutor(given.jobs) as pool:
        rows = list(pool.map(lambda format: run_format(format, budget.of(format, formats), course), formats))
    seconds = round(time.monotonic() - began, 1)
    finds = [find for format in formats for find in Recorder(state / format.name, format.name).finds()]
    for find in finds if given.minimise else []:
        made_small(find, course.around, given.minimise)
    figures = dict(zip([format.name for format in formats], rows, strict=True))
    write_figures(
        given.json, figures, finds, {"engine": course.engine, "seed": course.seed, "seconds": seconds}
    )
    print_figures(figures, finds)
    if given.keep:
        keep(finds)
    sys.exit(1 if finds else 0)


def _engine(wanted: str) -> str:
    if wanted != "auto":
        return wanted
    return "atheris" if importlib.util.find_spec("atheris") else "mutate"


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    names = f"names or their beginnings, separated by commas: {', '.join(FORMATS)}"
    parser.add_argument("--format", default="", help=names)
    parser.add_argument("--count", type=int, default=10**9, help="inputs in all")
    parser.add_argument("--seconds", type=float, default=240.0, help="wall clock in all, minimising apart")
    parser.add_argument("--engine", choices=("auto", *ENGINES), default="auto")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=1, help="formats at a time")
    parser.add_argument("--state", type=Path, default=ROOT / "generated" / "fuzz", help="folder of the run")
    parser.add_argument("--json", type=Path, default=ROOT / "generated" / "fuzz" / "figures.json")
    parser.add_argument(
        "--minimise", type=float, default=10.0, help="s for each find; 0 leaves them as they are"
    )
    parser.add_argument("--keep", action="store_true", help="copy finds to tests/fuzz/corpus, as owed")
    return parser.parse_args()


if __name__ == "__main__":
    main()
