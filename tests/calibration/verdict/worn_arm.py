"""A virtual two-link arm (Pinocchio) that can carry a load and wear out: logs of motor torques for tests of validation."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from psdmc.calibration.logs.log import Log
from psdmc.calibration.logs.log_files import write_log
from psdmc.calibration.motions.trajectory import Trajectory
from psdmc.calibration.plant.virtual_robot import Payload, load_virtual_robot, simulate

CONSTANTS = np.array([12.0, 5.0])
"""N m/A"""
COULOMB, VISCOUS = (3.0, 1.2), (4.0, 1.5)


@dataclass(frozen=True)
class Worn:
    """What is changed of the arm, and how its log is recorded; without noise, sensors are ideal.

    viscosity  its friction law, such as "viscous^2"
    pace       speed of the motion
    """

    seed: int = 1
    viscous: tuple[float, float] = VISCOUS
    load: Payload | None = None
    quantity: str = "motor_torque"
    noise: float = 0.01
    viscosity: str = "viscous"
    pace: float = 1.0
    seconds: float = 20.0


def recorded(folder: Path, name: str, how: Worn, table: Path) -> Path:
    """A log `name`.csv in a folder; table: the arm's DH table."""
    lines = [
        f'robot = "{table}"',
        f'friction = ["coulomb", "{how.viscosity}"]',
    ]
    if how.noise:
        lines.append(f"[sensors]\nposition_step = 5e-7\ncurrent_noise = {how.noise}\ncurrent_step = 1e-3")
    for k, joint in enumerate(("shoulder", "elbow")):
        lines += [f'[[joint]]\nname = "{joint}"\ntorque_constant = {CONSTANTS[k]}']
        lines += [f"coulomb = {COULOMB[k]}", f'"{how.viscosity}" = {how.viscous[k]}']
    plant = folder / f"{name}.toml"
    plant.write_text("\n".join(lines), encoding="utf-8")
    rng = np.random.default_rng(how.seed)
    time = np.arange(0.0, how.seconds, 0.01)
    w = (
        how.pace
        * 2.0
        * np.pi
        * np.array([[0.31, 0.47], [0.83, 0.71], [1.13, 1.37]])
        * rng.uniform(0.8, 1.2, (3, 2))
    )
    turning = time[:, None, None] * w + rng.uniform(0.0, 6.0, (3, 2))
    q, qd = 0.2 * np.sin(turning).sum(axis=1), 0.2 * (w * np.cos(turning)).sum(axis=1)
    qdd = -0.2 * (w**2 * np.sin(turning)).sum(axis=1)
    motion = Trajectory(("shoulder", "elbow"), time, q, qd, qdd)
    log = simulate(load_virtual_robot(plant), motion, payload=how.load, seed=how.seed)
    if how.quantity == "motor_torque":
        log = replace(log, effort=log.effort * CONSTANTS, quantity="motor_torque")
    path = folder / f"{name}.csv"
    write_log(replace(log, name=name), path)
    return path


def changed(path: Path, name: str, effort: np.ndarray | None = None, swap: bool = False) -> Path:
    """The log again with another effort, or with its joints' efforts swapped."""
    from psdmc.calibration.logs.log_files import read_log

    log: Log = read_log(path)
    other = path.with_name(f"{name}.csv")
    write_log(replace(log, effort=log.effort[:, ::-1] if swap else effort), other)
    return other
