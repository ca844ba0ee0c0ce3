"""Logs as files: CSV, Parquet and npz share their column names; ROS 2 bags have none.

`time_s`, then per joint `position_rad.<joint>` (`position_m.` where it slides), optional `velocity_rad_s.<joint>`
(`velocity_m_s.`), and one of `current_a.`, `motor_torque_nm.`, `joint_torque_nm.` (`_n.` where it slides);
`effort_nm.` is read as motor torque, and the log's notes say so.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from psdmc.calibration.logs.log import Array, Log, Quantity
from psdmc.calibration.logs.log_bag import BAGS, is_bag, read_bag
from psdmc.calibration.logs.log_date import date_of
from psdmc.calibration.logs.table_files import TABLES, read_columns, write_columns
from psdmc.calibration.logs.wording import listed, quoted
from psdmc.errors import InputError

EFFORTS: tuple[tuple[str, Quantity], ...] = (
    ("current_a", "current"),
    ("motor_torque_nm", "motor_torque"),
    ("motor_torque_n", "motor_torque"),
    ("joint_torque_nm", "joint_torque"),
    ("joint_torque_n", "joint_torque"),
    ("effort_nm", "motor_torque"),
    ("effort_n", "motor_torque"),
)
POSITIONS = ("position_rad", "position_m")
VELOCITIES = ("velocity_rad_s", "velocity_m_s")

_EFFORT_COLUMNS: dict[Quantity, tuple[str, str]] = {
    "current": ("current_a", "current_a"),
    "motor_torque": ("motor_torque_nm", "motor_torque_n"),
    "joint_torque": ("joint_torque_nm", "joint_torque_n"),
}
"""For turning and for sliding joints."""


def read_log(path: str | Path) -> Log:
    """A log from .csv, .parquet, .npz, or a ROS 2 bag (.db3, .mcap or its folder).

    InputError where the file is missing, no log, damaged, or lacks a column.
    """
    path = Path(path)
    if is_bag(path):
        bag = read_bag(path)
        return bag if isinstance(bag, Log) else bag.held()
    require_format(path)
    found = log_from_columns(path.name, read_columns(path))
    return replace(found, date=date_of(float(found.time[0]) if len(found) else 0.0))


def require_format(path: Path) -> None:
    """InputError where a file's ending is no log format's."""
    if path.suffix.lower() not in TABLES:
        raise InputError(
            f"{path}: '{path.suffix}' is no log format", f"known are {', '.join((*TABLES, *BAGS))}"
        )


@dataclass(frozen=True, slots=True)
class Layout:
    """The columns of a table that a log consists of, and their quantities. n joints."""

    name: str
    joint_names: tuple[str, ...]
    positions: tuple[str, ...]
    velocities: tuple[str, ...] | None
    efforts: tuple[str, ...]
    quantity: Quantity
    notes: tuple[str, ...]
    sliding: tuple[str, ...] | None

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the columns that are read, beside time."""
        return (*self.positions, *(self.velocities or ()), *self.efforts)


DRAFTED = "psdmc calibrate --describe MODEL.npz LOG drafts a description of columns by other names"


def _of_other_names(columns: Sequence[str]) -> str:
    """The hint for a log whose columns are not called as psdmc calls them."""
    return f"it has {listed([quoted(column) for column in columns])}; {DRAFTED}"


def layout_of(name: str, columns: Sequence[str]) -> Layout:
    """The layout of a table with these columns; InputError names a missing column and the names that would be accepted."""
    if "time_s" not in columns:
        raise InputError(f"{name}: no column 'time_s'", _of_other_names(columns))
    joints = _joints(name, columns, POSITIONS)
    if not joints:
        raise InputError(f"{name}: no column 'position_rad.<joint>'", _of_other_names(columns))
    quantity, effort_names, notes = _efforts(name, columns, tuple(joints))
    velocities = _joints(name, columns, VELOCITIES)
    lacking = [joint for joint in joints if joint not in velocities]
    if velocities and lacking:
        notes = (*notes, f"{name}: no velocity of joint(s) {listed(lacking)}: velocities are not used")
    _require_units(name, joints, {} if lacking else velocities, effort_names)
    return Layout(
        name=name,
        joint_names=tuple(joints),
        positions=tuple(joints.values()),
        velocities=None if lacking else tuple(velocities[joint] for joint in joints),
        efforts=tuple(effort_names),
        quantity=quantity,
        notes=notes,
        sliding=tuple(joint for joint, column in joints.items() if _slides(column)),
    )


def log_from_columns(name: str, columns: Mapping[str, Array]) -> Log:
    """A log from named columns of equal length; InputError names a missing column and the names that would be accepted."""
    found = layout_of(name, tuple(columns))

    def stacked(names: tuple[str, ...]) -> Array:
        return np.column_stack([columns[column] for column in names])

    return Log(
        name=name,
        joint_names=found.joint_names,
        time=columns["time_s"],
        position=stacked(found.positions),
        velocity=None if found.velocities is None else stacked(found.velocities),
        effort=stacked(found.efforts),
        quantity=found.quantity,
        notes=found.notes,
        sliding=found.sliding,
    )


def _joints(name: str, columns: Sequence[str], prefixes: tuple[str, ...]) -> dict[str, str]:
    """Column by joint, in the file's order."""
    found: dict[str, str] = {}
    for column in columns:
        prefix, _, joint = column.partition(".")
        if prefix not in prefixes:
            continue
        if not joint:
            raise InputError(f"{name}: column {quoted(column)} names no joint", f"expected {prefix}.<joint>")
        if joint in found:
            raise InputError(
                f"{name}: two columns for joint {joint}: {found[joint]} and {column}", "leave one of them out"
            )
        found[joint] = column
    return found


def _efforts(
    name: str, columns: Sequence[str], joints: tuple[str, ...]
) -> tuple[Quantity, list[str], tuple[str, ...]]:
    present = {column.partition(".")[0] for column in columns}
    kinds = {quantity: prefix for prefix, quantity in EFFORTS if prefix in present}
    if not kinds:
        wanted = "current_a.<joint>, motor_torque_nm.<joint> or joint_torque_nm.<joint>"
        raise InputError(f"{name}: no column of current or torque", f"expected {wanted}; {DRAFTED}")
    if len(kinds) > 1:
        both = " and ".join(f"{prefix} ({quantity})" for quantity, prefix in kinds.items())
        raise InputError(f"{name}: columns of {both}: only one kind can be read", "leave the others out")
    quantity = next(iter(kinds))
    prefixes = [prefix for prefix, kind in EFFORTS if kind == quantity]
    found: dict[str, str] = {}
    for joint in joints:
        own = [f"{prefix}.{joint}" for prefix in prefixes if f"{prefix}.{joint}" in columns]
        if len(own) > 1:
            raise InputError(
                f"{name}: joint {joint} has {' and '.join(own)}: only one can be read", "leave the other out"
            )
        if own:
            found[joint] = own[0]
    missing = [joint for joint in joints if joint not in found]
    if missing:
        raise InputError(
            f"{name}: no column '{kinds[quantity]}.<joint>' for joint(s) {listed(missing)}",
            "joints are matched by name: each needs a column",
        )
    said = any(found[joint].startswith("effort_") for joint in joints)
    notes = (f"{name}: 'effort' is read as motor torque, friction included",) if said else ()
    return quantity, [found[joint] for joint in joints], notes


def _require_units(
    name: str, positions: Mapping[str, str], velocities: Mapping[str, str], efforts: list[str]
) -> None:
    """InputError where one column says that a joint turns and another one that it slides."""
    for (joint, position), effort in zip(positions.items(), efforts, strict=True):
        others = [effort] if effort.partition(".")[0] != "current_a" else []
        others += [velocities[joint]] if joint in velocities else []
        odd = [column for column in others if _slides(column) != _slides(position)]
        if odd:
            raise InputError(
                f"{name}: joint {joint}: {position} and {' and '.join(odd)}: does it turn or slide?",
                "turning: position_rad, velocity_rad_s, torque_nm; sliding: position_m, velocity_m_s, torque_n",
            )


def _slides(column: str) -> bool:
    """Whether a column's unit is one of a sliding joint."""
    return column.partition(".")[0].endswith(("_m", "_m_s", "_n"))


def columns_of(log: Log) -> dict[str, Array]:
    """Named columns, as files hold them."""
    metres = [joint in (log.sliding or ()) for joint in log.joint_names]
    columns: dict[str, Array] = {"time_s": log.time}
    parts = (
        (POSITIONS, log.position),
        (VELOCITIES, log.velocity),
        (_EFFORT_COLUMNS[log.quantity], log.effort),
    )
    for (turning, sliding), values in parts:
        for k, joint in enumerate(log.joint_names):
            if values is not None:
                columns[f"{sliding if metres[k] else turning}.{joint}"] = values[:, k]
    return columns


def write_log(log: Log, path: str | Path) -> None:
    """Write .csv, .parquet or .npz, atomically."""
    write_columns(columns_of(log), Path(path))
