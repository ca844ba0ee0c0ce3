"""Reads log files, as a whole or in pieces, and writes them. All tables have the same column names; bags have none.

The columns are `time_s`, then for each joint `position_rad.<joint>` (`position_m.` if it slides), optionally
`velocity_rad_s.<joint>` (`velocity_m_s.`) and `motor_position_rad.<joint>` (`motor_position_m.`), and one of
`current_a.`, `motor_torque_nm.`, `joint_torque_nm.` (`_n.` if it slides). `effort_nm.` is read as motor torque, and the
log's notes say so.
"""

from __future__ import annotations

from array import array
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from psdmc.calibration.logs.foreign_bytes import (
    LARGEST_STORED,
    LARGEST_STORED_ROWS,
    listed,
    opened,
    quoted,
    require_size,
)
from psdmc.calibration.logs.formats import format_of, table_of
from psdmc.calibration.logs.log import HELD_BYTES, AnyLog, Array, Log, Quantity, RowStore, StoredLog, date_of
from psdmc.calibration.logs.log_format import TableFormat
from psdmc.errors import InputError
from psdmc.files import make_folder, whole_file
from psdmc.progress import Progress, Step

POSITIONS = ("position_rad", "position_m")
VELOCITIES = ("velocity_rad_s", "velocity_m_s")
MOTOR_POSITIONS = ("motor_position_rad", "motor_position_m")

WRITTEN_EFFORTS: Mapping[Quantity, tuple[str, str]] = {
    "current": ("current_a", "current_a"),
    "motor_torque": ("motor_torque_nm", "motor_torque_n"),
    "joint_torque": ("joint_torque_nm", "joint_torque_n"),
}
"""All of these are for turning and for sliding joints."""
EFFORTS: Mapping[str, Quantity] = {
    prefix: quantity for quantity, both in WRITTEN_EFFORTS.items() for prefix in both
} | {"effort_nm": "motor_torque", "effort_n": "motor_torque"}
"""What columns hold, by the prefix of their names: those that psdmc writes, and others that it reads."""


def read_log(path: str | Path) -> Log:
    """Return a log in memory from a table (.csv, .parquet, .npz) or a ROS bag (.bag, .db3, .mcap or its folder).

    Raises InputError if the file is missing, no log, damaged, or lacks a column.
    """
    path = Path(path)
    kind = format_of(path)
    if isinstance(kind, TableFormat):
        columns = read_columns(path)
        return log_from_columns(path.name, columns)
    bag = kind.read(path)
    return bag if isinstance(bag, Log) else bag.held()


SMALL_FILE = 64 * 1024**2
"""Bytes of a table that is read at once."""


def open_log(
    path: str | Path, progress: Progress = lambda step: None, held: int = HELD_BYTES, topic: str = ""
) -> AnyLog:
    """Return a log of any size from a file that read_log takes.

    held      most bytes of rows in memory; a larger log goes to a temporary file and becomes a StoredLog
    progress  function that is called with the share of a large file that has been read
    topic     topic of a bag with joint states; empty: its only one, or /joint_states

    Raises InputError under the same conditions as read_log.
    """
    path = Path(path)
    kind = format_of(path)
    if not isinstance(kind, TableFormat):
        return kind.read(path, topic, held)
    with opened(path, LARGEST_STORED) as file:
        size = file.seek(0, 2)
    if size <= min(SMALL_FILE, held):
        return read_log(path)
    return _stored(path, kind, size, progress, held)


def _stored(path: Path, kind: TableFormat, size: int, progress: Progress, held: int) -> AnyLog:
    with opened(path, LARGEST_STORED) as file:
        names, pieces = kind.pieces(file, str(path))
        layout = layout_of(path.name, names)
        places = [names.index(column) for column in layout.columns]
        store, times, count = RowStore(len(places), held), array("d"), 0  # an array grows in place
        for piece in pieces:
            count += len(piece)
            if count > LARGEST_STORED_ROWS:
                raise InputError(
                    f"{path}: more than {LARGEST_STORED_ROWS:,} rows, expected at most that",
                    "cut it into several",
                )
            share = min(file.tell() / size, 1.0)
            progress(Step(f"reading {path.name}: {count:,} rows, {share:.0%}", share))
            times.frombytes(piece[:, names.index("time_s")].tobytes())
            store.append(np.ascontiguousarray(piece[:, places]))
    if not times:
        raise _no_rows(path)
    time = np.frombuffer(times)
    log = StoredLog(
        name=layout.name,
        joint_names=layout.joint_names,
        time=time,
        store=store,
        has_velocity=layout.velocities is not None,
        quantity=layout.quantity,
        stored=len(layout.joint_names),
        places=tuple(range(len(layout.joint_names))),
        notes=layout.notes,
        sliding=layout.sliding,
        date=date_of(float(time[0])),
        motors_at=len(layout.positions) + len(layout.velocities or ()) if layout.motors else 0,
    )
    return log if store.on_disk else log.held()


def read_columns(path: Path) -> dict[str, Array]:
    """Return named columns of equal length of a table.

    Raises InputError if the file is missing, unreadable, too large, damaged, or holds anything but numbers.
    """
    kind = table_of(path)
    with opened(path) as file:
        names, pieces = kind.pieces(file, str(path))
        if not names:
            raise InputError(f"{path}: holds no columns", "record or export it again")
        size, count, rows = path.stat().st_size, 0, []
        for piece in pieces:
            count += len(piece)
            require_size(count, len(names), size, str(path))
            rows.append(piece)
    if not rows:
        raise _no_rows(path)
    values = np.concatenate(rows) if len(rows) > 1 else rows[0]
    return {column: values[:, k] for k, column in enumerate(names)}


def _no_rows(path: Path) -> InputError:
    return InputError(f"{path}: no rows under its header", "record or export it again")


def column_names(path: Path) -> tuple[str, ...]:
    """Return the names of a table's columns. The rows are not read."""
    kind = table_of(path)
    with opened(path) as file:
        return tuple(kind.pieces(file, str(path))[0])


@dataclass(frozen=True, slots=True)
class Layout:
    """The columns of a table that contain a log of n joints, and their quantities.

    motors  motor positions, of joints with one encoder their positions; empty: no joint has two encoders
    """

    name: str
    joint_names: tuple[str, ...]
    positions: tuple[str, ...]
    velocities: tuple[str, ...] | None
    efforts: tuple[str, ...]
    quantity: Quantity
    notes: tuple[str, ...]
    sliding: tuple[str, ...] | None
    motors: tuple[str, ...] = ()

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the columns that are read, without time."""
        return (*self.positions, *(self.velocities or ()), *self.motors, *self.efforts)


DRAFTED = "psdmc calibrate --describe MODEL.npz LOG drafts a description of columns by other names"


def _of_other_names(columns: Sequence[str]) -> str:
    """The hint for a log whose columns are not called as psdmc calls them."""
    return f"it has {listed([quoted(column) for column in columns])}; {DRAFTED}"


def layout_of(name: str, columns: Sequence[str]) -> Layout:
    """Return the layout of a table with these columns. Raises InputError with a missing column and the accepted names."""
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
    motors = {
        joint: column for joint, column in _joints(name, columns, MOTOR_POSITIONS).items() if joint in joints
    }
    _require_units(name, joints, ({} if lacking else velocities, motors), effort_names)
    return Layout(
        name=name,
        joint_names=tuple(joints),
        positions=tuple(joints.values()),
        velocities=None if lacking else tuple(velocities[joint] for joint in joints),
        efforts=tuple(effort_names),
        quantity=quantity,
        notes=notes,
        sliding=tuple(joint for joint, column in joints.items() if _slides(column)),
        motors=tuple((joints | motors).values()) if motors else (),
    )


def log_from_columns(name: str, columns: Mapping[str, Array]) -> Log:
    """Return a log from named columns of equal length. Raises InputError with a missing column and the accepted names."""
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
        date=date_of(float(columns["time_s"][0]) if len(columns["time_s"]) else 0.0),
        motor_position=stacked(found.motors) if found.motors else None,
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
    kinds = {quantity: prefix for prefix, quantity in EFFORTS.items() if prefix in present}
    if not kinds:
        wanted = "current_a.<joint>, motor_torque_nm.<joint> or joint_torque_nm.<joint>"
        raise InputError(f"{name}: no column of current or torque", f"expected {wanted}; {DRAFTED}")
    if len(kinds) > 1:
        both = " and ".join(f"{prefix} ({quantity})" for quantity, prefix in kinds.items())
        raise InputError(f"{name}: columns of {both}: only one kind can be read", "leave the others out")
    quantity = next(iter(kinds))
    prefixes = [prefix for prefix, kind in EFFORTS.items() if kind == quantity]
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
    name: str, positions: Mapping[str, str], motions: Sequence[Mapping[str, str]], efforts: list[str]
) -> None:
    """InputError where one column says that a joint turns and another one that it slides."""
    for (joint, position), effort in zip(positions.items(), efforts, strict=True):
        others = [effort] if effort.partition(".")[0] != "current_a" else []
        others += [motion[joint] for motion in motions if joint in motion]
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
    """Return the named columns of a log, as files hold them."""
    metres = [joint in (log.sliding or ()) for joint in log.joint_names]
    columns: dict[str, Array] = {"time_s": log.time}
    parts = (
        (POSITIONS, log.position),
        (VELOCITIES, log.velocity),
        (MOTOR_POSITIONS, log.motor_position),
        (WRITTEN_EFFORTS[log.quantity], log.effort),
    )
    for (turning, sliding), values in parts:
        for k, joint in enumerate(log.joint_names):
            if values is not None:
                columns[f"{sliding if metres[k] else turning}.{joint}"] = values[:, k]
    return columns


def write_log(log: Log, path: str | Path) -> None:
    """Write a log as .csv, .parquet or .npz. The file is written as a whole or not at all."""
    write_columns(columns_of(log), Path(path))


def write_columns(columns: Mapping[str, Array], path: Path) -> None:
    """Write named columns of equal length as a table. The file is written as a whole or not at all."""
    kind = table_of(path)
    make_folder(path.parent)
    with whole_file(path) as own:
        kind.write(columns, own)
