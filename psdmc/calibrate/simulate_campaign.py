"""Logs of a whole campaign from a virtual robot, each kept until what decides it changes."""

from __future__ import annotations

import hashlib
import json
import multiprocessing
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path

from psdmc.atomic import make_folder, write_whole
from psdmc.calibrate import virtual_robot
from psdmc.calibrate.campaign import ListedRun, listed_runs
from psdmc.calibrate.log_files import write_log
from psdmc.calibrate.trajectory import read_trajectory
from psdmc.calibrate.virtual_robot import Payload, load_virtual_robot, plant_texts, simulate
from psdmc.errors import InputError

INDEX = "simulated.json"


@dataclass(frozen=True, slots=True)
class SimulateOptions:
    """Which plant, as a variant of its file.

    ideal_sensors  no noise, no steps, no delay
    harness        with the file's cable harness, an effect that no model here has
    seed           of the sensors' noise; each run adds its number
    workers        processes
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
    """Write the log of every run of a campaign; returns how many had to be simulated, the others being up to date."""
    plant = Path(plant)
    runs = listed_runs(campaign)
    missing = [run.name for run in runs if run.trajectory is None]
    if missing:
        raise InputError(f"{campaign}: run(s) {', '.join(missing)} name no trajectory to simulate")
    jobs = [_Job(plant, options, run, options.seed + number) for number, run in enumerate(runs)]
    keys = {str(job.run.log): _key(job) for job in jobs}
    index_path = runs[0].log.parent / INDEX
    known = json.loads(index_path.read_text(encoding="utf-8")) if index_path.exists() else {}
    stale = [
        job
        for job in jobs
        if known.get(job.run.log.name) != keys[str(job.run.log)] or not job.run.log.exists()
    ]
    if options.workers > 1 and len(stale) > 1:
        with ProcessPoolExecutor(options.workers, multiprocessing.get_context("spawn")) as pool:
            for name in pool.map(_simulated, stale):
                progress(name)
    else:
        for job in stale:
            progress(_simulated(job))
    index = {Path(name).name: key for name, key in sorted(keys.items())}
    make_folder(index_path.parent)
    write_whole(index_path, json.dumps(index, indent=1) + "\n")
    return len(stale)


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
    """Digest of everything that decides a log: plant, variant, motion, load, seed and the simulation's own code."""
    assert job.run.trajectory is not None
    digest = hashlib.sha256()
    variant = (job.options.ideal_sensors, job.options.harness, job.seed, job.run.load)
    for part in (
        repr(variant),
        *plant_texts(job.plant),
        Path(virtual_robot.__file__).read_text(encoding="utf-8"),
    ):
        digest.update(part.encode("utf-8") + b"\0")
    digest.update(job.run.trajectory.read_bytes())
    return digest.hexdigest()
