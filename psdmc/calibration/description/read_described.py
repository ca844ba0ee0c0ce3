"""The logs that a description describes, in SI units and by the model's joints."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager

import numpy as np

from psdmc.calibration.description.columns_found import Found, JointColumns, joint_columns, place_of
from psdmc.calibration.description.description import LogDescription
from psdmc.calibration.description.efforts import held_quantity, torque_factor
from psdmc.calibration.description.in_si import Layout, in_si
from psdmc.calibration.description.table_coupling import COUPLING
from psdmc.calibration.description.table_csv_form import CSV_FORM
from psdmc.calibration.description.table_logs import LOGS, LogEntry
from psdmc.calibration.description.table_quantities import refused
from psdmc.calibration.description.table_time import TIME, TimeEntry
from psdmc.calibration.logs.formats import format_of
from psdmc.calibration.logs.log import Array, date_of
from psdmc.calibration.logs.log_format import Columns, Opening
from psdmc.calibration.logs.stored_log import HELD_BYTES, AnyLog, RowStore, StoredLog
from psdmc.calibration.logs.table_limits import LARGEST_STORED_ROWS
from psdmc.calibration.logs.wording import listed
from psdmc.errors import InputError
from psdmc.progress import Progress


def described_logs(
    description: LogDescription,
    joint_names: tuple[str, ...],
    progress: Progress = lambda step: None,
    held: int = HELD_BYTES,
) -> tuple[AnyLog, ...]:
    """All logs of a description, their joints in the order of these names.

    held   bytes of a log's rows in memory; more go to a temporary file

    Raises InputError, with the description's name first, where a file is missing or is not what the description says.
    """
    found = []
    for entry in description.part(LOGS):
        progress(f"reading {entry.name}")
        with _of(description):
            found.append(_described(description, entry, joint_names, held))
    return tuple(found)


@contextmanager
def _of(description: LogDescription) -> Iterator[None]:
    try:
        yield
    except InputError as error:
        raise InputError(f"{description.path}: {error.message}", error.hint) from error


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
    si = in_si(time, store, layout, description.part(COUPLING), entry)
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
    )
    return log if si[1].on_disk else log.held()


def _layout(description: LogDescription, name: str, joints: Sequence[JointColumns]) -> Layout:
    lacking = [joint.name for joint in joints if joint.velocity is None]
    velocities = [] if lacking else [joint.velocity for joint in joints if joint.velocity is not None]
    efforts = [joint.effort for joint in joints]
    coupled = bool(description.part(COUPLING).effort)
    quantity = held_quantity([(joint.name, joint.effort) for joint in joints], coupled)
    columns = (*(joint.position for joint in joints), *velocities, *efforts)
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
    )


def _sliding(joints: Sequence[JointColumns]) -> tuple[str, ...] | None:
    """Joints in m; None where a unit was not said. InputError where a joint's units contradict each other."""
    for joint in joints:
        kinds = {"position": joint.position.says, "effort": joint.effort.says}
        if joint.velocity is not None:
            kinds["velocity"] = joint.velocity.says
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
    parts = {table: [k for k, found in enumerate(columns) if found.table == table] for table in tables}
    clock = None if time.rate else place_of(time.column, next(iter(tables)), tables, "time")
    if len(tables) == 1:
        pieces = _pieces(next(iter(tables.values())), columns, clock, time.dates)
    else:
        pieces = _side_by_side(tables, parts, columns, clock, time.dates)
    store, times = RowStore(len(columns), held), []
    count = 0
    for piece in pieces:
        count += len(piece)
        if count > LARGEST_STORED_ROWS:
            raise InputError(f"{name}: more than {LARGEST_STORED_ROWS:,} rows", "cut it into several")
        if len(piece):
            times.append(piece[:, 0] * time.unit)
            store.append(np.ascontiguousarray(piece[:, 1:]))
    if not times:
        raise InputError(f"{name}: no rows", "record or export it again")
    whole = np.arange(count) / time.rate if time.rate else np.concatenate(times)
    return whole, store


def _pieces(
    table: Columns, columns: Sequence[Found], clock: tuple[str, int] | None, dates: bool
) -> Iterator[Array]:
    """Rows of time (where there is none: of the first column) and the columns."""
    places = [found.place for found in columns]
    return table.rows([places[0] if clock is None else clock[1], *places], dates)


def _side_by_side(
    tables: Mapping[str, Columns],
    parts: Mapping[str, list[int]],
    columns: Sequence[Found],
    clock: tuple[str, int] | None,
    dates: bool,
) -> Iterator[Array]:
    """The same of several tables, row by row; InputError where they differ in length."""
    whole: dict[int, Array] = {}
    lengths = {}
    for name, table in tables.items():
        own = [columns[k].place for k in parts[name]]
        is_clock = clock is not None and clock[0] == name
        if not own and not is_clock:
            continue
        read = np.concatenate(
            list(table.rows([*([clock[1]] if clock and is_clock else []), *own], dates and is_clock))
        )
        lengths[table.name] = len(read)
        if is_clock:
            whole[-1], read = read[:, 0], read[:, 1:]
        whole |= {k: read[:, j] for j, k in enumerate(parts[name])}
    if len(set(lengths.values())) > 1:
        found = ", ".join(f"{name} has {count}" for name, count in lengths.items())
        raise refused(f"tables of one log differ in rows: {found}, expected a row of each for every time")
    yield np.column_stack([whole.get(-1, whole[0]), *(whole[k] for k in range(len(columns)))])
