"""Bags that are packed: read as others are, and refused before memory is taken where they unpack to more than they say."""

from __future__ import annotations

import io
import sqlite3
import struct
import tracemalloc
from pathlib import Path

import numpy as np
import pytest

from psdmc.calibration.logs import bag_sizes
from psdmc.calibration.logs.bag_sizes import CHUNK_INDEX, HEAD, MAGIC, _records, unpacked_size
from psdmc.calibration.logs.log_files import read_log
from psdmc.errors import InputError

bags = pytest.importorskip("rosbags.rosbag2")
zstd = pytest.importorskip("backports.zstd")
lz4 = pytest.importorskip("lz4.frame")

BOMB = 400 * 2**20
"""Bytes of zeros: some kilobytes packed, and more than anything small may unpack to."""
MODES = ("NONE", "FILE", "MESSAGE", "STORAGE")


def write_bag(folder: Path, mode: str, mcap: bool) -> None:
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    state = store.types["sensor_msgs/msg/JointState"]
    header, stamp = store.types["std_msgs/msg/Header"], store.types["builtin_interfaces/msg/Time"]
    plugin = bags.StoragePlugin.MCAP if mcap else bags.StoragePlugin.SQLITE3
    writer = bags.Writer(folder, version=9, storage_plugin=plugin)
    if mode != "NONE":
        writer.set_compression(bags.CompressionMode[mode], bags.CompressionFormat.ZSTD)
    with writer:
        connection = writer.add_connection("/joint_states", state.__msgtype__, typestore=store)
        for k in range(50):
            vectors = [np.full(2, float(k + part)) for part in range(3)]
            message = state(header(stamp(3, 1000 * k), ""), ["a", "b"], *vectors)
            writer.write(connection, 1000 * k, store.serialize_cdr(message, state.__msgtype__))


@pytest.mark.parametrize(
    ("mode", "mcap"),
    [("NONE", False), ("FILE", False), ("MESSAGE", False), ("NONE", True), ("FILE", True), ("STORAGE", True)],
)
def test_an_honest_packed_bag_is_read(mode: str, mcap: bool, tmp_path: Path):
    write_bag(tmp_path / "bag", mode, mcap)
    found = read_log(tmp_path / "bag")
    assert found.position.tolist() == [[k, k] for k in range(50)]
    assert found.effort.tolist() == [[k + 2.0, k + 2.0] for k in range(50)]


def refused_in_little_memory(path: Path) -> str:
    tracemalloc.start()
    try:
        with pytest.raises(InputError) as raised:
            read_log(path)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert raised.value.hint
    assert peak < BOMB / 4
    return raised.value.message


def test_a_packed_file_of_zeros_is_refused(tmp_path: Path):
    write_bag(tmp_path / "bag", "FILE", False)
    (file,) = (tmp_path / "bag").glob("*.zstd")
    file.write_bytes(zstd.compress(bytes(BOMB)))
    assert "bytes that unpack to more than 67,108,864" in refused_in_little_memory(tmp_path / "bag")


def test_a_packed_message_of_zeros_is_refused(tmp_path: Path):
    write_bag(tmp_path / "bag", "MESSAGE", False)
    (file,) = (tmp_path / "bag").glob("*.db3")
    connection = sqlite3.connect(file)
    connection.execute("UPDATE messages SET data = ? WHERE id = 7", (zstd.compress(bytes(BOMB)),))
    connection.commit()
    connection.close()
    assert "bytes that unpack to more than 67,108,864" in refused_in_little_memory(tmp_path / "bag")


@pytest.mark.parametrize("packing", ["zstd", "lz4"])
def test_an_mcap_chunk_that_unpacks_to_more_than_it_says_is_refused(packing: str, tmp_path: Path):
    data = {"zstd": zstd, "lz4": lz4}[packing].compress(bytes(BOMB))
    name = packing.encode()
    chunk = struct.pack("<QQQII", 0, 1, 64, 0, len(name)) + name + struct.pack("<Q", len(data)) + data
    file = tmp_path / "run.mcap"
    footer = b"\x02" + struct.pack("<QQQI", 20, 0, 0, 0)
    file.write_bytes(MAGIC + b"\x06" + struct.pack("<Q", len(chunk)) + chunk + footer + MAGIC)
    said = refused_in_little_memory(file)
    assert "the chunk at byte 8 unpacks to more than the 64 bytes it says" in said


def test_an_index_that_leads_to_no_chunk_is_refused(tmp_path: Path):
    """A reader goes where the index says, and unpacks what is there."""
    write_bag(tmp_path / "bag", "STORAGE", True)
    (file,) = (tmp_path / "bag").glob("*.mcap")
    with file.open("rb") as opened:
        place = next(place for kind, place, _ in _records(opened, file) if kind == CHUNK_INDEX)
    forged = bytearray(file.read_bytes())
    forged[place + HEAD.size + 16 : place + HEAD.size + 24] = struct.pack("<Q", 9)
    file.write_bytes(forged)
    assert "its index is not that of its chunks" in refused_in_little_memory(tmp_path / "bag")


@pytest.mark.parametrize("packing", ["zstd", "lz4"])
@pytest.mark.parametrize("piece", [7, 1000, 2**20])
def test_sizes_are_those_of_what_comes_out(packing: str, piece: int, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(bag_sizes, "PIECE", piece)
    plain = np.random.default_rng(0).bytes(5000) + bytes(20_000)
    packed = {"zstd": zstd, "lz4": lz4}[packing].compress(plain)
    kept = io.BytesIO()
    assert unpacked_size(io.BytesIO(packed + b"rest"), len(packed), packing, 10**6, kept) == len(plain)
    assert kept.getvalue() == plain
    assert 100 < unpacked_size(io.BytesIO(packed), len(packed), packing, 100) <= 100 + piece


def test_frames_one_after_the_other_count_together():
    packed = zstd.compress(bytes(1000)) + zstd.compress(bytes(500))
    assert unpacked_size(io.BytesIO(packed), len(packed), "zstd", 10**6) == 1500
