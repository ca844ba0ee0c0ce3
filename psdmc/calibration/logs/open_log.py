"""Logs of any size from files, read piece by piece: held in memory where they are small, else on disk."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from psdmc.calibration.logs.foreign_bytes import LARGEST_STORED, opened
from psdmc.calibration.logs.log import Array
from psdmc.calibration.logs.log_bag import is_bag, read_bag
from psdmc.calibration.logs.log_date import date_of
from psdmc.calibration.logs.log_files import Layout, layout_of, read_log, require_format
from psdmc.calibration.logs.row_store import HELD_BYTES, RowStore
from psdmc.calibration.logs.stored_log import AnyLog, StoredLog
from psdmc.calibration.logs.table_limits import LARGEST_STORED_ROWS
from psdmc.calibration.logs.table_pieces import PIECES
from psdmc.errors import InputError
from psdmc.progress import Progress, Step

SMALL_FILE = 64 * 1024**2
"""Bytes of a table that is read at once."""


def open_log(
    path: str | Path, progress: Progress = lambda step: None, held: int = HELD_BYTES, topic: str = ""
) -> AnyLog:
    """A log of any size from a file that read_log takes.

    held      bytes of rows in memory; where there are more, they go to a temporary file and a StoredLog is returned
    progress  called with how much of a large file has been read
    topic     of a bag's joint states; empty: its only one, or /joint_states

    InputError as of read_log.
    """
    path = Path(path)
    if is_bag(path):
        return read_bag(path, topic, held)
    require_format(path)
    with opened(path, LARGEST_STORED) as file:
        size = file.seek(0, 2)
    if size <= min(SMALL_FILE, held):
        return read_log(path)
    return _stored(path, size, progress, held)


def _stored(path: Path, size: int, progress: Progress, held: int) -> AnyLog:
    with opened(path, LARGEST_STORED) as file:
        names, pieces = PIECES[path.suffix.lower()](file, str(path))
        layout = layout_of(path.name, names)
        places = [names.index(column) for column in layout.columns]
        store, times = RowStore(len(places), held), []
        for piece in _counted(pieces, path, size, progress, file.tell):
            times.append(np.array(piece[:, names.index("time_s")]))
            store.append(np.ascontiguousarray(piece[:, places]))
    if not times:
        raise InputError(f"{path}: no rows under its header", "record or export it again")
    time = np.concatenate(times)
    return log_of_store(layout, time, store, date_of(float(time[0])))


def _counted(
    pieces: Iterator[Array], path: Path, size: int, progress: Progress, place: Callable[[], int]
) -> Iterator[Array]:
    count = 0
    for piece in pieces:
        count += len(piece)
        if count > LARGEST_STORED_ROWS:
            raise InputError(
                f"{path}: more than {LARGEST_STORED_ROWS:,} rows, expected at most that",
                "cut it into several",
            )
        share = min(place() / size, 1.0)
        progress(Step(f"reading {path.name}: {count:,} rows, {share:.0%}", share))
        yield piece


def log_of_store(layout: Layout, time: Array, store: RowStore, date: str) -> AnyLog:
    """The log whose positions, velocities and efforts are in a store; in memory where the store is."""
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
        date=date,
    )
    return log if store.on_disk else log.held()
