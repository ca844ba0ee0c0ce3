"""A calibration campaign: which motions to run, what to hang on the tip, and where the logs are expected.

A campaign is a folder: `campaign.toml` lists the runs, `trajectories/` holds their motions, `logs/` receives what the
robot (or `psdmc simulate`) measured.
"""

from __future__ import annotations

import json
import tomllib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from psdmc.atomic import write_whole
from psdmc.calibrate.excite import Excitation, ExciteOptions, excite, require_limits
from psdmc.calibrate.excite_poses import motor_poses
from psdmc.calibrate.four_steps import Runs
from psdmc.calibrate.gravity import gravity_split
from psdmc.calibrate.lead_in import from_rest_to_rest
from psdmc.calibrate.log_files import read_log
from psdmc.calibrate.predictor import Regressor
from psdmc.calibrate.steps import FrictionRun, GravityRun, InertialRun, Load, MotorRun
from psdmc.calibrate.sweeps import (
    SineOptions,
    SweepOptions,
    gravity_sweep,
    sine_series,
    single_joint_sweep,
    swept_range,
)
from psdmc.calibrate.trajectory import Trajectory, sliding_joints, write_trajectory
from psdmc.errors import InputError
from psdmc.robot.chain import Chain

Step = Literal["motor", "gravity", "friction", "inertial"]
STEPS: tuple[Step, ...] = ("motor", "gravity", "friction", "inertial")
Progress = Callable[[str], None]
FILE = "campaign.toml"


@dataclass(frozen=True, slots=True)
class CampaignOptions:
    """What a campaign consists of.

    load          kg and centre of mass (m, tip frame) of the motor step's mass; beside the last axis, so that it is felt
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


@dataclass(frozen=True, slots=True, eq=False)
class PlannedRun:
    """One run of the robot: a motion, for one joint's sake where `joint` is given, with a load or without."""

    step: Step
    name: str
    motion: Trajectory
    joint: str = ""
    load: Load | None = None


def plan_campaign(
    chain: Chain, model: Regressor, l: int, options: CampaignOptions, progress: Progress = lambda step: None
) -> tuple[tuple[PlannedRun, ...], Excitation]:
    """All runs of the four steps, and the exciting motion's search. Collisions are not looked at."""
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
    found = excite(chain, model, wanted, _spoken(progress))
    motion = found.motion.sampled(chain.joint_names, options.sweep.period, options.repeats)
    motion = from_rest_to_rest(replace(motion, sliding=sliding_joints(chain)), chain)
    runs.append(PlannedRun("inertial", "inertial", motion))
    return tuple(runs), found


def bounded(chain: Chain, acceleration: float | None) -> Chain:
    """The chain with limits where its file has none: a half turn either way for joints that turn freely, and the
    acceleration that was given. InputError where a limit is still missing."""
    joints = []
    for joint in chain.joints:
        limits = joint.limits
        if joint.kind == "revolute" and not np.isfinite([limits.lower, limits.upper]).any():
            limits = replace(limits, lower=-np.pi, upper=np.pi)
        if not np.isfinite(limits.acceleration) and acceleration is not None:
            limits = replace(limits, acceleration=acceleration)
        joints.append(replace(joint, limits=limits))
    require_limits(joints)
    return replace(chain, joints=tuple(joints))


def _spoken(progress: Progress) -> Callable[[float, float], None]:
    """The search's progress, every few seconds."""
    said = 0.0

    def say(seconds: float, condition: float) -> None:
        nonlocal said
        if seconds - said >= SPOKEN_EVERY:
            said = seconds
            progress(f"exciting motion: condition {condition:.2f} after {seconds:.0f} s")

    return say


SPOKEN_EVERY = 5.0
"""s between two words on the search."""


def write_campaign(folder: str | Path, runs: Sequence[PlannedRun], found: Excitation, table: str) -> Path:
    """Write a campaign's folder; returns its campaign.toml."""
    root = Path(folder)
    lines = [
        "# Runs of a calibration campaign: run each trajectory, put what was logged where `log` says.",
        "",
    ]
    written: dict[int, str] = {}
    for run in runs:
        if id(run.motion) not in written:  # loaded and unloaded runs share one motion
            written[id(run.motion)] = f"trajectories/{run.name}.{table}"
            write_trajectory(run.motion, root / written[id(run.motion)])
        lines += ["[[run]]", f"step = {json.dumps(run.step)}", f"name = {json.dumps(run.name)}"]
        if run.joint:
            lines.append(f"joint = {json.dumps(run.joint, ensure_ascii=False)}")
        if run.load is not None:
            lines.append(f"load = {{ mass = {run.load.mass!r}, com = {list(run.load.com)!r} }}")
        lines.append(f"trajectory = {json.dumps(written[id(run.motion)])}")
        lines += [f"log = {json.dumps(f'logs/{run.name}.{table}')}", ""]
    write_whole(root / "excitation.json", json.dumps(excitation_json(found), indent=1) + "\n")
    path = root / FILE
    write_whole(path, "\n".join(lines))
    return path


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


@dataclass(frozen=True, slots=True)
class ListedRun:
    """One [[run]] of a campaign.toml, paths made absolute."""

    step: Step
    name: str
    log: Path
    trajectory: Path | None
    joint: str
    load: Load | None


def listed_runs(path: str | Path) -> tuple[ListedRun, ...]:
    """The runs of a campaign.toml (or its folder); InputError says which run lacks what."""
    path = Path(path)
    path = path / FILE if path.is_dir() else path
    try:
        content = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: not TOML: {error}") from error
    tables = content.get("run", [])
    if not tables:
        raise InputError(f"{path}: no [[run]]", "`psdmc excite` writes campaigns")
    return tuple(_listed(path, k, table) for k, table in enumerate(tables, start=1))


def _listed(path: Path, number: int, table: dict[str, Any]) -> ListedRun:
    where = f"{path}: run {number}"
    if table.get("step") not in STEPS:
        raise InputError(f"{where}: step {table.get('step')!r}, expected one of {', '.join(STEPS)}")
    if "log" not in table:
        raise InputError(f"{where}: no 'log'")
    if table["step"] in ("motor", "friction") and not table.get("joint"):
        raise InputError(f"{where}: a {table['step']} run needs its 'joint'")
    load = table.get("load")
    try:
        known = None if load is None else Load(float(load["mass"]), tuple(float(x) for x in load["com"]))  # type: ignore[arg-type]
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(
            f"{where}: load {load!r}", "expected { mass = 3.5, com = [0.08, 0.0, 0.06] }"
        ) from error
    motion = table.get("trajectory")
    return ListedRun(
        step=table["step"],
        name=str(table.get("name", Path(table["log"]).stem)),
        log=path.parent / table["log"],
        trajectory=None if motion is None else path.parent / motion,
        joint=str(table.get("joint", "")),
        load=known,
    )


def read_campaign(path: str | Path) -> Runs:
    """All logs of a campaign, step by step; InputError where one is missing or a motor run lacks its partner."""
    listed = listed_runs(path)
    motors: list[MotorRun] = []
    empty = {run.joint: run for run in listed if run.step == "motor" and run.load is None}
    for run in listed:
        if run.step == "motor" and run.load is not None:
            if run.joint not in empty:
                raise InputError(f"{path}: joint {run.joint}: a loaded motor run without an unloaded one")
            motors.append(MotorRun(run.joint, read_log(empty[run.joint].log), read_log(run.log), run.load))
    return Runs(
        motor=motors,
        gravity=[GravityRun(read_log(run.log), run.load) for run in listed if run.step == "gravity"],
        friction=[
            FrictionRun(run.joint, read_log(run.log), run.load) for run in listed if run.step == "friction"
        ],
        inertial=[InertialRun(read_log(run.log), run.load) for run in listed if run.step == "inertial"],
    )
