"""Campaigns and plants: read with the files that they name; now and then simulated."""

from __future__ import annotations

import shutil
from pathlib import Path

from fixtures import text, trajectory

from psdmc.calibration.campaign_file import listed_runs, read_campaign
from psdmc.calibration.plant.virtual_robot import load_virtual_robot, simulate
from psdmc.calibration.simulate_campaign import SimulateOptions, simulate_campaign


def set_up(folder: Path) -> None:
    shutil.copytree(folder / "seed" / "campaign", folder / "campaign")
    for name in ("two_link.toml", "denso_wall.toml", "plant.toml"):
        shutil.copy(folder / "seed" / name, folder / name)


def campaign(data: bytes, folder: Path, deep: bool) -> None:
    """campaign.toml is given; its logs stand where the seed has them."""
    file = folder / "campaign" / "campaign.toml"
    file.write_bytes(data)
    listed_runs(file)
    read_campaign(file.parent)
    if deep and _stays_inside(data):
        try:
            simulate_campaign(folder / "plant.toml", file.parent, SimulateOptions(ideal_sensors=True))
        finally:
            _restore(folder)


def simulated(data: bytes, folder: Path, deep: bool) -> None:
    """The index of simulated logs is given."""
    index = folder / "campaign" / "logs" / "simulated.json"
    index.write_bytes(data)
    try:
        simulate_campaign(folder / "plant.toml", folder / "campaign", SimulateOptions(ideal_sensors=True))
    finally:
        _restore(folder)


def plant(data: bytes, folder: Path, deep: bool) -> None:
    file = folder / "mutated.toml"
    file.write_bytes(data)
    _simulated(file, deep)


def plant_robot(data: bytes, folder: Path, deep: bool) -> None:
    """The robot's file beside a plant is given: the virtual robot reads it by itself."""
    (folder / "robot").mkdir(exist_ok=True)
    (folder / "robot" / "plant.toml").write_text(text("plant.toml"), encoding="utf-8")
    (folder / "robot" / "two_link.toml").write_bytes(data)
    _simulated(folder / "robot" / "plant.toml", deep)


def _simulated(file: Path, deep: bool) -> None:
    robot = load_virtual_robot(file)
    load_virtual_robot(file, harness=True)
    if deep and robot.joint_names == trajectory().joint_names:
        simulate(robot, trajectory())


def _stays_inside(data: bytes) -> bool:
    """Whether a campaign names files of its own folder only: simulating writes its logs."""
    return b".." not in data and b'"/' not in data and b"'/" not in data and b"\\" not in data


def _restore(folder: Path) -> None:
    shutil.rmtree(folder / "campaign")
    shutil.copytree(folder / "seed" / "campaign", folder / "campaign")
