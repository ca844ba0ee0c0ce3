"""Reads and writes the folder of a calibration campaign. `campaign.toml` lists the runs, `trajectories/` holds their
motions, and `logs/` holds what the robot (or `psdmc simulate`) measured. A campaign is also summarised
for its user: runs, duration, size, loads to mount, and what was checked."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from psdmc.calibration.campaign_file import FILE, STEPS, listed_runs
from psdmc.calibration.campaign_plan import CampaignOptions as CampaignOptions
from psdmc.calibration.campaign_plan import Plan as Plan
from psdmc.calibration.campaign_plan import PlannedRun as PlannedRun
from psdmc.calibration.campaign_plan import plan_campaign as plan_campaign
from psdmc.calibration.logs.foreign_bytes import is_folder
from psdmc.calibration.logs.toml_tables import toml_text
from psdmc.calibration.motions.excite import MEASURES, Excitation
from psdmc.calibration.motions.formats import FORMATS
from psdmc.calibration.motions.trajectory import write_trajectory
from psdmc.errors import InputError
from psdmc.files import make_folder, refuse_foreign_folder, write_whole
from psdmc.robot.limits import shown

UNFINISHED = ".psdmc-unfinished"
"""Marks a campaign's folder while it is written, and after that was killed or failed."""


@contextmanager
def being_written(folder: str | Path) -> Iterator[None]:
    """Mark a folder as incomplete during a `with` statement that writes a campaign to it. If the process is killed, the
    mark remains, and psdmc may later write a new campaign to the folder."""
    root = Path(folder)
    make_folder(root)
    write_whole(root / UNFINISHED, "")
    try:
        yield
    except BaseException:
        if not any(path.is_file() for path in root.rglob("*") if path.name != UNFINISHED):
            (root / UNFINISHED).unlink()
        raise
    (root / UNFINISHED).unlink()


def require_free(folder: str | Path) -> None:
    """Raise InputError if a folder holds a campaign, which another one would replace, or files that psdmc did not
    write.

    A campaign that an earlier process left unfinished, and that has no recorded logs, is accepted.
    """
    root = Path(folder)
    if (root / UNFINISHED).is_file() and not _count(root / "logs"):
        return
    if is_folder(root):
        counts = {part: _count(root / part) for part in ("trajectories", "logs")}
        found = [FILE] if (root / FILE).exists() else []
        found += [f"{count} file(s) in {part}" for part, count in counts.items() if count]
        if found:
            raise InputError(
                f"{root}: holds a campaign already: {', '.join(found)}",
                "choose another folder; with --force its plan and trajectories are replaced, its logs stay",
            )
    refuse_foreign_folder(
        root, "choose a new or empty folder with -o, or write the campaign beside these files with --force"
    )


def _count(folder: Path) -> int:
    return sum(1 for _ in folder.iterdir()) if is_folder(folder) else 0


def write_campaign(
    folder: str | Path,
    runs: Sequence[PlannedRun],
    found: Excitation,
    table: str,
    formats: Sequence[str] = (),
    *,
    force: bool = False,
) -> Path:
    """Write the plan and the trajectories of a campaign to a folder. Return the path of its campaign.toml.

    formats  names of formats of controllers; each trajectory is also written in these formats
    force    True: replace the plan and the trajectories of an existing campaign; logs are never changed

    Raises InputError if a campaign exists and `force` is not given, or if the folder cannot be written.
    """
    if not force:
        require_free(folder)
    root = Path(folder)
    lines = [
        "# Runs of a calibration campaign: run each trajectory, put what was logged where `log` says.",
        "",
    ]
    written: dict[int, str] = {}
    names = [run.name for run in runs]
    for k, run in enumerate(runs, start=1):
        plain = run.name.replace("_", "").replace("-", "").isalnum() and run.name.isascii()
        is_short = len(run.name) <= LONGEST_NAME and names.count(run.name) == 1
        file = run.name if plain and is_short else f"{run.step}_{k}"  # a name that every system accepts
        if id(run.motion) not in written:  # loaded and unloaded runs share one motion
            written[id(run.motion)] = f"trajectories/{file}.{table}"
            path = root / written[id(run.motion)]
            write_trajectory(run.motion, path)
            for name, form in FORMATS.items():
                other = path.with_name(file + form.ending)
                if name in formats:
                    write_whole(other, form.text(run.motion))
                else:  # it holds an older motion
                    other.unlink(missing_ok=True)
        lines += ["[[run]]", f"step = {toml_text(run.step)}", f"name = {toml_text(run.name)}"]
        if run.joint:
            lines.append(f"joint = {toml_text(run.joint)}")
        if run.load is not None:
            lines.append(f"load = {{ mass = {run.load.mass!r}, com = {list(run.load.com)!r} }}")
        lines.append(f"trajectory = {toml_text(written[id(run.motion)])}")
        lines += [f"log = {toml_text(f'logs/{file}.{table}')}", ""]
    write_whole(root / "excitation.json", json.dumps(excitation_json(found), indent=1) + "\n")
    path = root / FILE
    write_whole(path, "\n".join(lines))
    return path


LONGEST_NAME = 100
"""Characters of a file's name; file systems take 255 bytes."""


def excitation_json(found: Excitation) -> dict[str, Any]:
    """Return the exciting motion of a campaign as plain JSON values. They are the parameters of its Fourier series,
    (22) in Denso-2022, and the condition number of its regressor."""
    motion = found.motion
    return {
        "duration_s": motion.duration,
        "harmonics": list(motion.harmonics),
        "centre": motion.centre.tolist(),
        "amplitude": motion.amplitude.tolist(),
        "phase_rad": motion.phase.tolist(),
        "condition": found.condition,
        "minimised": MEASURES[found.objective],
        "times_below_best_random": _finite(found.times),
        "times_below_median_random": _finite(np.median(found.random_times)),
        "condition_of_best_random": _finite(found.random_condition),
        "random_trajectories": len(found.random_times),
        "evaluations": found.evaluations,
        "ended_by_clock": found.ended_by_clock,
        "seconds": round(found.seconds, 2),
    }


def _finite(value: float) -> float | None:
    """The value, None where it is infinite: no random motion is allowed. JSON has no infinity."""
    return float(value) if np.isfinite(value) else None


# For its user


MIB = 2.0**20


def summary(plan: Plan, folder: str | Path) -> tuple[str, ...]:
    """Return lines of text for the user about a campaign that was written to a folder. They give runs, minutes, loads
    to mount, and the size of the trajectory files."""
    runs, listed = plan.runs, listed_runs(folder)
    files = sorted({run.trajectory for run in listed if run.trajectory is not None})
    size = sum(path.stat().st_size for path in files) / MIB
    minutes = sum(run.motion.duration for run in runs) / 60.0
    period = runs[0].motion.period
    lines = [
        f"{len(runs)} run{'s' * (len(runs) > 1)}, {minutes:.1f} min of motion; trajectories {size:.1f} MiB, up to"
        f" {1.0 / period:g} rows a second"
    ]
    for step in STEPS:
        own = [run for run in runs if run.step == step]
        if own:
            minutes = sum(run.motion.duration for run in own) / 60.0
            lines.append(f"  {step:<10}{len(own):>3} run{'s' if len(own) > 1 else ' '} {minutes:6.1f} min")
    for load in dict.fromkeys(run.load for run in runs if run.load is not None):
        count = sum(run.load == load for run in runs)
        place = ", ".join(f"{value:g}" for value in load.com)
        lines.append(
            f"mount: {load.mass:g} kg with its centre of mass at ({place}) m of {shown(plan.chain.tip_name)} for the runs"
            f" whose name ends in _loaded ({count}), nothing for the others ({len(runs) - count})"
        )
    is_whole = all(run.step in ("inertial", "validation") for run in runs)
    what = (
        "all fitted values: base parameters, friction and offsets"
        if is_whole
        else "the base parameters that torques at rest do not determine"
    )
    return (
        *lines,
        f"exciting motion: condition number {plan.found.condition:.3g}, of {what}",
        f"compared: {plan.found.comparison}",
        *plan.looked,
        "not planned: the paths from the end of a run to the start of the next; your controller drives them",
    )
