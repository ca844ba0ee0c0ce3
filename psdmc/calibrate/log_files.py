"""Logs as files: CSV, Parquet and npz share their column names; ROS 2 bags are read through rosbags.

`time_s`, then per joint `position_rad.<joint>` (`position_m.` where it slides), optional `velocity_rad_s.<joint>`
(`velocity_m_s.`), and one of `current_a.`, `motor_torque_nm.`, `joint_torque_nm.` (`_n.` where it slides);
`effort_nm.` is read as motor torque, and the log's notes say so.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from psdmc.atomic import make_folder, whole_file
from psdmc.calibrate.log import Array, Log, Quantity
from psdmc.calibrate.log_bag import read_bag
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

    InputError where the file is missing, no log, or lacks a column.
    """
    path = Path(path)
    if not path.exists():
        raise InputError(f"{path}: no such file")
    if path.suffix in (".db3", ".mcap") or path.is_dir():
        return read_bag(path)
    if path.suffix not in _READERS:
        known = ", ".join((*_READERS, ".db3", ".mcap"))
        raise InputError(f"{path}: '{path.suffix}' is no log format", f"known are {known}")
    return log_from_columns(path.name, _READERS[path.suffix](path))


def log_from_columns(name: str, columns: Mapping[str, Array]) -> Log:
    """A log from named columns of equal length; InputError says which column is missing and what would do."""
    if "time_s" not in columns:
        raise InputError(f"{name}: no column 'time_s'", f"it has {', '.join(columns)}")
    joints = _joints(columns, POSITIONS)
    if not joints:
        raise InputError(f"{name}: no column 'position_rad.<joint>'", f"it has {', '.join(columns)}")
    quantity, effort_names, notes = _efforts(name, columns, tuple(joints))
    velocities = _joints(columns, VELOCITIES)
    has_velocity = all(joint in velocities for joint in joints)
    return Log(
        name=name,
        joint_names=tuple(joints),
        time=columns["time_s"],
        position=np.column_stack([columns[column] for column in joints.values()]),
        velocity=np.column_stack([columns[velocities[joint]] for joint in joints]) if has_velocity else None,
        effort=np.column_stack([columns[column] for column in effort_names]),
        quantity=quantity,
        notes=notes,
        sliding=tuple(joint for joint, column in joints.items() if column.startswith("position_m.")),
    )


def _joints(columns: Mapping[str, Array], prefixes: tuple[str, ...]) -> dict[str, str]:
    """Column by joint, in the file's order."""
    found: dict[str, str] = {}
    for column in columns:
        prefix, _, joint = column.partition(".")
        if prefix in prefixes and joint:
            found[joint] = column
    return found


def _efforts(
    name: str, columns: Mapping[str, Array], joints: tuple[str, ...]
) -> tuple[Quantity, list[str], tuple[str, ...]]:
    present = {column.partition(".")[0] for column in columns}
    kinds = {quantity: prefix for prefix, quantity in EFFORTS if prefix in present}
    if not kinds:
        wanted = ", ".join(f"'{prefix}.<joint>'" for prefix, _ in EFFORTS[:4:2])
        raise InputError(
            f"{name}: no column of current or torque", f"expected one of {wanted} or 'joint_torque_nm'"
        )
    if len(kinds) > 1:
        raise InputError(f"{name}: columns of {' and '.join(sorted(kinds))}: only one kind can be read")
    quantity = next(iter(kinds))
    prefixes = [prefix for prefix, kind in EFFORTS if kind == quantity]
    found = {
        joint: f"{prefix}.{joint}"
        for prefix in prefixes
        for joint in joints
        if f"{prefix}.{joint}" in columns
    }
    missing = [joint for joint in joints if joint not in found]
    if missing:
        raise InputError(f"{name}: no column '{prefixes[0]}.<joint>' for joint(s) {', '.join(missing)}")
    said = any(found[joint].startswith("effort_") for joint in joints)
    notes = (f"{name}: 'effort' is read as motor torque, friction included",) if said else ()
    return quantity, [found[joint] for joint in joints], notes


def columns_of(log: Log) -> dict[str, Array]:
    """Named columns, as files hold them."""
    metres = [joint in log.sliding for joint in log.joint_names]
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


def write_columns(columns: Mapping[str, Array], path: Path) -> None:
    """Write named columns of equal length as .csv, .parquet or .npz; a reader never sees half a file."""
    if path.suffix not in _WRITERS:
        raise InputError(f"{path}: cannot write '{path.suffix}'", f"known are {', '.join(_WRITERS)}")
    make_folder(path.parent)
    with whole_file(path) as own:
        _WRITERS[path.suffix](columns, own)


def read_columns(path: Path) -> dict[str, Array]:
    """Named columns of a .csv, .parquet or .npz file."""
    if path.suffix not in _READERS:
        raise InputError(f"{path}: '{path.suffix}' is no table", f"known are {', '.join(_READERS)}")
    return _READERS[path.suffix](path)


def _read_csv(path: Path) -> dict[str, Array]:
    with path.open(encoding="utf-8") as file:
        names = [name.strip() for name in file.readline().rstrip("\r\n").split(",")]
        try:
            values = np.loadtxt(file, delimiter=",", ndmin=2)
        except ValueError as error:
            raise InputError(f"{path}: not a table of numbers: {error}") from error
    if values.size and values.shape[1] != len(names):
        raise InputError(f"{path}: {values.shape[1]} columns of numbers under {len(names)} names")
    if len(names) != len(dict.fromkeys(names)):
        twice = sorted(name for name in dict.fromkeys(names) if names.count(name) > 1)
        raise InputError(f"{path}: column(s) named twice: {', '.join(twice)}")
    return {name: values[:, k] if values.size else np.zeros(0) for k, name in enumerate(names)}


def _write_csv(columns: Mapping[str, Array], path: Path) -> None:
    header = ",".join(columns)
    np.savetxt(path, np.column_stack(list(columns.values())), "%.17g", ",", header=header, comments="")


def _read_npz(path: Path) -> dict[str, Array]:
    try:
        with np.load(path, allow_pickle=False) as stored:
            return {name: np.asarray(stored[name], dtype=np.float64) for name in stored.files}
    except (ValueError, OSError) as error:
        raise InputError(f"{path}: not a log in npz form: {error}") from error


def _write_npz(columns: Mapping[str, Array], path: Path) -> None:
    with path.open("wb") as file:
        np.savez(file, **dict(columns))  # type: ignore[arg-type]


def _read_parquet(path: Path) -> dict[str, Array]:
    table = _parquet().read_table(path)
    return {name: np.asarray(table.column(name).to_numpy(), dtype=np.float64) for name in table.column_names}


def _write_parquet(columns: Mapping[str, Array], path: Path) -> None:
    import pyarrow

    _parquet().write_table(pyarrow.table(dict(columns)), path)


def _parquet() -> Any:
    try:
        import pyarrow.parquet
    except ImportError as error:
        raise InputError("Parquet logs need pyarrow", "pip install 'psdmc[calibrate]'") from error
    return pyarrow.parquet


_READERS = {".csv": _read_csv, ".npz": _read_npz, ".parquet": _read_parquet}
_WRITERS = {".csv": _write_csv, ".npz": _write_npz, ".parquet": _write_parquet}
