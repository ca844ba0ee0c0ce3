"""Reads campaign.toml, which lists the runs (recorded motions) of a campaign, and the logs of these runs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, cast

from psdmc.calibration.identify.four_steps import Runs
from psdmc.calibration.identify.steps import FrictionRun, GravityRun, InertialRun, Load, MotorRun
from psdmc.calibration.logs.foreign_bytes import is_folder, listed
from psdmc.calibration.logs.log_files import read_log
from psdmc.calibration.logs.toml_tables import TomlTable, read_toml, require_none
from psdmc.errors import InputError

Step = Literal["motor", "gravity", "friction", "inertial", "validation"]
STEPS: tuple[Step, ...] = ("motor", "gravity", "friction", "inertial", "validation")
FILE = "campaign.toml"
WHAT = "a campaign (campaign.toml), as `psdmc excite` writes it"
HINT = "`psdmc excite` writes campaigns; docs/calibration.md describes them"

LARGEST_RUNS = 1000
"""A campaign of a nine-joint arm has 30; a thousand take days."""
LARGEST_MASS = 1e4
"""kg, of a load at the tip."""
SMALLEST_MASS = 1e-3
"""kg; a smaller mass is not measurable."""
LARGEST_ARM = 100.0
"""m, of a load's centre of mass from the tip."""

_RUN_KEYS = ("step", "name", "joint", "load", "trajectory", "log")
_LOAD_KEYS = ("mass", "com")


@dataclass(frozen=True, slots=True)
class ListedRun:
    """One entry [[run]] of a campaign.toml: a recorded motion. Paths are relative to the working directory."""

    step: Step
    name: str
    log: Path
    trajectory: Path | None
    joint: str
    load: Load | None


def is_campaign(path: Path) -> bool:
    """Return whether a path names a campaign: a .toml file, or a folder with a campaign.toml."""
    return path.suffix.lower() == ".toml" or (is_folder(path) and (path / FILE).exists())


def listed_runs(path: str | Path) -> tuple[ListedRun, ...]:
    """Return the runs (recordings of one motion each) that a campaign.toml lists; the path may also name its folder. Raises
    InputError with all faults, and the run of each."""
    path = Path(path)
    path = path / FILE if is_folder(path) else path
    faults: list[str] = []
    tables = TomlTable(read_toml(path, WHAT), "campaign", ("run",), faults).items("run")
    if not tables and not faults:
        faults.append("no [[run]]")
    if len(tables) > LARGEST_RUNS:
        faults.append(f"{len(tables)} runs, expected at most {LARGEST_RUNS}")
        tables = []
    folder, runs = path.parent, []
    for k, entry in enumerate(tables, start=1):
        table = TomlTable(entry, f"run {k}", _RUN_KEYS, faults)
        step = cast(Step, table.word("step", STEPS))
        log = table.text("log")
        run = ListedRun(
            step=step,
            name=table.text("name", Path(log).stem),
            log=folder / log,
            trajectory=folder / table.text("trajectory") if table.has("trajectory") else None,
            joint=table.text("joint", None if step in ("motor", "friction") else ""),
            load=_load(table.content["load"], f"run {k}: load", faults) if table.has("load") else None,
        )
        runs.append(run)
    require_none(faults, str(path), HINT)
    return tuple(runs)


def _load(value: object, where: str, faults: list[str]) -> Load:
    table = TomlTable(value, where, _LOAD_KEYS, faults)
    return Load(table.number("mass", SMALLEST_MASS, LARGEST_MASS), table.triple("com", LARGEST_ARM))


def plain_logs(
    path: str | Path, joint_names: Sequence[str]
) -> tuple[tuple[Path, ...], tuple[Path, ...]] | None:
    """Return the logs of a campaign that has only exciting motions without load: those for one linear fit, and those of
    its validation runs. Return None for any other campaign.

    Raises InputError if a run names a joint that the model does not have.
    """
    runs = listed_runs(path)
    fitted = [run for run in runs if run.step != "validation"]
    if any(run.step != "inertial" or run.load is not None for run in fitted):
        return None
    _require_joints(fitted, joint_names, path)
    return tuple(run.log for run in fitted), tuple(run.log for run in runs if run.step == "validation")


def tested_logs(path: str | Path, joint_names: Sequence[str]) -> tuple[Path, ...]:
    """Return the logs of a campaign that test a calibrated model.

    They are those of its validation runs, or if it has none, those of its exciting motions without a load. Raises
    InputError if the campaign has neither, or moves an unknown joint.
    """
    runs = listed_runs(path)
    _require_joints(runs, joint_names, path)
    found = [run.log for run in runs if run.step == "validation"]
    found = found or [run.log for run in runs if run.step == "inertial" and run.load is None]
    if not found:
        raise InputError(
            f"{path}: no exciting motion without a load", "give logs of the robot without a load"
        )
    return tuple(found)


def read_campaign(path: str | Path, joint_names: Sequence[str] | None = None) -> Runs:
    """Return all logs of a campaign except those of validation runs, by the step of the calibration that uses them:
    motor, gravity, friction, inertial.

    joint_names  joints of the robot to calibrate; None: joints are not checked

    Raises InputError if a log is missing or a run names an unknown joint. Also raises InputError if a motor run with
    the load has no run without the load, or the reverse.
    """
    runs = listed_runs(path)
    if joint_names is not None:
        _require_joints(runs, joint_names, path)
    pairs = _motor_pairs(runs, path)
    return Runs(
        motor=[
            MotorRun(run.joint, read_log(empty.log), read_log(run.log), load) for empty, run, load in pairs
        ],
        gravity=[GravityRun(read_log(run.log), run.load) for run in runs if run.step == "gravity"],
        friction=[
            FrictionRun(run.joint, read_log(run.log), run.load) for run in runs if run.step == "friction"
        ],
        inertial=[InertialRun(read_log(run.log), run.load) for run in runs if run.step == "inertial"],
    )


def _require_joints(runs: Sequence[ListedRun], joint_names: Sequence[str], path: str | Path) -> None:
    unknown = list(dict.fromkeys(run.joint for run in runs if run.joint and run.joint not in joint_names))
    if unknown:
        raise InputError(
            f"{path}: runs of joint(s) {listed(unknown)}, which the model does not have",
            f"it has {listed(joint_names)}: is the campaign another robot's?",
        )


def _motor_pairs(runs: Sequence[ListedRun], path: str | Path) -> list[tuple[ListedRun, ListedRun, Load]]:
    """Each loaded motor run with the unloaded one of its joint."""
    motors = [run for run in runs if run.step == "motor"]
    empty: dict[str, ListedRun] = {}
    for run in motors:
        if run.load is None and run.joint in empty:
            raise InputError(f"{path}: joint {run.joint}: two unloaded motor runs", "leave one of them out")
        if run.load is None:
            empty[run.joint] = run
    loaded = [(run, run.load) for run in motors if run.load is not None]
    for joint in dict.fromkeys(run.joint for run in motors):
        if joint not in empty:
            raise InputError(
                f"{path}: joint {joint}: a loaded motor run without an unloaded one",
                "add the unloaded run: the same motion without the load",
            )
        if not any(run.joint == joint for run, _ in loaded):
            raise InputError(
                f"{path}: joint {joint}: an unloaded motor run without a loaded one",
                "a run with a load names it: load = { mass = 3.5, com = [0.08, 0.0, 0.06] }",
            )
    return [(empty[run.joint], run, load) for run, load in loaded]
