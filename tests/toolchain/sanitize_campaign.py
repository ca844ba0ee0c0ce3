"""`make test-sanitize`: every tool of sanitizers.py on every package of CASES; a table of what was built, called and found.

Status 0 where nothing was found. Tools that are not installed are listed.

python tests/toolchain/sanitize_campaign.py --jobs 1 scara     one robot, one build at a time
python tests/toolchain/sanitize_campaign.py --functions gravity,momentum --options 1 two_link
                                                               these functions, in one precision with one sine
python tests/toolchain/sanitize_campaign.py --tools clang kr6   some of the tools
"""

from __future__ import annotations

import argparse
import os
import re
import sys
import tempfile
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

sys.path[:0] = [str(Path(__file__).parent), str(Path(__file__).parents[1])]

from bundled import bundled_model  # noqa: E402
from sanitizers import DYNAMIC, STATIC, Outcome, Tool, look  # noqa: E402

from psdmc.backends.c.package import PackageView, package_view  # noqa: E402
from psdmc.backends.info import EmitOptions, package_info  # noqa: E402
from psdmc.compiler import derive  # noqa: E402
from psdmc.lower.admitted import wanted  # noqa: E402
from psdmc.lower.kernels import lower  # noqa: E402
from psdmc.model.dynamics_model import DynamicsModel  # noqa: E402

WALKER = "walker"
ROBOTS = ("two_link", "scara", "kr6", WALKER)
"""A small one, one with a sliding joint, six turning joints, a floating tree with a mimic joint."""
OPTIONS = [
    EmitOptions(real, trig) for real in ("float64", "float32") for trig in ("inline", "freestanding", "libm")
]  # type: ignore[arg-type]
LARGE = {"kr6": OPTIONS[::3], WALKER: OPTIONS[::3]}
"""Of larger robots the inline code only, in both precisions: the other sines are the same text in every robot."""


def model_of(robot: str) -> DynamicsModel:
    if robot == WALKER:
        return derive(Path(__file__).with_name("walker.urdf"), floating=True)
    return bundled_model(robot)


def packages(
    robots: tuple[str, ...], functions: tuple[str, ...], count: int
) -> Iterator[tuple[str, PackageView]]:
    for robot in robots:
        model = model_of(robot)
        kernels = lower(model, functions=functions)
        for options in LARGE.get(robot, OPTIONS)[:count]:
            package = package_view(package_info(model), kernels, options)
            yield f"{robot} {options.real} {options.trig}", package


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("robots", nargs="*", choices=ROBOTS, help="default: all", default=[*ROBOTS])
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    parser.add_argument(
        "--functions", default="all", help="NAME,... or 'default'; default: all that there are"
    )
    parser.add_argument("--options", type=int, default=len(OPTIONS), help="of how many precisions and sines")
    parser.add_argument("--tools", default="", help="a regular expression in their names; default: all")
    chosen = parser.parse_args()
    functions = wanted([word.strip() for word in chosen.functions.split(",")])
    found: list[tuple[str, Outcome]] = []

    def one(job: tuple[str, PackageView, Tool]) -> None:
        name, package, tool = job
        with tempfile.TemporaryDirectory() as folder:
            outcome = look(tool, package, Path(folder))
        found.append((name, outcome))
        state = (
            (outcome.missing and f"{outcome.missing} is not installed") or outcome.findings[:500] or "clean"
        )
        print(f"{name}: {tool.name}: {outcome.calls} calls: {state}", flush=True)

    jobs = [
        (name, package, tool)
        for name, package in packages(tuple(chosen.robots), functions, chosen.options)
        for tool in (*DYNAMIC, *STATIC)
        if re.search(chosen.tools, tool.name)
    ]
    with ThreadPoolExecutor(chosen.jobs) as pool:
        list(pool.map(one, jobs))
    return _report(found)


def _report(found: list[tuple[str, Outcome]]) -> int:
    findings = 0
    print(f"\n{'tool':44} {'packages':>8} {'calls':>10} {'findings':>8}")
    for tool in (*DYNAMIC, *STATIC):
        own = [outcome for _, outcome in found if outcome.tool == tool.name and not outcome.missing]
        bad = sum(bool(outcome.findings) for outcome in own)
        findings += bad
        calls = sum(outcome.calls for outcome in own)
        print(f"{tool.name:44} {len(own) or 'not here':>8} {calls or '':>10} {bad:>8}")
    total = sum(outcome.calls for _, outcome in found)
    print(f"{sum(not o.missing for _, o in found)} runs, {total} calls, {findings} with findings")
    return 1 if findings else 0


if __name__ == "__main__":
    sys.exit(main())
