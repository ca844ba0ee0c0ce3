"""ROS 2 bags: sensor_msgs/msg/JointState through rosbags, with or without the bag's metadata.yaml."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from psdmc.calibrate.log import Log
from psdmc.errors import InputError

MESSAGE_TYPE = "sensor_msgs/msg/JointState"


def read_bag(path: Path, topic: str = "/joint_states") -> Log:
    """The joint states of one topic; effort is read as motor torque.

    path   a bag's folder, or a bare .db3 or .mcap file of it
    Time is each message's header stamp. InputError where the topic is missing or its messages disagree on joints.
    """
    rows = list(_messages(path, topic))
    if not rows:
        raise InputError(f"{path}: no {MESSAGE_TYPE} on topic '{topic}'")
    names = tuple(rows[0].name)
    odd = next((k for k, row in enumerate(rows) if tuple(row.name) != names), None)
    if odd is not None:
        raise InputError(
            f"{path}: message {odd} names joints {list(rows[odd].name)}, the first {list(names)}"
        )
    if any(len(row.effort) != len(names) for row in rows):
        raise InputError(f"{path}: joint states without effort", "record a topic that carries it")
    stamps = np.array([row.header.stamp.sec + 1e-9 * row.header.stamp.nanosec for row in rows])
    has_velocity = all(len(row.velocity) == len(names) for row in rows)
    return Log(
        name=path.name,
        joint_names=names,
        time=stamps - stamps[0],
        position=np.array([row.position for row in rows]),
        velocity=np.array([row.velocity for row in rows]) if has_velocity else None,
        effort=np.array([row.effort for row in rows]),
        quantity="motor_torque",
        notes=(f"{path.name}: 'effort' is read as motor torque, friction included",),
    )


def _messages(path: Path, topic: str) -> Iterator[Any]:
    try:
        from rosbags.typesys import Stores, get_typestore
    except ImportError as error:
        raise InputError("ROS 2 bags need rosbags", "pip install 'psdmc[calibrate]'") from error
    store = get_typestore(Stores.ROS2_HUMBLE)
    for raw in _raw_messages(path, topic):
        yield store.deserialize_cdr(raw, MESSAGE_TYPE)


def _raw_messages(path: Path, topic: str) -> Iterator[bytes]:
    """Serialised messages in the order of recording: a bare .db3 is read as the SQLite file it is."""
    if path.suffix == ".db3" and not (path.parent / "metadata.yaml").exists():
        yield from _sqlite_messages(path, topic)
        return
    from rosbags.highlevel import AnyReader

    folder = path if path.is_dir() or path.suffix == ".mcap" else path.parent
    with AnyReader([folder]) as reader:
        connections = [c for c in reader.connections if c.topic == topic and c.msgtype == MESSAGE_TYPE]
        for _, _, raw in reader.messages(connections=connections) if connections else ():
            yield bytes(raw)


def _sqlite_messages(path: Path, topic: str) -> Iterator[bytes]:
    query = (
        "SELECT data FROM messages JOIN topics ON topics.id = messages.topic_id "
        "WHERE topics.name = ? AND topics.type = ? ORDER BY messages.timestamp, messages.id"
    )
    try:
        connection = sqlite3.connect(f"file:{path}?mode=ro&immutable=1", uri=True)
        try:
            for (data,) in connection.execute(query, (topic, MESSAGE_TYPE)):
                yield bytes(data)
        finally:
            connection.close()
    except sqlite3.DatabaseError as error:
        raise InputError(f"{path}: not a ROS 2 bag: {error}") from error
