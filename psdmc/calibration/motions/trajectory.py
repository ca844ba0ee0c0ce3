"""A motion for a robot: positions, speeds and accelerations at equal time steps, and its table as a file."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from psdmc.calibration.logs.foreign_bytes import listed
from psdmc.calibration.logs.log import LARGEST_NUMBER, Array
from psdmc.calibration.logs.log_files import column_names, read_columns, write_columns
from psdmc.errors import InputError
from psdmc.robot.mechanism import Mechanism

_TURNING = ("position_rad", "velocity_rad_s", "acceleration_rad_s2")
_SLIDING = ("position_m", "velocity_m_s", "acceleration_m_s2")


@dataclass(frozen=True, slots=True, eq=False)
class Trajectory:
    """A motion of n joints at N equal time steps.

    time        (N,)    s, from zero
    q, qd, qdd  (N, n)  rad, rad/s, rad/s^2 (m for sliding joints)
    sliding     names of joints whose position is in m
    """

    joint_names: tuple[str, ...]
    time: Array
    q: Array
    qd: Array
    qdd: Array
    sliding: tuple[str, ...] = ()

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


def smooth_step(x: Array) -> tuple[Array, Array, Array, Array]:
    """Return the integral, the value and the first two derivatives of 6 x^5 - 15 x^4 + 10 x^3, with x cut to 0 to 1."""
    x = np.clip(x, 0.0, 1.0)
    return (
        x**4 * (2.5 + x * (x - 3.0)),
        x**3 * (10.0 + x * (6.0 * x - 15.0)),
        30.0 * x**2 * (1.0 - x) ** 2,
        60.0 * x * (1.0 - x) * (1.0 - 2.0 * x),
    )


def write_trajectory(trajectory: Trajectory, path: str | Path) -> None:
    """Write time_s and, per joint, position, velocity and acceleration as .csv, .parquet or .npz."""
    columns = {"time_s": trajectory.time}
    for part, values in enumerate((trajectory.q, trajectory.qd, trajectory.qdd)):
        for k, name in enumerate(trajectory.joint_names):
            columns[_column(part, name, trajectory.sliding)] = values[:, k]
    write_columns(columns, Path(path))


def _column(part: int, name: str, sliding: Sequence[str]) -> str:
    return f"{(_SLIDING if name in sliding else _TURNING)[part]}.{name}"


def read_trajectory(path: str | Path) -> Trajectory:
    """Return a trajectory from its file. Raises InputError for a missing column, a non-finite value or uneven times."""
    path = Path(path)
    columns = read_columns(path)
    names, sliding = _named(tuple(columns))
    wanted = [[_column(part, name, sliding) for name in names] for part in range(3)]
    listed_columns = ["time_s", *(column for part in wanted for column in part)]
    missing = [column for column in listed_columns if column not in columns]
    if missing or not names:
        raise InputError(
            f"{path}: no column(s) {listed(missing) or 'position_rad.<joint>'}",
            "a trajectory has time_s and position, velocity and acceleration of each joint, as `psdmc excite` writes them",
        )
    for column in listed_columns:
        odd = np.flatnonzero(~(np.abs(columns[column]) < LARGEST_NUMBER))
        if len(odd):
            raise InputError(
                f"{path}: column '{column}', row {odd[0] + 1}: {columns[column][odd[0]]:g} is no motion",
                "correct the row",
            )
    steps = np.diff(columns["time_s"])
    if len(steps) < 2 or not steps[0] > 0 or np.abs(steps - steps[0]).max() > 1e-6 * steps[0] + 1e-9:
        raise InputError(
            f"{path}: a trajectory needs evenly spaced, growing times",
            "sample the motion at one rate, from the start on",
        )
    q, qd, qdd = (np.column_stack([columns[column] for column in part]) for part in wanted)
    return Trajectory(names, columns["time_s"] - columns["time_s"][0], q, qd, qdd, sliding)


def read_motion(path: Path, chain: Mechanism) -> tuple[tuple[str, ...], Array, tuple[Array | None, ...]]:
    """Return names of joints, times (N,), and positions, rates and accelerations, (N, n) each, of a motion's table. Rates or
    accelerations are None if the table has none. Times may be uneven.

    Raises InputError for a missing column, or if a column's unit is not that of the robot's joint.
    """
    columns = read_columns(path)
    names, sliding = _named(tuple(columns))
    slides = sliding_joints(chain)
    wrong = [n for n in names if n in chain.joint_names and (n in sliding) != (n in slides)]
    if wrong:
        raise InputError(
            f"{path}: position of joint(s) {listed(wrong)} in another unit than the robot's",
            "name columns position_m.<joint> for sliding joints, position_rad.<joint> for others",
        )
    parts: list[Array | None] = []
    for part in range(3):
        wanted = [_column(part, name, sliding) for name in names]
        missing = [column for column in wanted if column not in columns]
        if (missing and len(missing) < len(wanted)) or "time_s" not in columns or not names:
            lacking = listed(missing) if missing and names else "time_s" if names else "position_rad.<joint>"
            raise InputError(
                f"{path}: no column(s) {lacking}", "a motion has time_s and position_rad.<joint>"
            )
        parts.append(None if missing else np.column_stack([columns[column] for column in wanted]))
    return names, columns["time_s"], tuple(parts)


def trajectory_joints(path: str | Path) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return the names of the joints in a trajectory's file, and of those that slide, from its head alone."""
    return _named(column_names(Path(path)))


def _named(columns: Sequence[str]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    split = [column.partition(".") for column in columns]
    names = tuple(name for prefix, _, name in split if prefix in (_TURNING[0], _SLIDING[0]))
    return names, tuple(name for prefix, _, name in split if prefix == _SLIDING[0])


def sliding_joints(chain: Mechanism) -> tuple[str, ...]:
    """Return the names of the robot's joints whose position is in m."""
    return tuple(joint.name for joint in chain.joints if joint.type.length_order)


def limit_faults(trajectory: Trajectory, chain: Mechanism) -> list[str]:
    """Return one sentence for each joint and limit that the trajectory exceeds; empty if it keeps all limits."""
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
