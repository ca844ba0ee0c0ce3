"""Files that are no logs, or were: one InputError, whatever their bytes."""

from __future__ import annotations

import io
import os
import sqlite3
import struct
import zipfile
from pathlib import Path

import numpy as np
import pytest

from psdmc.calibration.logs.bag_sizes import MAGIC
from psdmc.calibration.logs.formats import WRITTEN
from psdmc.calibration.logs.log import Log
from psdmc.calibration.logs.log_files import log_from_columns, read_log, write_log
from psdmc.errors import InputError

SUFFIXES = (*WRITTEN, ".db3", ".mcap", ".bag")
COLUMNS = {
    "time_s": np.arange(4.0),
    "position_rad.a": np.arange(4.0),
    "velocity_rad_s.a": np.ones(4),
    "motor_torque_nm.a": np.ones(4),
}


def refused(path: Path) -> str:
    with pytest.raises(InputError) as raised:
        read_log(path)
    assert len(raised.value.message) < 500
    assert "\n" not in raised.value.message
    return raised.value.message


def npz(**columns: object) -> bytes:
    file = io.BytesIO()
    np.savez(file, **columns)  # type: ignore[arg-type]
    return file.getvalue()


@pytest.mark.parametrize("suffix", SUFFIXES)
@pytest.mark.parametrize(
    "data", [b"\x00", b"garbage" * 50, b"\xff" * 1000, b"PK\x03\x04" + b"\0" * 100, b"PAR1" * 10, MAGIC * 3]
)
def test_garbage_is_refused_in_every_format(tmp_path: Path, suffix: str, data: bytes):
    path = tmp_path / f"run{suffix}"
    path.write_bytes(data)

    assert str(path) in refused(path)


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_empty_missing_and_unreadable_files_are_refused(tmp_path: Path, suffix: str):
    empty, loop = tmp_path / f"empty{suffix}", tmp_path / f"loop{suffix}"
    empty.touch()
    loop.symlink_to(loop)

    assert "is empty" in refused(empty)
    assert "no such file" in refused(tmp_path / f"missing{suffix}")
    assert "cannot be read" in refused(loop)
    assert "cannot be read" in refused(tmp_path / ("x" * 300 + suffix))
    assert "cannot be read" in refused(Path(f"a\0b{suffix}"))


@pytest.mark.parametrize("suffix", [*WRITTEN, ".mcap"])
def test_a_pipe_is_not_waited_for(tmp_path: Path, suffix: str):
    os.mkfifo(tmp_path / f"pipe{suffix}")

    assert "is not a file" in refused(tmp_path / f"pipe{suffix}")


def test_a_folder_without_a_bag_says_so(tmp_path: Path):
    (tmp_path / "run.mcap").write_bytes(b"x")

    with pytest.raises(InputError, match=r"no ROS 2 bag, and without campaign.toml") as raised:
        read_log(tmp_path)

    assert raised.value.hint == "give its file run.mcap"


@pytest.mark.parametrize("suffix", [".npz", ".parquet"])
def test_truncated_and_flipped_files_are_refused_or_read(tmp_path: Path, log: Log, suffix: str):
    whole = tmp_path / f"whole{suffix}"
    write_log(log.between(0.0, 0.2), whole)
    data = whole.read_bytes()
    path = tmp_path / f"run{suffix}"
    for size in range(1, len(data), len(data) // 40):
        path.write_bytes(data[:size])
        refused(path)
    rng = np.random.default_rng(0)
    for place in rng.integers(0, len(data), 300):
        path.write_bytes(data[:place] + bytes([data[place] ^ 0x55]) + data[place + 1 :])
        try:
            read_log(path)
        except InputError:
            continue


@pytest.mark.parametrize(
    ("columns", "message"),
    [
        ({"time_s": np.zeros((2, 2))}, "'time_s' has 2 dimensions"),
        ({"time_s": np.zeros(2, dtype=complex)}, "holds complex128, expected numbers"),
        ({"time_s": np.array(["0", "1"])}, "expected numbers"),
        ({"time_s": np.array([True, False])}, "holds bool"),
        ({"time_s": np.array([{}], dtype=object)}, "column 'time_s' holds object, expected numbers"),
        ({"time_s": np.zeros(3), "position_rad.a": np.zeros(2)}, "column 'time_s' has 3 rows, but 'position_rad.a' has 2"),
        ({}, "holds no columns"),
    ],
)  # fmt: skip
def test_an_npz_file_of_anything_but_columns_is_refused(
    tmp_path: Path, columns: dict[str, object], message: str
):
    (tmp_path / "run.npz").write_bytes(npz(**columns))

    assert message in refused(tmp_path / "run.npz")


def test_a_small_npz_file_that_unpacks_to_gigabytes_is_refused(tmp_path: Path):
    path = tmp_path / "run.npz"
    header = io.BytesIO()
    np.lib.format.write_array_header_1_0(header, {"descr": "<f8", "fortran_order": False, "shape": (2**25,)})
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("time_s.npy", header.getvalue() + b"\0" * 2**28)

    assert path.stat().st_size < 1_000_000
    assert "unpack to" in refused(path)


def test_an_npz_head_that_names_more_numbers_than_follow_is_refused_before_they_get_room(tmp_path: Path):
    path = tmp_path / "run.npz"
    header = io.BytesIO()
    np.lib.format.write_array_header_1_0(header, {"descr": "<f8", "fortran_order": False, "shape": (10**12,)})
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("time_s.npy", header.getvalue() + b"\0" * 64)

    assert "an array of 8,000,000,000,000 bytes, of which 64 are there" in refused(path)


def test_parquet_with_text_dates_or_nulls(tmp_path: Path):
    pyarrow = pytest.importorskip("pyarrow")
    parquet = pytest.importorskip("pyarrow.parquet")
    path = tmp_path / "run.parquet"
    parquet.write_table(pyarrow.table(COLUMNS | {"label": ["a", "b", "c", "d"]}), path)
    assert "column 'label' holds string, expected numbers" in refused(path)
    parquet.write_table(pyarrow.table(COLUMNS | {"time_s": np.arange(4).astype("datetime64[ms]")}), path)
    assert "column 'time_s' holds timestamp[ms]" in refused(path)
    parquet.write_table(pyarrow.table(COLUMNS | {"position_rad.a": pyarrow.array([1, None, 2, 3])}), path)
    assert np.isnan(read_log(path).position[1, 0])


def test_an_mcap_file_that_claims_to_unpack_to_gigabytes_is_refused_unread(tmp_path: Path):
    chunk = struct.pack("<QQQI", 0, 1, 2**40, 0) + struct.pack("<I", 4) + b"zstd" + struct.pack("<Q", 0)
    (tmp_path / "run.mcap").write_bytes(MAGIC + b"\x06" + struct.pack("<Q", len(chunk)) + chunk)

    assert "unpacks to 1,099,511,627,776 bytes" in refused(tmp_path / "run.mcap")


def test_an_mcap_record_longer_than_its_file_is_refused_unread(tmp_path: Path):
    (tmp_path / "run.mcap").write_bytes(MAGIC + b"\x01" + struct.pack("<Q", 2**40) + b"ros2")

    assert "a record of 1,099,511,627,776 bytes at byte 8 of 21" in refused(tmp_path / "run.mcap")


@pytest.mark.parametrize(
    "record",
    [
        b"\x06" + struct.pack("<QQQQII", 44, 0, 1, 64, 0, 4) + b"zstd" + struct.pack("<Q", 2**40),
        b"\x08" + struct.pack("<QQQ", 16, 2**40, 64),
    ],
    ids=["chunk", "index"],
)
def test_an_mcap_chunk_that_claims_more_bytes_than_its_file_has_is_refused_unread(
    tmp_path: Path, record: bytes
):
    (tmp_path / "run.mcap").write_bytes(MAGIC + record + b"\0" * 40)

    assert "chunks of 1,099,511,627,776 bytes in a file of" in refused(tmp_path / "run.mcap")


def test_an_mcap_footer_that_leads_astray_is_refused_unread(tmp_path: Path):
    head, footer = b"\x01" + struct.pack("<Q", 4) + b"ros2", struct.pack("<QQI", 11, 0, 0)
    content = MAGIC + head + b"\x02" + struct.pack("<Q", len(footer)) + footer + MAGIC
    (tmp_path / "run.mcap").write_bytes(content)

    assert "its summary is not where its footer says" in refused(tmp_path / "run.mcap")


def bag(path: Path, *statements: str) -> Path:
    connection = sqlite3.connect(path)
    for statement in statements:
        connection.execute(statement)
    connection.commit()
    connection.close()
    return path


TOPICS = (
    "CREATE TABLE topics(id INTEGER, name TEXT, type TEXT)",
    "INSERT INTO topics VALUES (1, '/joint_states', 'sensor_msgs/msg/JointState')",
)
MESSAGES = "CREATE TABLE messages(id INTEGER, topic_id INTEGER, timestamp INTEGER, data BLOB)"


def test_databases_that_are_no_bags_are_refused(tmp_path: Path):
    assert "no tables 'messages' and 'topics'" in refused(bag(tmp_path / "a.db3", "CREATE TABLE x(y)"))
    endless = (
        "CREATE VIEW messages AS WITH RECURSIVE c(x) AS (SELECT 1 UNION ALL SELECT x + 1 FROM c) "
        "SELECT x AS id, 1 AS topic_id, x AS timestamp, x AS data FROM c"
    )
    assert "no tables" in refused(bag(tmp_path / "b.db3", *TOPICS, endless))
    huge = "INSERT INTO messages VALUES (1, 1, 1, 10000000000)"
    assert "a message is int, expected bytes" in refused(bag(tmp_path / "c.db3", *TOPICS, MESSAGES, huge))
    short = "INSERT INTO messages VALUES (1, 1, 1, x'0001')"
    assert "not a ROS 2 bag, or damaged" in refused(bag(tmp_path / "d.db3", *TOPICS, MESSAGES, short))
    assert "no sensor_msgs/msg/JointState on topic" in refused(bag(tmp_path / "e.db3", *TOPICS, MESSAGES))


def test_joint_states_that_do_not_fit_each_other_are_refused_by_number(tmp_path: Path):
    pytest.importorskip("rosbags")
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    state = store.types["sensor_msgs/msg/JointState"]
    header, stamp = store.types["std_msgs/msg/Header"], store.types["builtin_interfaces/msg/Time"]

    def message(names: list[str], *lengths: int) -> str:
        position, velocity, effort = (np.zeros(length) for length in lengths)
        value = state(header(stamp(0, 0), ""), names, position, velocity, effort)
        return f"x'{bytes(store.serialize_cdr(value, 'sensor_msgs/msg/JointState')).hex()}'"

    def recorded(name: str, *messages: str) -> Path:
        rows = [f"INSERT INTO messages VALUES ({k}, 1, {k}, {text})" for k, text in enumerate(messages)]
        return bag(tmp_path / f"{name}.db3", *TOPICS, MESSAGES, *rows)

    good = message(["a", "b"], 2, 0, 2)
    assert "message 2 has 1 positions for 2 joints" in refused(
        recorded("a", good, message(["a", "b"], 1, 0, 2))
    )
    assert "message 1 has 0 efforts for 2 joints" in refused(recorded("b", message(["a", "b"], 2, 2, 0)))
    assert "message 2 names joints 'b', 'a', the first 'a', 'b'" in refused(
        recorded("c", good, message(["b", "a"], 2, 0, 2))
    )
    assert "message 1 names 2 joints: 'a', 'a'" in refused(recorded("d", message(["a", "a"], 2, 0, 2)))
    assert "message 1 names 0 joints" in refused(recorded("e", message([], 0, 0, 0)))
    assert read_log(recorded("f", good)).velocity is None


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"position_rad.": np.ones(4)}, "column 'position_rad.' names no joint"),
        ({"position_m.a": np.ones(4)}, "two columns for joint a: position_rad.a and position_m.a"),
        ({"motor_torque_n.a": np.ones(4)}, "joint a has motor_torque_nm.a and motor_torque_n.a"),
        ({"effort_nm.a": np.ones(4)}, "joint a has motor_torque_nm.a and effort_nm.a"),
        ({"current_a.b": np.ones(4)}, "columns of current_a (current) and motor_torque_nm (motor_torque)"),
    ],
)
def test_columns_that_contradict_each_other_are_refused(change: dict[str, np.ndarray], message: str):
    with pytest.raises(InputError) as raised:
        log_from_columns("run", COLUMNS | change)

    assert message in raised.value.message


def test_a_joint_that_turns_in_one_column_and_slides_in_another_is_refused():
    columns = {name.replace("torque_nm", "torque_n"): values for name, values in COLUMNS.items()}

    with pytest.raises(InputError, match=r"position_rad.a and motor_torque_n.a: does it turn or slide\?"):
        log_from_columns("run", columns)


def test_what_is_expected_is_said_in_names_that_exist():
    columns = {name: COLUMNS[name] for name in ("time_s", "position_rad.a")}

    with pytest.raises(InputError) as raised:
        log_from_columns("run", columns)

    assert raised.value.hint == (
        "expected current_a.<joint>, motor_torque_nm.<joint> or joint_torque_nm.<joint>; "
        "psdmc calibrate --describe MODEL.npz LOG drafts a description of columns by other names"
    )


def test_velocities_of_some_joints_only_are_left_out_and_said():
    columns = COLUMNS | {"position_rad.b": np.ones(4), "motor_torque_nm.b": np.ones(4)}

    log = log_from_columns("run", columns)

    assert log.velocity is None
    assert log.notes == ("run: no velocity of joint(s) b: velocities are not used",)


def test_names_in_any_script_survive_every_format(tmp_path: Path, log: Log):
    from dataclasses import replace

    odd = replace(log.between(0.0, 0.1), joint_names=("плечо", 'el,"bow";'))
    for suffix in WRITTEN:
        write_log(odd, tmp_path / f"run{suffix}")
        assert read_log(tmp_path / f"run{suffix}").joint_names == odd.joint_names
