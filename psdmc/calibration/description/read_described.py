"""Reads the logs of a log description, in SI units and in the order of the model's joints."""

from __future__ import annotations

from array import array
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass

import numpy as np
from scipy import interpolate

from psdmc.calibration.description.columns_found import (
    Found,
    JointColumns,
    held_quantity,
    joint_columns,
    place_of,
    torque_factor,
)
from psdmc.calibration.description.description import (
    CSV_FORM,
    LOGS,
    TIME,
    LogDescription,
    LogEntry,
    TimeEntry,
)
from psdmc.calibration.description.joint_tables import COUPLING, CouplingEntry, refused
from psdmc.calibration.identify.motor_model import coupling_of
from psdmc.calibration.logs.foreign_bytes import LARGEST_STORED_ROWS, listed
from psdmc.calibration.logs.formats import format_of
from psdmc.calibration.logs.log import HELD_BYTES, AnyLog, Array, Quantity, RowStore, StoredLog, date_of
from psdmc.calibration.logs.log_format import Columns, Opening
from psdmc.errors import InputError
from psdmc.progress import Progress


def described_logs(
    description: LogDescription,
    joint_names: tuple[str, ...],
    progress: Progress = lambda step: None,
    held: int = HELD_BYTES,
) -> tuple[AnyLog, ...]:
    """Return all logs of a log description, with the joints in the order of `joint_names`.

    held   largest number of bytes of one log's rows in memory; larger logs go to a temporary file

    Raises InputError, which begins with the description's name, if a file is missing or does not match the description.
    """
    found = []
    for entry in description.part(LOGS):
        progress(f"reading {entry.name}")
        try:
            found.append(_described(description, entry, joint_names, held))
        except InputError as error:
            raise InputError(f"{description.path}: {error.message}", error.hint) from error
    return tuple(found)


def _described(
    description: LogDescription, entry: LogEntry, joint_names: tuple[str, ...], held: int
) -> AnyLog:
    with ExitStack() as stack:
        opening = Opening(description.part(CSV_FORM), entry.topic, held)
        tables = {
            name: stack.enter_context(format_of(path).columns(path, opening))
            for name, path in entry.tables.items()
        }
        layout = _layout(description, entry.name, joint_columns(description, joint_names, tables))
        time, store = _read(tables, description.part(TIME), layout.columns, entry.name, held)
    date = date_of(float(time[0]))
    si = _in_si(time, store, layout, description.part(COUPLING), entry)
    log = StoredLog(
        name=entry.name,
        joint_names=joint_names,
        time=si[0],
        store=si[1],
        has_velocity=layout.has_velocity,
        quantity=layout.quantity,
        stored=len(joint_names),
        places=tuple(range(len(joint_names))),
        notes=layout.notes,
        sliding=layout.sliding,
        date=date,
        use=entry.use,
        motors_at=len(joint_names) * (1 + layout.has_velocity) * layout.has_motors,
    )
    return log if si[1].on_disk else log.held()


def _layout(description: LogDescription, name: str, joints: Sequence[JointColumns]) -> Layout:
    lacking = [joint.name for joint in joints if joint.velocity is None]
    velocities = [] if lacking else [joint.velocity for joint in joints if joint.velocity is not None]
    efforts = [joint.effort for joint in joints]
    coupled = bool(description.part(COUPLING).effort)
    quantity = held_quantity([(joint.name, joint.effort) for joint in joints], coupled)
    has_motors = any(joint.motor is not None for joint in joints)
    if has_motors and (coupled or description.part(COUPLING).position):
        raise refused(f"{name}: motor_position and [[coupling]] are both given, expected one of them")
    motors = [joint.motor or joint.position for joint in joints] if has_motors else []
    columns = (*(joint.position for joint in joints), *velocities, *motors, *efforts)
    factors = np.array([found.factor for found in columns])
    factors[-len(joints) :] *= [torque_factor(found, quantity) for found in efforts]
    notes = (
        (f"{name}: no velocity of joint(s) {listed(lacking)}: velocities are not used",)
        if 0 < len(lacking) < len(joints)
        else ()
    )
    return Layout(
        columns,
        factors,
        np.array([found.zero for found in columns]),
        not lacking,
        quantity,
        _sliding(joints),
        notes,
        has_motors,
    )


def _sliding(joints: Sequence[JointColumns]) -> tuple[str, ...] | None:
    """Joints in m; None where a unit was not said. InputError where a joint's units contradict each other."""
    for joint in joints:
        kinds = {"position": joint.position.says, "effort": joint.effort.says}
        if joint.velocity is not None:
            kinds["velocity"] = joint.velocity.says
        if joint.motor is not None:
            kinds["motor_position"] = joint.motor.says
        says = {what: kind for what, kind in kinds.items() if kind in ("turning", "sliding")}
        if len(set(says.values())) > 1:
            both = ", ".join(f"its {what} is of a {kind} one" for what, kind in says.items())
            raise refused(f"joint {joint.name}: {both}, expected units of one kind")
    if any(joint.position.says == "any" for joint in joints):
        return None
    return tuple(joint.name for joint in joints if joint.position.says == "sliding")


def _read(
    tables: Mapping[str, Columns], time: TimeEntry, columns: Sequence[Found], name: str, held: int
) -> tuple[Array, RowStore]:
    """Time (s), and the rows of the columns as logged."""
    clock = None if time.rate else place_of(time.column, next(iter(tables)), tables, "time")
    if len(tables) == 1:
        places = [found.place for found in columns]
        # without a column of time, the first one is read in its place
        places.insert(0, places[0] if clock is None else clock[1])
        pieces = next(iter(tables.values())).rows(places, time.dates)
    else:
        pieces = _side_by_side(tables, columns, clock, time.dates)
    store, times = RowStore(len(columns), held), array("d")  # it grows in place
    count = 0
    for piece in pieces:
        count += len(piece)
        if count > LARGEST_STORED_ROWS:
            raise InputError(f"{name}: more than {LARGEST_STORED_ROWS:,} rows", "cut it into several")
        if len(piece):
            times.frombytes((piece[:, 0] * time.unit).tobytes())
            store.append(np.ascontiguousarray(piece[:, 1:]))
    if not times:
        raise InputError(f"{name}: no rows", "record or export it again")
    whole = np.arange(count) / time.rate if time.rate else np.frombuffer(times)
    return whole, store


def _side_by_side(
    tables: Mapping[str, Columns], columns: Sequence[Found], clock: tuple[str, int] | None, dates: bool
) -> Iterator[Array]:
    """Yield blocks of the kept columns of several tables, row by row. Raises InputError if they differ in length."""
    whole: dict[int, Array] = {}
    lengths = {}
    for name, table in tables.items():
        own = {k: found.place for k, found in enumerate(columns) if found.table == name}
        is_clock = clock is not None and clock[0] == name
        if not own and not is_clock:
            continue
        places = [*([clock[1]] if clock and is_clock else []), *own.values()]
        read = np.concatenate(list(table.rows(places, dates and is_clock)))
        lengths[table.name] = len(read)
        if is_clock:
            whole[-1], read = read[:, 0], read[:, 1:]
        whole |= {k: read[:, j] for j, k in enumerate(own)}
    if len(set(lengths.values())) > 1:
        found = ", ".join(f"{name} has {count}" for name, count in lengths.items())
        raise refused(f"tables of one log differ in rows: {found}, expected a row of each for every time")
    yield np.column_stack([whole.get(-1, whole[0]), *(whole[k] for k in range(len(columns)))])


@dataclass(frozen=True, slots=True, eq=False)
class Layout:
    """The columns that are kept of a log file, one for each joint and quantity. The order is position, velocity (if all
    joints have one), motor position (if a joint has one), effort.

    columns   the columns of the file
    factors   (columns,) SI value = factor * (number - zero)
    zeros     (columns,) number in each column at the SI value 0
    quantity  what the effort columns hold: current, motor torque or joint torque
    sliding   names of joints whose positions have the unit m; None if a unit is not known
    notes     remarks for the user
    """

    columns: tuple[Found, ...]
    factors: Array
    zeros: Array
    has_velocity: bool
    quantity: Quantity
    sliding: tuple[str, ...] | None
    notes: tuple[str, ...]
    has_motors: bool = False


def _in_si(
    time: Array, store: RowStore, layout: Layout, coupling: CouplingEntry, entry: LogEntry
) -> tuple[Array, RowStore]:
    """The time and the rows of a log in SI units, without delays of columns, between the start and end in `entry`.

    time    (N,) s
    store   the N rows as recorded
    layout  the columns of the rows

    Numbers that are not finite stay as they are; later checks of the log report them.
    """
    delays = np.array([found.delay for found in layout.columns])
    begin = time[0]
    time, store = _without_delays(time, store, delays, entry.name)
    with np.errstate(invalid="ignore", over="ignore"):
        since = time - begin
        first = int(np.searchsorted(since, entry.start)) if entry.start > 0.0 else 0
        stop = int(np.searchsorted(since, entry.end, side="right")) if np.isfinite(entry.end) else len(time)
        if first >= stop:
            lasts = f"it lasts {float(time[-1] - begin):.4g} s" if len(time) else "nothing is left of it"
            raise refused(f"{entry.name}: no rows from {entry.start:g} to {entry.end:g} s, {lasts}")
        maps = _maps(layout, coupling)
        converted = RowStore(store.width, store.held)
        for start in range(first, stop, BLOCK_ROWS):
            rows = (store.rows(start, min(start + BLOCK_ROWS, stop)) - layout.zeros) * layout.factors
            parts = np.split(rows, len(maps), axis=1)
            converted.append(np.hstack([onto(part) for onto, part in zip(maps, parts, strict=True)]))
    return time[first:stop], converted


def _maps(layout: Layout, coupling: CouplingEntry) -> list[Callable[[Array], Array]]:
    """Return functions that turn a quantity's columns into the joints', in the order of a store's quantities."""
    motions = [coupling.position, *([coupling.velocity] if layout.has_velocity else [])]
    maps = [_same if found is None else found.to_joints for found in map(coupling_of, motions)]
    torques = coupling_of(coupling.effort)
    maps += [_same] * layout.has_motors
    return [*maps, _same if torques is None else torques.torque_of_joints]


def _same(values: Array) -> Array:
    return values


BLOCK_ROWS = 65_536
"""Rows converted at once."""
NEIGHBOURS = 4
"""Rows on either side that interpolation between rows uses."""


def _without_delays(time: Array, store: RowStore, delays: Array, name: str) -> tuple[Array, RowStore]:
    """The time and the rows of a log without the delays of its columns. Column k of the row at time t becomes the value
    of the column at time t + delays[k], by interpolation.

    time    (N,) s
    store   N rows of len(delays) columns

    Only rows at which all columns have a value are returned. Raises InputError if time does not increase.
    """
    if not delays.any():
        return time, store
    if len(time) < 2 or not np.all(np.diff(time) > 0.0):
        raise InputError(
            f"{name}: its time does not grow from row to row: delays cannot be taken out",
            "sort the rows by time and drop doubled ones",
        )
    first = int(np.searchsorted(time, time[0] - min(float(delays.min()), 0.0)))
    stop = int(np.searchsorted(time, time[-1] - max(float(delays.max()), 0.0), side="right"))
    moved = RowStore(store.width, store.held)
    for start in range(first, stop, BLOCK_ROWS):
        own = time[start : min(start + BLOCK_ROWS, stop)]
        moved.append(_moved(time, store, own, start, delays, name))
    return time[first:stop], moved


def _moved(time: Array, store: RowStore, own: Array, start: int, delays: Array, name: str) -> Array:
    values = np.array(store.rows(start, start + len(own)))
    for delay in dict.fromkeys(delays[delays != 0.0].tolist()):
        begin, end = np.searchsorted(time, own[[0, -1]] + delay)
        low, high = max(int(begin) - NEIGHBOURS, 0), min(int(end) + NEIGHBOURS, len(time))
        columns = np.flatnonzero(delays == delay)
        around = store.rows(low, high)[:, columns]
        if not np.isfinite(around).all():
            raise InputError(
                f"{name}: a column with a delay holds values that are not finite near {own[0]:.6g} s",
                "cut the log to a clean stretch, or leave the delay out",
            )
        inside = np.clip(own + delay, time[low], time[high - 1])
        values[:, columns] = interpolate.PchipInterpolator(time[low:high], around)(inside)
    return values
