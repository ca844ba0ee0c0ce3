"""The differential campaign: random robots through psdmc, Pinocchio and MuJoCo; worst errors and their robots.

python tests/campaign/campaign_run.py --robots 1000          the robots of seeds 0 to 999
python tests/campaign/campaign_run.py --seed 52 --urdf       one robot again, all its errors and its file
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import tempfile
import time
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

from campaign_measure import described, failures, limit_of, measured
from campaign_robots import random_robot

ROBOTS, STATES, LOWERED_EVERY = 10_000, 1_000, 50
WORST_KEPT = 5
"""Robots named for each comparison."""

CHUNK = 4
"""Robots handed to a process at once."""


def outcome(seed: int, states: int, lowered: bool) -> dict[str, object]:
    """Errors of one robot, or what psdmc raised, as plain JSON values."""
    try:
        errors = measured(seed, states, lowered=lowered)
    except Exception as raised:  # whatever a robot makes psdmc raise is a finding, and the campaign goes on
        return {"seed": seed, "raised": f"{type(raised).__name__}: {raised}"}
    return {"seed": seed, "errors": errors, "failed": sorted(failures(errors))}


def outcomes(seeds: range, states: int, every: int, jobs: int) -> Iterator[dict[str, object]]:
    lowered = [every > 0 and seed % every == 0 for seed in seeds]
    counts = [states] * len(seeds)
    if jobs == 1:
        yield from map(outcome, seeds, counts, lowered)
        return
    with ProcessPoolExecutor(jobs) as pool:
        yield from pool.map(outcome, seeds, counts, lowered, chunksize=CHUNK)


def summary(found: list[dict[str, object]], states: int, seconds: float) -> dict[str, object]:
    """Worst errors per comparison with their seeds, what raised, what failed."""
    compared: dict[str, list[tuple[float, int]]] = {}
    for one in found:
        for what, error in one.get("errors", {}).items():
            compared.setdefault(what, []).append((error, one["seed"]))
    worst = {
        what: {"robots": len(rows), "limit": limit_of(what), "worst": sorted(rows, reverse=True)[:WORST_KEPT]}
        for what, rows in sorted(compared.items())
    }
    return {
        "robots": len(found),
        "states": states * len(found),
        "seconds": round(seconds, 1),
        "worst": worst,
        "raised": {one["seed"]: one["raised"] for one in found if "raised" in one},
        "failed": {one["seed"]: one["failed"] for one in found if one.get("failed")},
    }


def report(result: dict[str, object]) -> str:
    lines = [f"{result['robots']} robots, {result['states']} states, {result['seconds']} s"]
    for what, row in result["worst"].items():
        seeds = ", ".join(f"{error:.1e} (seed {seed})" for error, seed in row["worst"][:2])
        lines.append(f"{what:60} {row['robots']:6} robots   limit {row['limit']:.0e}   worst {seeds}")
    lines += [f"seed {seed} raised {text}" for seed, text in result["raised"].items()]
    lines += [f"seed {seed} failed: {', '.join(names)}" for seed, names in result["failed"].items()]
    lines.append("again: python tests/campaign/campaign_run.py --seed SEED --urdf")
    return "\n".join(lines)


def one_robot(seed: int, states: int, with_urdf: bool) -> int:
    robot = random_robot(seed)
    print(f"seed {seed}: {described(robot)}")
    if with_urdf:
        print(robot.text)
    errors = measured(seed, states, lowered=True)
    for what, error in errors.items():
        print(f"{what:60} {error:.2e}{'' if error <= limit_of(what) else '   FAILS'}")
    return 1 if failures(errors) else 0


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--robots", type=int, default=ROBOTS)
    parser.add_argument("--first", type=int, default=0, help="seed of the first robot")
    parser.add_argument("--states", type=int, default=STATES, help="random states of each robot")
    parser.add_argument(
        "--lowered-every",
        type=int,
        default=LOWERED_EVERY,
        help="lower and compile every so many robots; 0: none",
    )
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--json", type=Path, help="where to write the figures")
    parser.add_argument("--seed", type=int, help="this robot alone, with everything lowered and compiled")
    parser.add_argument("--urdf", action="store_true", help="print that robot's file")
    chosen = parser.parse_args()
    # Kernels found with a short search must not stay in the user's cache.
    with tempfile.TemporaryDirectory() as cache:
        os.environ["PSDMC_CACHE_DIR"] = cache
        if chosen.seed is not None:
            return one_robot(chosen.seed, chosen.states, chosen.urdf)
        started = time.perf_counter()
        seeds = range(chosen.first, chosen.first + chosen.robots)
        found = []
        for one in outcomes(seeds, chosen.states, chosen.lowered_every, chosen.jobs):
            found.append(one)
            if "raised" in one or one["failed"]:
                print(one, flush=True)
            elif len(found) % 100 == 0:
                print(f"{len(found)} of {len(seeds)}", flush=True)
    result = summary(found, chosen.states, time.perf_counter() - started)
    print(report(result))
    if chosen.json:
        chosen.json.write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")
    return 1 if result["raised"] or result["failed"] else 0


if __name__ == "__main__":
    sys.exit(main())
