"""Logs as files: what is written is read again, and what is missing is named."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from psdmc.calibration.logs.formats import WRITTEN
from psdmc.calibration.logs.log import Log, date_of
from psdmc.calibration.logs.log_files import columns_of, log_from_columns, read_log, write_log
from psdmc.errors import InputError

COLUMNS = {
    "time_s": np.arange(4.0),
    "position_rad.a": np.arange(4.0),
    "position_rad.b": np.arange(4.0) + 1,
    "current_a.a": np.ones(4),
    "current_a.b": np.ones(4) * 2,
}


@pytest.mark.parametrize("suffix", WRITTEN)
def test_every_format_gives_back_the_same_numbers(tmp_path: Path, log: Log, suffix: str):
    write_log(log, tmp_path / f"run{suffix}")

    again = read_log(tmp_path / f"run{suffix}")

    assert again.joint_names == log.joint_names
    assert again.quantity == "motor_torque"
    assert again.velocity is not None
    for one, other in ((log.time, again.time), (log.position, again.position), (log.effort, again.effort)):
        assert np.array_equal(one, other)


def test_effort_is_read_as_motor_torque_and_said():
    columns = {name.replace("current_a", "effort_nm"): values for name, values in COLUMNS.items()}

    log = log_from_columns("run", columns)

    assert log.quantity == "motor_torque"
    assert "motor torque" in log.notes[0]


def test_sliding_joints_are_in_metres_and_newtons():
    names = {
        "position_rad.b": "position_m.b",
        "current_a.a": "motor_torque_nm.a",
        "current_a.b": "motor_torque_n.b",
    }
    columns = {names.get(name, name): values for name, values in COLUMNS.items()}

    log = log_from_columns("run", columns)

    assert log.joint_names == ("a", "b")
    assert log.sliding == ("b",)
    assert columns_of(log).keys() == columns.keys()


def test_joints_are_matched_by_name_and_missing_ones_are_named():
    log = log_from_columns("run", COLUMNS)

    assert log.ordered(("b", "a")).effort[0].tolist() == [2.0, 1.0]
    with pytest.raises(InputError, match=r"no columns for joint\(s\) c, d"):
        log.ordered(("a", "c", "d"))


@pytest.mark.parametrize(
    ("dropped", "message"),
    [
        (("time_s",), "no column 'time_s'"),
        (("position_rad.a", "position_rad.b"), "no column 'position_rad.<joint>'"),
        (("current_a.a", "current_a.b"), "no column of current or torque"),
        (("current_a.b",), "joint.* b"),
    ],
)
def test_a_missing_column_is_named(dropped: tuple[str, ...], message: str):
    columns = {name: values for name, values in COLUMNS.items() if name not in dropped}

    with pytest.raises(InputError, match=message):
        log_from_columns("run", columns)


def test_two_kinds_of_effort_are_refused():
    both = COLUMNS | {"motor_torque_nm.a": np.ones(4), "motor_torque_nm.b": np.ones(4)}

    with pytest.raises(InputError, match="only one kind"):
        log_from_columns("run", both)


def test_a_csv_of_words_is_refused(tmp_path: Path):
    path = tmp_path / "run.csv"
    path.write_text("time_s,position_rad.a,current_a.a\n0,zero,1\n", encoding="utf-8")

    with pytest.raises(InputError, match=r"line 2, column 'position_rad.a': 'zero' is no number"):
        read_log(path)


def test_an_unknown_format_is_refused(tmp_path: Path):
    (tmp_path / "run.xlsx").write_text("", encoding="utf-8")

    with pytest.raises(InputError, match="no log format"):
        read_log(tmp_path / "run.xlsx")


def test_a_bag_holds_what_was_recorded(tmp_path: Path):
    rosbags = pytest.importorskip("rosbags.rosbag2")
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    joint_state = store.types["sensor_msgs/msg/JointState"]
    header, stamp = store.types["std_msgs/msg/Header"], store.types["builtin_interfaces/msg/Time"]
    with rosbags.Writer(tmp_path / "bag", version=9) as writer:
        connection = writer.add_connection("/joint_states", joint_state.__msgtype__, typestore=store)
        for k in range(5):
            message = joint_state(
                header(stamp(3, k * 1000), ""),
                ["b", "a"],
                np.array([k, 1.0]),
                np.zeros(2),
                np.array([2.0, k]),
            )
            raw = store.serialize_cdr(message, joint_state.__msgtype__)
            writer.write(connection, k * 1000, raw)

    log = read_log(tmp_path / "bag").ordered(("a", "b"))

    assert log.time.tolist() == pytest.approx([0, 1e-6, 2e-6, 3e-6, 4e-6])
    assert log.position[:, 1].tolist() == [0, 1, 2, 3, 4]
    assert log.effort[:, 0].tolist() == [0, 1, 2, 3, 4]
    bare = next((tmp_path / "bag").glob("*.db3")).rename(tmp_path / "bare.db3")
    assert np.array_equal(read_log(bare).position, read_log(bare).position)
    assert read_log(bare).joint_names == ("b", "a")


@pytest.mark.parametrize(
    ("first", "date"),
    [(1_700_000_000.0, "2023-11-14"), (0.0, ""), (12.5, ""), (5e9, ""), (float("nan"), "")],
)
def test_only_time_that_counts_from_1970_has_a_date(first: float, date: str):
    """A log's date is what its own clock says: a copied file gives the same calibration."""
    assert date_of(first) == date
