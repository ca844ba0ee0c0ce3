"""A motion to be run: positions, speeds and accelerations on an even time grid, as a table that robots can be fed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from psdmc.calibrate.log import Array
from psdmc.calibrate.log_files import read_columns, write_columns
from psdmc.errors import InputError
from psdmc.robot.chain import Chain

_PREFIXES = ("position_rad", "velocity_rad_s", "acceleration_rad_s2")


@dataclass(frozen=True, slots=True, eq=False)
class Trajectory:
    """A motion of n joints at N even times.

    time        (N,)    s, from zero
    q, qd, qdd  (N, n)  rad, rad/s, rad/s^2 (m for sliding joints)
    """

    joint_names: tuple[str, ...]
    time: Array
    q: Array
    qd: Array
    qdd: Array

    def __post_init__(self) -> None:
        shape = (len(self.time), len(self.joint_names))
        for what in ("q", "qd", "qdd"):
            if getattr(self, what).shape != shape:
                raise ValueError(f"{what} has shape {getattr(self, what).shape}, expected {shape}")

    @property
    def period(self) -> float:
        return float(self.time[1] - self.time[0])

    @property
    def duration(self) -> float:
        return float(self.time[-1])


def write_trajectory(trajectory: Trajectory, path: str | Path) -> None:
    """Write time_s and, per joint, position, velocity and acceleration as .csv, .parquet or .npz."""
    columns = {"time_s": trajectory.time}
    for prefix, values in zip(_PREFIXES, (trajectory.q, trajectory.qd, trajectory.qdd), strict=True):
        for k, name in enumerate(trajectory.joint_names):
            columns[f"{prefix}.{name}"] = values[:, k]
    write_columns(columns, Path(path))


def read_trajectory(path: str | Path) -> Trajectory:
    """A trajectory from its table; InputError where a column is missing or time is uneven."""
    path = Path(path)
    if not path.exists():
        raise InputError(f"{path}: no such file")
    columns = read_columns(path)
    names = tuple(column.partition(".")[2] for column in columns if column.startswith(f"{_PREFIXES[0]}."))
    wanted = ["time_s", *(f"{prefix}.{name}" for prefix in _PREFIXES for name in names)]
    missing = [column for column in wanted if column not in columns]
    if missing or not names:
        raise InputError(f"{path}: no column(s) {', '.join(missing) or 'position_rad.<joint>'}")
    steps = np.diff(columns["time_s"])
    if len(steps) < 2 or np.abs(steps - steps[0]).max() > 1e-6 * abs(steps[0]) + 1e-9:
        raise InputError(f"{path}: a trajectory needs evenly spaced times")
    stacked = [np.column_stack([columns[f"{prefix}.{name}"] for name in names]) for prefix in _PREFIXES]
    return Trajectory(names, columns["time_s"] - columns["time_s"][0], *stacked)


def limit_faults(trajectory: Trajectory, chain: Chain) -> list[str]:
    """One sentence for each joint and limit that the trajectory exceeds; empty where it keeps all of them."""
    faults: list[str] = []
    for k, joint in enumerate(chain.joints):
        limits = joint.limits
        reach: Sequence[tuple[str, float, float]] = (
            ("position", float(trajectory.q[:, k].max()), limits.upper),
            ("position", -float(trajectory.q[:, k].min()), -limits.lower),
            ("speed", float(np.abs(trajectory.qd[:, k]).max()), limits.speed),
            ("acceleration", float(np.abs(trajectory.qdd[:, k]).max()), limits.acceleration),
        )
        faults += [
            f"{joint.name}: {what} {value:.6g} beyond {limit:.6g}"
            for what, value, limit in reach
            if value > limit
        ]
    return faults
