"""Summarises a written campaign for its user: runs, duration, size, loads to mount, and what was checked."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

from psdmc.calibration.campaign_file import STEPS, listed_runs
from psdmc.calibration.campaign_plan import Plan
from psdmc.calibration.identify.steps import Load
from psdmc.robot.limits import shown

MIB = 2.0**20


def summary(plan: Plan, folder: str | Path) -> tuple[str, ...]:
    """Return lines of text for the user about a campaign that was written to a folder. They give runs, minutes, loads
    to mount, and the size of the trajectory files."""
    runs, listed = plan.runs, listed_runs(folder)
    files = sorted({run.trajectory for run in listed if run.trajectory is not None})
    size = sum(path.stat().st_size for path in files) / MIB
    minutes = sum(run.motion.duration for run in runs) / 60.0
    period = runs[0].motion.period
    return (
        f"{len(runs)} run{'s' * (len(runs) > 1)}, {minutes:.1f} min of motion; trajectories {size:.1f} MiB, up to"
        f" {1.0 / period:g} rows a second",
        *_steps(plan),
        *(f"mount: {_load(load, plan)} for the runs {_which(plan, load)}" for load in _loads(plan)),
        _found(plan),
        *plan.looked,
        "not planned: the paths from the end of a run to the start of the next; your controller drives them",
    )


def _steps(plan: Plan) -> Iterator[str]:
    for step in STEPS:
        own = [run for run in plan.runs if run.step == step]
        if own:
            minutes = sum(run.motion.duration for run in own) / 60.0
            yield f"  {step:<10}{len(own):>3} run{'s' if len(own) > 1 else ' '} {minutes:6.1f} min"


def _loads(plan: Plan) -> tuple[Load, ...]:
    return tuple(dict.fromkeys(run.load for run in plan.runs if run.load is not None))


def _load(load: Load, plan: Plan) -> str:
    place = ", ".join(f"{value:g}" for value in load.com)
    return f"{load.mass:g} kg with its centre of mass at ({place}) m of {shown(plan.chain.tip_name)}"


def _which(plan: Plan, load: Load) -> str:
    own = [run for run in plan.runs if run.load == load]
    return f"whose name ends in _loaded ({len(own)}), nothing for the others ({len(plan.runs) - len(own)})"


def _found(plan: Plan) -> str:
    found = plan.found
    is_whole = all(run.step in ("inertial", "validation") for run in plan.runs)
    what = (
        "all columns of the fit, friction and offsets included" if is_whole else "what gravity does not show"
    )
    start = f"exciting motion: condition number {found.condition:.3g} of {what}"
    if not math.isfinite(found.gain):
        return f"{start}; none of {len(found.random_conditions)} random motions keeps the torque limits"
    best, count = found.random_conditions[0], len(found.random_conditions)
    of_random = "" if not plan.is_cleared else ", which were not asked to hit nothing"
    return (
        f"{start}, {best:.3g} for the best of {count} random motions{of_random}; the bound on the parameters' standard"
        f" deviations is {found.deviation_gain:.2f} times lower than for that random motion"
    )
