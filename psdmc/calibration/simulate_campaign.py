"""Simulates the logs of a whole campaign with a virtual robot. A log is simulated again only if its inputs change."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from psdmc.calibration.campaign_file import ListedRun, listed_runs
from psdmc.calibration.logs.foreign_bytes import LARGEST_FILE, SHORTER, is_folder, listed
from psdmc.calibration.logs.log_files import write_log
from psdmc.calibration.motions.trajectory import read_trajectory, trajectory_joints
from psdmc.calibration.plant import elastic, plant_file, virtual_robot
from psdmc.calibration.plant.plant_file import plant_texts
from psdmc.calibration.plant.virtual_robot import Payload, VirtualRobot, load_virtual_robot, simulate
from psdmc.errors import InputError
from psdmc.files import make_folder, read_file, write_whole
from psdmc.progress import Step
from psdmc.workers import in_processes

INDEX = "simulated.json"
LARGEST_INDEX = 1 << 20
"""Bytes of an index: 100 a log."""
LARGEST_SEED = 2**31
"""Largest seed; each run adds its number to it."""


@dataclass(frozen=True, slots=True)
class SimulateOptions:
    """The variant of the virtual robot, and how it is simulated.

    ideal_sensors  True: sensors without noise, quantisation and delay
    harness        True: with the file's cable harness, an effect that no model in psdmc has
    seed           seed of the sensors' noise; the number of a run is added to it
    workers        number of processes
    """

    ideal_sensors: bool = False
    harness: bool = False
    seed: int = 0
    workers: int = 1


@dataclass(frozen=True, slots=True)
class _Job:
    plant: Path
    options: SimulateOptions
    run: ListedRun
    seed: int


def simulate_campaign(
    plant: str | Path,
    campaign: str | Path,
    options: SimulateOptions,
    progress: Callable[[str], None] = lambda step: None,
) -> int:
    """Write the log of every run of a campaign. Return the number of logs that were simulated; the others were up to
    date.

    Raises InputError before anything is written in these cases: the campaign is for another robot, the path of a log
    is outside the campaign's folder, or a log exists that was not simulated.
    """
    plant = Path(plant)
    if not 0 <= options.seed <= LARGEST_SEED:
        raise InputError(f"seed is {options.seed}, expected 0 to {LARGEST_SEED}", "give another --seed")
    robot = load_virtual_robot(plant, ideal_sensors=options.ideal_sensors, harness=options.harness)
    runs = listed_runs(campaign)
    root = Path(campaign) if is_folder(Path(campaign)) else Path(campaign).parent
    _require_runs(runs, root, str(campaign))
    for run in runs:
        _require_robot(run, robot, plant)
    jobs = [_Job(plant, options, run, options.seed + number) for number, run in enumerate(runs)]
    keys = {job.run.log: _key(job) for job in jobs}
    index_path = runs[0].log.parent / INDEX
    known = _index(index_path)
    stale = [
        job for job in jobs if known.get(job.run.log.name) != keys[job.run.log] or not job.run.log.exists()
    ]
    measured = [job.run.log.name for job in stale if job.run.log.exists() and job.run.log.name not in known]
    if measured:
        raise InputError(
            f"{campaign}: not overwriting log(s) {listed(measured)}: psdmc did not simulate them",
            "move them away, or simulate a copy of the campaign",
        )
    index = {path.name: key for path, key in sorted(keys.items())}
    make_folder(index_path.parent)
    unfinished = index | {job.run.log.name: "" for job in stale}
    write_whole(index_path, json.dumps(unfinished, indent=1) + "\n")
    done = in_processes(_simulated, stale, min(options.workers, len(stale)))
    for count, name in enumerate(done, start=1):
        progress(Step(f"simulated {name}, {count} of {len(stale)}", count / len(stale)))
    write_whole(index_path, json.dumps(index, indent=1) + "\n")
    return len(stale)


def torque_constants_for(plant: str | Path, campaign: str | Path) -> list[str]:
    """Return `JOINT=NUMBER`, N m/A, for each joint of the virtual robot if the campaign has no runs with a load. It then
    cannot find the numbers. The list is empty otherwise."""
    if any(run.step == "motor" for run in listed_runs(campaign)):
        return []
    robot = load_virtual_robot(plant)
    return [
        f"{name}={joint.torque_constant:g}"
        for name, joint in zip(robot.joint_names, robot.joints, strict=True)
    ]


def _require_runs(runs: Sequence[ListedRun], root: Path, campaign: str) -> None:
    """InputError where a run has no motion, or its log would be written outside the campaign or over another's."""
    missing = [run.name for run in runs if run.trajectory is None]
    if missing:
        raise InputError(
            f"{campaign}: run(s) {listed(missing)} name no trajectory to simulate",
            'give each run its trajectory = "..."',
        )
    outside = [str(run.log) for run in runs if not run.log.resolve().is_relative_to(root.resolve())]
    if outside:
        raise InputError(
            f"{campaign}: log(s) {listed(outside)} outside the campaign's folder",
            "logs are written inside it only",
        )
    names = [run.log.name for run in runs]
    twice = list(dict.fromkeys(name for name in names if names.count(name) > 1))
    if twice:
        raise InputError(f"{campaign}: several runs write log(s) {listed(twice)}", "give each run its own")


def _require_robot(run: ListedRun, robot: VirtualRobot, plant: Path) -> None:
    """InputError where a run moves other joints than the plant has."""
    assert run.trajectory is not None
    names, sliding = trajectory_joints(run.trajectory)
    if names != robot.joint_names or (run.joint and run.joint not in names):
        raise InputError(
            f"{run.trajectory}: moves joints {listed(names) or 'none'}, {plant.name} has {listed(robot.joint_names)}",
            "the campaign is another robot's: plan one with `psdmc excite` from this robot's model",
        )
    if sliding != robot.sliding:
        raise InputError(
            f"{run.trajectory}: joint(s) {listed(sliding) or 'none'} slide, "
            f"of {plant.name} {listed(robot.sliding) or 'none'}",
            "the campaign is another robot's: plan one with `psdmc excite` from this robot's model",
        )


def _index(path: Path) -> dict[str, str]:
    """Digests by log, empty ones where the log may be half done; none where the file is missing or damaged."""
    try:
        found = json.loads(read_file(path, LARGEST_INDEX, "remove it: the logs are simulated again"))
    except (OSError, ValueError):
        return {}
    return found if isinstance(found, dict) else {}


def _simulated(job: _Job) -> str:
    robot = load_virtual_robot(
        job.plant, ideal_sensors=job.options.ideal_sensors, harness=job.options.harness
    )
    assert job.run.trajectory is not None
    load = job.run.load
    payload = None if load is None else Payload(load.mass, load.com)
    write_log(
        simulate(robot, read_trajectory(job.run.trajectory), payload=payload, seed=job.seed), job.run.log
    )
    return job.run.name


def _key(job: _Job) -> str:
    """Digest of all that a log depends on: plant, variant, motion, load, seed and the simulation's own code."""
    assert job.run.trajectory is not None
    digest = hashlib.sha256()
    variant = (job.options.ideal_sensors, job.options.harness, job.seed, job.run.load)
    code = [Path(str(module.__file__)).read_bytes() for module in (virtual_robot, plant_file, elastic)]
    for part in (repr(variant).encode("utf-8"), *plant_texts(job.plant), *code):
        digest.update(part + b"\0")
    digest.update(read_file(job.run.trajectory, LARGEST_FILE, SHORTER))
    return digest.hexdigest()
