"""ROS 1 bags, as rosbags writes them: read as logs, packed or not, and refused if they unpack to too much."""

from __future__ import annotations

import bz2
import struct
from pathlib import Path

import numpy as np
import pytest

from psdmc.calibration.logs import bag_sizes
from psdmc.calibration.logs.bag_sizes import ROS1_MAGIC
from psdmc.calibration.logs.formats import format_of, has_topics
from psdmc.calibration.logs.log import StoredLog
from psdmc.calibration.logs.log_files import open_log, read_log
from psdmc.calibration.logs.log_format import Opening
from psdmc.errors import InputError

rosbag1 = pytest.importorskip("rosbags.rosbag1")
ROWS = 300


def bag(path: Path, packing: str = "", topic: str = "/joint_states") -> Path:
    """Joint states at 1 kHz: a counts the rows, b is one, a's effort is twice the row."""
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC)
    state = store.types["sensor_msgs/msg/JointState"]
    header, stamp = store.types["std_msgs/msg/Header"], store.types["builtin_interfaces/msg/Time"]
    writer = rosbag1.Writer(path)
    if packing:
        writer.set_compression(rosbag1.Writer.CompressionFormat[packing])
    with writer:
        connection = writer.add_connection(topic, state.__msgtype__, typestore=store)
        for k in range(ROWS):
            message = state(
                seq_header(header, stamp, k),
                ["b", "a"],
                np.array([1.0, k]),
                np.zeros(2),
                np.array([0.0, 2.0 * k]),
            )
            writer.write(connection, k * 10**6, store.serialize_ros1(message, state.__msgtype__))
    return path


def seq_header(header: type, stamp: type, k: int) -> object:
    return header(k, stamp(3, k * 10**6), "")


@pytest.mark.parametrize("packing", ["", "BZ2", "LZ4"])
def test_a_bag_holds_what_was_recorded(tmp_path: Path, packing: str):
    log = read_log(bag(tmp_path / "run.bag", packing)).ordered(("a", "b"))

    assert log.time == pytest.approx(1e-3 * np.arange(ROWS), abs=1e-9)
    assert np.array_equal(log.position, np.column_stack([np.arange(ROWS), np.ones(ROWS)]))
    assert np.array_equal(log.effort[:, 0], 2.0 * np.arange(ROWS))
    assert "motor torque" in log.notes[0]


def test_large_bags_go_to_disk_and_topics_are_chosen(tmp_path: Path):
    path = bag(tmp_path / "run.bag", topic="/arm/states")

    log = open_log(path, held=100, topic="/arm/states")

    assert has_topics(path)
    assert isinstance(log, StoredLog)
    assert log.rows(10, 11).position[0].tolist() == [1.0, 10.0]
    with pytest.raises(InputError, match="on topic '/none': it has them on '/arm/states'"):
        open_log(path, topic="/none")


def test_a_description_reads_its_columns(tmp_path: Path):
    path = bag(tmp_path / "run.bag")

    with format_of(path).columns(path, Opening()) as columns:
        assert columns.names[:3] == ("time_s", "position.b", "position.a")
        assert np.concatenate(list(columns.rows([2], False)))[:, 0].tolist() == list(range(ROWS))


def record(fields: list[bytes], data: bytes) -> bytes:
    header = b"".join(struct.pack("<I", len(field)) + field for field in fields)
    return struct.pack("<I", len(header)) + header + struct.pack("<I", len(data)) + data


def test_a_small_bag_that_unpacks_to_much_is_refused_while_it_is_counted(tmp_path: Path, monkeypatch):
    monkeypatch.setattr(bag_sizes, "ALWAYS_ALLOWED", 2**20)
    chunk = record(
        [b"op=\x05", b"compression=bz2", b"size=" + struct.pack("<I", 9)], bz2.compress(bytes(2**24))
    )
    (tmp_path / "run.bag").write_bytes(ROS1_MAGIC + chunk)

    with pytest.raises(InputError, match="that unpack to more than"):
        read_log(tmp_path / "run.bag")


@pytest.mark.parametrize("packing", ["", "BZ2"])
def test_truncated_and_flipped_bags_are_refused_or_read(tmp_path: Path, packing: str):
    data = bag(tmp_path / "whole.bag", packing).read_bytes()
    path = tmp_path / "run.bag"
    rng = np.random.default_rng(0)
    damaged = [data[:size] for size in range(1, len(data), len(data) // 15)]
    damaged += [
        data[:place] + bytes([data[place] ^ 0x55]) + data[place + 1 :]
        for place in rng.integers(0, len(data), 60)
    ]
    refused = []
    for content in damaged:
        path.write_bytes(content)
        try:
            read_log(path)
        except InputError as error:
            refused.append(error.message)
    assert len(refused) > 5
    assert not any("\n" in message for message in refused)
