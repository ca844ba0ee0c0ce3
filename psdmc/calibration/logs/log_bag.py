"""ROS 2 bags: sensor_msgs/msg/JointState through rosbags, with or without the bag's metadata.yaml."""

from __future__ import annotations

import re
import sqlite3
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from psdmc.calibration.logs.foreign_bytes import LARGEST_FILE, LARGEST_STORED, decoding, opened
from psdmc.calibration.logs.log import Array
from psdmc.calibration.logs.log_date import date_of
from psdmc.calibration.logs.mcap_size import require_mcap_size
from psdmc.calibration.logs.packed_bag import PACKED, require_packed_file, require_packed_messages
from psdmc.calibration.logs.row_store import RowStore
from psdmc.calibration.logs.stored_log import AnyLog, StoredLog
from psdmc.calibration.logs.table_limits import (
    LARGEST_COLUMNS,
    LARGEST_ROWS,
    LARGEST_STORED_ROWS,
    LARGEST_VALUES,
)
from psdmc.calibration.logs.wording import listed, quoted
from psdmc.errors import InputError

MESSAGE_TYPE = "sensor_msgs/msg/JointState"
BAGS = (".db3", ".mcap")
METADATA = "metadata.yaml"
LARGEST_METADATA = 1024**2
"""Bytes of a bag's metadata.yaml, enough for thousands of topics."""
PLAIN_MODE = re.compile(r"^\s*compression_mode:\s*(['\"]?)(none|file|)\1\s*$", re.MULTILINE)
"""The line of metadata, in lower case, of a bag whose messages are not compressed one by one."""
STEPS_PER_BYTE = 100
"""SQLite's instructions per byte of a bag; ordinary bags take less than one."""
STEPS = 1_000_000
"""Instructions that every bag may take."""


def read_bag(path: Path, topic: str = "", held: int | None = None) -> AnyLog:
    """The joint states of one topic; effort is read as motor torque.

    path   a bag's folder, or a bare .db3 or .mcap file of it
    topic  empty: /joint_states, or the only one of joint states
    held   bytes of rows in memory, beyond which they go to a temporary file and a StoredLog is returned; None: all

    Time is each message's header stamp. InputError where the bag is damaged, the topic is missing, or its messages
    disagree on joints.
    """
    for file in _files(path):
        with opened(file, LARGEST_FILE if held is None else LARGEST_STORED):
            pass
        if file.suffix.lower() == ".mcap":
            require_mcap_size(file)
        if file.suffix.lower() == PACKED:
            require_packed_file(file)
        elif _packs_messages(file.parent):
            require_packed_messages(file)
    with decoding(str(path), "a ROS 2 bag"):
        topic = _topic(path, topic)
        names, stamps, store, has_velocity = _kept(path, topic, held)
    name = path.name or str(path)
    n = len(names)
    log = StoredLog(
        name=name,
        joint_names=names,
        time=stamps - stamps[0],
        store=store,
        has_velocity=has_velocity,
        quantity="motor_torque",
        stored=n,
        places=tuple(range(n)),
        notes=(f"{name}: 'effort' is read as motor torque, friction included",),
        date=date_of(float(stamps[0])),
    )
    return log if store.on_disk else log.held()


USUAL_TOPIC = "/joint_states"
MOST_TOPICS = 10_000


def _topic(path: Path, wanted: str) -> str:
    """The topic to read; InputError where joint states are on none, or on several of other names."""
    found = topics_of(path)
    if wanted in found or (not wanted and USUAL_TOPIC in found):
        return wanted or USUAL_TOPIC
    if not wanted and len(found) == 1:
        return found[0]
    has = f"it has them on {listed([quoted(topic) for topic in found])}" if found else "it has none"
    what = f"on topic {quoted(wanted)}" if wanted else "that could be meant alone"
    hint = (
        "name one: --topic, or topic in a log description"
        if found
        else "record joint states with positions and efforts"
    )
    raise InputError(f"{path}: no {MESSAGE_TYPE} {what}: {has}", hint)


def topics_of(path: Path) -> tuple[str, ...]:
    """The topics of joint states in a bag."""
    if path.suffix.lower() == ".db3" and not (path.parent / METADATA).exists():
        return _sqlite_topics(path)
    _require_rosbags()
    from rosbags.highlevel import AnyReader

    folder = path if is_folder(path) or path.suffix.lower() == ".mcap" else path.parent
    with AnyReader([folder]) as reader:
        return tuple(dict.fromkeys(c.topic for c in reader.connections if c.msgtype == MESSAGE_TYPE))


def _kept(path: Path, topic: str, held: int | None) -> tuple[tuple[str, ...], Array, RowStore, bool]:
    """Joints, time stamps, rows of position, velocity and effort, and whether all have a velocity."""
    most = LARGEST_ROWS if held is None else LARGEST_STORED_ROWS
    names: tuple[str, ...] = ()
    store, has_velocity = RowStore(0), True
    stamps: list[tuple[int, int]] = []
    piece: list[Array] = []
    for number, row in enumerate(_messages(path, topic), start=1):
        if number == 1:
            names = tuple(row.name)
            store = RowStore(3 * len(names), 8 * LARGEST_VALUES if held is None else held)
        _require_alike(row, number, names, str(path))
        if number > most:
            raise InputError(f"{path}: more than {most:,} messages", "cut the bag into several")
        has_velocity = has_velocity and len(row.velocity) == len(names)
        velocity = row.velocity if len(row.velocity) == len(names) else np.full(len(names), np.nan)
        stamps.append((row.header.stamp.sec, row.header.stamp.nanosec))
        piece.append(np.concatenate([row.position, velocity, row.effort]))
        if len(piece) == PIECE_MESSAGES:
            store.append(np.array(piece, dtype=np.float64))
            piece = []
    if not stamps:
        raise InputError(
            f"{path}: no {MESSAGE_TYPE} on topic '{topic}'", "the log's states are expected on that topic"
        )
    if piece:
        store.append(np.array(piece, dtype=np.float64))
    seconds, fraction = np.array(stamps, dtype=np.float64).T
    time = seconds + 1e-9 * fraction
    return names, time, store, has_velocity


PIECE_MESSAGES = 4096
"""Messages held one by one."""


def _files(path: Path) -> tuple[Path, ...]:
    """The files that reading a bag opens; InputError where a folder is no bag."""
    if not is_folder(path):
        return (path,)
    found = tuple(sorted(entry for entry in path.iterdir() if entry.suffix.lower() in (*BAGS, PACKED)))
    if not (path / METADATA).exists():
        raise InputError(
            f"{path}: a folder without {METADATA}, so no ROS 2 bag, and without campaign.toml, so no campaign",
            f"give its file {found[0].name}" if found else "give a log, a bag or a campaign",
        )
    with opened(path / METADATA, LARGEST_METADATA):
        pass
    return found


def _packs_messages(folder: Path) -> bool:
    """Whether a bag's metadata may say that its messages are compressed one by one. True in doubt, as YAML has many
    ways to write a word."""
    try:
        with (folder / METADATA).open("rb") as file:
            text = file.read(LARGEST_METADATA).decode("utf-8", "replace").lower()
    except OSError:
        return False
    return "compression_mode" in text and PLAIN_MODE.search(text) is None


def is_bag(path: Path) -> bool:
    """Whether a log is read as a bag: by its ending, or as it is a folder."""
    return path.suffix.lower() in BAGS or is_folder(path)


def is_folder(path: Path) -> bool:
    """Whether there is a folder of this name; names that no file can have are none."""
    try:
        return path.is_dir()
    except (OSError, ValueError):
        return False


def _require_alike(row: Any, number: int, names: tuple[str, ...], path: str) -> None:
    """InputError where a message does not fit the first one."""
    if not names or len(names) != len(dict.fromkeys(names)) or 4 * len(names) > LARGEST_COLUMNS:
        raise InputError(
            f"{path}: message 1 names {len(names)} joints: {listed([quoted(x) for x in names])}",
            "record messages that name every joint once",
        )
    if tuple(row.name) != names:
        raise InputError(
            f"{path}: message {number} names joints {listed([quoted(x) for x in row.name])}, "
            f"the first {listed([quoted(x) for x in names])}",
            "record the joints of each publisher on a separate topic",
        )
    for what in ("position", "effort"):
        if len(getattr(row, what)) != len(names):
            raise InputError(
                f"{path}: message {number} has {len(getattr(row, what))} {what}s for {len(names)} joints",
                "record a topic whose messages carry position and effort of every joint",
            )


def _messages(path: Path, topic: str) -> Iterator[Any]:
    _require_rosbags()
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    for raw in _raw_messages(path, topic):
        if len(raw) > LARGEST_MESSAGE:
            raise InputError(
                f"{path}: a message of {len(raw):,} bytes, expected at most {LARGEST_MESSAGE:,}",
                "record the joints' states alone on that topic",
            )
        yield store.deserialize_cdr(raw, MESSAGE_TYPE)


def _require_rosbags() -> None:
    try:
        import rosbags.typesys  # noqa: F401
    except ImportError as error:
        raise InputError("ROS 2 bags need rosbags", "pip install 'psdmc[calibrate]'") from error


LARGEST_MESSAGE = 1024**2
"""Bytes of one joint state: a thousand joints."""


def _raw_messages(path: Path, topic: str) -> Iterator[bytes]:
    """Serialised messages in the order of recording: a bare .db3 is read as the SQLite file it is."""
    if path.suffix.lower() == ".db3" and not (path.parent / METADATA).exists():
        yield from _sqlite_messages(path, topic)
        return
    from rosbags.highlevel import AnyReader

    folder = path if is_folder(path) or path.suffix.lower() == ".mcap" else path.parent
    with AnyReader([folder]) as reader:
        connections = [c for c in reader.connections if c.topic == topic and c.msgtype == MESSAGE_TYPE]
        for _, _, raw in reader.messages(connections=connections) if connections else ():
            yield bytes(raw)


def _sqlite_topics(path: Path) -> tuple[str, ...]:
    """Topics of joint states in a bag's table `topics`."""
    with _opened_sqlite(path) as connection:
        found = connection.execute(
            "SELECT name FROM topics WHERE type = ? LIMIT ?", (MESSAGE_TYPE, MOST_TOPICS)
        )
        return tuple(dict.fromkeys(str(name) for (name,) in found))


@contextmanager
def _opened_sqlite(path: Path) -> Iterator[sqlite3.Connection]:
    """A bag as the SQLite file it is; InputError for views of its tables' names, whose evaluation might never end."""
    tables = "SELECT count(*) FROM sqlite_master WHERE type = 'table' AND name IN ('messages', 'topics')"
    with closing(sqlite3.connect(f"{path.absolute().as_uri()}?mode=ro&immutable=1", uri=True)) as connection:
        connection.execute("PRAGMA trusted_schema = OFF")
        connection.set_progress_handler(lambda: 1, STEPS + STEPS_PER_BYTE * path.stat().st_size)
        if _count(connection, tables) != 2:
            raise InputError(
                f"{path}: not a ROS 2 bag: no tables 'messages' and 'topics'",
                "give a .db3 or .mcap file that ros2 bag recorded, or its folder",
            )
        yield connection


def _sqlite_messages(path: Path, topic: str) -> Iterator[bytes]:
    """Blobs of a bag's table `messages`."""
    query = (
        "SELECT data FROM messages JOIN topics ON topics.id = messages.topic_id "
        "WHERE topics.name = ? AND topics.type = ? ORDER BY messages.timestamp, messages.id"
    )
    with _opened_sqlite(path) as connection:
        for (data,) in connection.execute(query, (topic, MESSAGE_TYPE)):
            if not isinstance(data, bytes):
                raise InputError(
                    f"{path}: not a ROS 2 bag: a message is {type(data).__name__}, expected bytes",
                    "record the bag again",
                )
            yield data


def _count(connection: sqlite3.Connection, query: str) -> int:
    """A count; -1 where SQLite reports a lack of memory, as it does for some damaged headers."""
    try:
        return int(connection.execute(query).fetchone()[0])
    except MemoryError:
        return -1
