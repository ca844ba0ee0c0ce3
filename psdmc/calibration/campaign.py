"""A calibration campaign: its motions, the load to fix at the tip, and the place of its logs.

A campaign is a folder: `campaign.toml` lists the runs, `trajectories/` holds their motions, `logs/` receives what the
robot (or `psdmc simulate`) measured.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from psdmc.atomic import make_folder, write_whole
from psdmc.calibration.campaign_file import FILE, Step
from psdmc.calibration.identify.gravity import gravity_split
from psdmc.calibration.identify.predictor import Regressor
from psdmc.calibration.identify.steps import Load
from psdmc.calibration.logs.log_bag import is_folder
from psdmc.calibration.logs.table_files import TABLES
from psdmc.calibration.motions.excite import Excitation, ExciteOptions, excite, require_limits
from psdmc.calibration.motions.excite_poses import motor_poses
from psdmc.calibration.motions.lead_in import from_rest_to_rest
from psdmc.calibration.motions.sweeps import (
    SineOptions,
    SweepOptions,
    gravity_sweep,
    sine_series,
    single_joint_sweep,
    swept_range,
)
from psdmc.calibration.motions.trajectory import Trajectory, sliding_joints, write_trajectory
from psdmc.errors import InputError
from psdmc.progress import Progress
from psdmc.progress import Step as Share
from psdmc.robot.mechanism import Mechanism

LARGEST_ACCELERATION = 1e6
"""rad/s^2 or m/s^2: above any joint's."""


@dataclass(frozen=True, slots=True)
class CampaignOptions:
    """Options of a campaign's plan.

    load          kg and centre of mass (m, tip frame) of the motor step's mass; it must not lie on the last axis, which
                  would not feel it
    gravity_runs  sweeps through the workspace, each there and back
    repeats       periods of the exciting motion
    acceleration  rad/s^2 (m/s^2), for joints whose file gives no limit, as no URDF does; None: refuse them
    table         format of trajectories and logs: csv, npz or parquet
    """

    sweep: SweepOptions = field(default_factory=SweepOptions)
    sines: SineOptions = field(default_factory=SineOptions)
    excite: ExciteOptions = field(default_factory=ExciteOptions)
    load: Load = field(default_factory=lambda: Load(3.5, (0.08, 0.0, 0.06)))
    gravity_runs: int = 2
    repeats: int = 6
    acceleration: float | None = None
    table: str = "csv"

    def __post_init__(self) -> None:
        if self.acceleration is not None and not 0 < self.acceleration <= LARGEST_ACCELERATION:
            raise InputError(
                f"acceleration is {self.acceleration:g}, expected more than 0, at most {LARGEST_ACCELERATION:g}",
                "in rad/s^2, or m/s^2 where a joint slides",
            )
        if f".{self.table}" not in TABLES:
            raise InputError(f"table is {self.table!r}, expected csv, npz or parquet", "choose one of these")


@dataclass(frozen=True, slots=True, eq=False)
class PlannedRun:
    """One run of the robot: a motion, for joint `joint` where one is given, with a load or without."""

    step: Step
    name: str
    motion: Trajectory
    joint: str = ""
    load: Load | None = None


def plan_campaign(
    chain: Mechanism,
    model: Regressor,
    l: int,
    options: CampaignOptions,
    progress: Progress = lambda step: None,
) -> tuple[tuple[PlannedRun, ...], Excitation]:
    """All runs of the four steps, and the search for the exciting motion. Collisions are not checked."""
    chain = bounded(chain, options.acceleration)
    runs: list[PlannedRun] = []
    progress("motor sweeps")
    poses = motor_poses(chain, options.load.mass, options.load.com)
    for k, name in enumerate(chain.joint_names):
        sweep = single_joint_sweep(chain, k, poses[k], options.sweep)
        runs.append(PlannedRun("motor", f"motor_{name}", sweep, name))
        runs.append(PlannedRun("motor", f"motor_{name}_loaded", sweep, name, options.load))
    progress("gravity sweeps")
    for seed in range(options.gravity_runs):
        runs.append(
            PlannedRun("gravity", f"gravity_{seed + 1}", gravity_sweep(chain, seed + 1, options.sweep))
        )
    progress("sine series")
    middle = np.array([sum(swept_range(joint, 1.0)) / 2 for joint in chain.joints])
    for k, name in enumerate(chain.joint_names):
        series = sine_series(chain, k, middle, options.sines)
        runs.append(PlannedRun("friction", f"friction_{name}", series, name))
    progress("exciting motion")
    wanted = options.excite
    if wanted.columns is None:
        inertial = tuple(int(k) for k in gravity_split(chain, model, l).rest)
        wanted = replace(wanted, columns=inertial)
    found = excite(chain, model, wanted, _spoken(progress, wanted.seconds))
    motion = found.motion.sampled(chain.joint_names, options.sweep.period, options.repeats)
    motion = from_rest_to_rest(replace(motion, sliding=sliding_joints(chain)), chain)
    runs.append(PlannedRun("inertial", "inertial", motion))
    return tuple(runs), found


def bounded(chain: Mechanism, acceleration: float | None) -> Mechanism:
    """The chain with limits where its file has none: half a turn either way for joints that turn freely, and the given
    acceleration. InputError where a limit is still missing."""
    joints = []
    for joint in chain.joints:
        limits = joint.limits
        if joint.type.comes_round and not np.isfinite([limits.lower, limits.upper]).any():
            limits = replace(limits, lower=-joint.type.free_range, upper=joint.type.free_range)
        if not np.isfinite(limits.acceleration) and acceleration is not None:
            limits = replace(limits, acceleration=acceleration)
        joints.append(replace(joint, limits=limits))
    require_limits(joints)
    return replace(chain, joints=tuple(joints))


def _spoken(progress: Progress, longest: float) -> Callable[[float, float], None]:
    """A function that reports the progress of a search of `longest` seconds, every few of them."""
    said = 0.0

    def say(seconds: float, condition: float) -> None:
        nonlocal said
        if seconds - said >= SPOKEN_EVERY:
            said = seconds
            text = f"exciting motion: condition {condition:.2f} after {seconds:.0f} s"
            progress(Share(text, seconds / longest))

    return say


SPOKEN_EVERY = 5.0
"""Seconds between two reports on the search."""


UNFINISHED = ".psdmc-unfinished"
"""Marks a campaign's folder while it is written, and after that was killed or failed."""


@contextmanager
def being_written(folder: str | Path) -> Iterator[None]:
    """Mark a folder while a campaign is written to it: until the end, psdmc may write it again."""
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
    """InputError where a folder holds a campaign, which writing another one would replace; the message lists what is
    there.

    A campaign that an earlier run left unfinished, and that has no recorded logs, does not count.
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


def _count(folder: Path) -> int:
    return sum(1 for _ in folder.iterdir()) if is_folder(folder) else 0


def write_campaign(
    folder: str | Path, runs: Sequence[PlannedRun], found: Excitation, table: str, *, force: bool = False
) -> Path:
    """Write a campaign's folder; returns the path of its campaign.toml.

    force   replace the plan and the trajectories of an existing campaign; logs are never touched

    Raises InputError where there is one and `force` is not given, or the folder cannot be written.
    """
    if not force:
        require_free(folder)
    root = Path(folder)
    lines = [
        "# Runs of a calibration campaign: run each trajectory, put what was logged where `log` says.",
        "",
    ]
    written: dict[int, str] = {}
    files = _file_names(runs)
    for run, file in zip(runs, files, strict=True):
        if id(run.motion) not in written:  # loaded and unloaded runs share one motion
            written[id(run.motion)] = f"trajectories/{file}.{table}"
            write_trajectory(run.motion, root / written[id(run.motion)])
        lines += ["[[run]]", f"step = {_toml_text(run.step)}", f"name = {_toml_text(run.name)}"]
        if run.joint:
            lines.append(f"joint = {_toml_text(run.joint)}")
        if run.load is not None:
            lines.append(f"load = {{ mass = {run.load.mass!r}, com = {list(run.load.com)!r} }}")
        lines.append(f"trajectory = {_toml_text(written[id(run.motion)])}")
        lines += [f"log = {_toml_text(f'logs/{file}.{table}')}", ""]
    write_whole(root / "excitation.json", json.dumps(excitation_json(found), indent=1) + "\n")
    path = root / FILE
    write_whole(path, "\n".join(lines))
    return path


def _file_names(runs: Sequence[PlannedRun]) -> list[str]:
    """File names of the runs: the run's name where every system accepts it; else its step and number, as joints may
    have any name."""
    names = [run.name for run in runs]
    plain = [name.replace("_", "").replace("-", "").isalnum() and name.isascii() for name in names]
    return [
        run.name
        if plain[k] and len(run.name) <= LONGEST_NAME and names.count(run.name) == 1
        else f"{run.step}_{k + 1}"
        for k, run in enumerate(runs)
    ]


LONGEST_NAME = 100
"""Characters of a file's name; file systems take 255 bytes."""


def _toml_text(text: str) -> str:
    """A TOML string: JSON's escapes are TOML's, except that TOML also requires one for DEL."""
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")


def excitation_json(found: Excitation) -> dict[str, Any]:
    """The motion's parameters (22) and the condition reached, as plain values."""
    motion = found.motion
    return {
        "duration_s": motion.duration,
        "harmonics": list(motion.harmonics),
        "centre": motion.centre.tolist(),
        "amplitude": motion.amplitude.tolist(),
        "phase_rad": motion.phase.tolist(),
        "condition": found.condition,
        "best_random_condition": float(found.random_conditions[0]),
        "median_random_condition": float(np.median(found.random_conditions)),
        "random_trajectories": len(found.random_conditions),
        "candidates": found.evaluations,
        "seconds": round(found.seconds, 2),
    }
