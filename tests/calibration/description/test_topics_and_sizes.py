"""Topics of bags; logs that are not held in memory; loads from described logs."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from bundled import bundled_model
from test_payload_identification import COM, MASS, Run, record

import psdmc
from psdmc.calibration.calibrate import calibrate
from psdmc.calibration.description.description import read_description
from psdmc.calibration.description.read_described import described_logs
from psdmc.calibration.logs.formats import WRITTEN
from psdmc.calibration.logs.formats.ros2_bag import FORMAT as ROS2_BAG
from psdmc.calibration.logs.log import Log, StoredLog
from psdmc.calibration.logs.log_files import read_log, write_columns
from psdmc.calibration.sources import LogNaming
from psdmc.errors import InputError

rosbags = pytest.importorskip("rosbags.rosbag2")


def bag(folder: Path, topics: tuple[str, ...], mcap: bool) -> Path:
    """A bag with joint states on each topic: position k on the k-th."""
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    state = store.types["sensor_msgs/msg/JointState"]
    header, stamp = store.types["std_msgs/msg/Header"], store.types["builtin_interfaces/msg/Time"]
    plugin = rosbags.StoragePlugin.MCAP if mcap else rosbags.StoragePlugin.SQLITE3
    with rosbags.Writer(folder, version=9, storage_plugin=plugin) as writer:
        for k, topic in enumerate(topics):
            connection = writer.add_connection(topic, state.__msgtype__, typestore=store)
            for second in range(3):
                values = [np.array([float(k)])] * 3
                message = state(header(stamp(second, 0), ""), ["a"], *values)
                writer.write(connection, second * 10**9, store.serialize_cdr(message, state.__msgtype__))
    return folder


def bare(folder: Path) -> Path:
    """The bag's file without its metadata."""
    (file,) = [path for path in folder.iterdir() if path.suffix in (".db3", ".mcap")]
    (folder / "metadata.yaml").unlink()
    return file


@pytest.mark.parametrize("mcap", [False, True])
@pytest.mark.parametrize("alone", [False, True], ids=["folder", "file"])
def test_a_topic_is_named_or_the_only_one(tmp_path: Path, mcap: bool, alone: bool):
    def opened(name: str, *topics: str) -> Path:
        folder = bag(tmp_path / name, topics, mcap)
        return bare(folder) if alone else folder

    both = opened("both", "/left", "/right")
    assert np.all(ROS2_BAG.read(opened("one", "/arm/joint_states")).rows(0, 3).position == 0.0)
    assert np.all(ROS2_BAG.read(opened("usual", "/other", "/joint_states")).rows(0, 3).position == 1.0)
    assert np.all(ROS2_BAG.read(both, "/right").rows(0, 3).position == 1.0)
    with pytest.raises(InputError, match="it has them on '/left', '/right'") as raised:
        ROS2_BAG.read(both)
    assert "--topic" in (raised.value.hint or "")
    with pytest.raises(InputError, match="on topic '/none': it has them on '/left'"):
        ROS2_BAG.read(both, "/none")


def test_a_topic_of_plain_logs_that_are_no_bags_is_refused(tmp_path: Path):
    log = record(tmp_path / "run.csv", Run(seed=1, loaded=False, seconds=1.0))
    naming = LogNaming("/arm")

    with pytest.raises(InputError, match=r"--topic '/arm': none of the logs is a bag") as raised:
        calibrate(bundled_model("kr6"), log, naming=naming)

    assert raised.value.hint == "leave it out"


MORE = """
[csv]
separator = "comma"
[position]
delay = -0.015
[effort]
delay = 0.02
[[coupling]]
joints = ["joint_5", "joint_6"]
matrix = [[0.5, 0.5], [0.5, -0.5]]
"""


@pytest.mark.parametrize("suffix", WRITTEN)
def test_what_does_not_fit_into_memory_is_the_same(
    tmp_path: Path, suffix: str, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr("psdmc.calibration.logs.formats.text.PIECE_BYTES", 50_000)
    monkeypatch.setattr("psdmc.calibration.description.read_described.BLOCK_ROWS", 301)
    monkeypatch.setattr("psdmc.calibration.description.read_described.BLOCK_ROWS", 257)
    plain = read_log(record(tmp_path / "plain.csv", Run(seed=1, loaded=False, seconds=10.0)))
    write_columns(
        {"time_s": plain.time}
        | {f"position_rad.{name}": plain.position[:, k] for k, name in enumerate(plain.joint_names)}
        | {f"motor_torque_nm.{name}": plain.effort[:, k] for k, name in enumerate(plain.joint_names)},
        tmp_path / f"log{suffix}",
    )
    (tmp_path / "log.toml").write_text(f'[[log]]\nfile = "log{suffix}"\n' + MORE, encoding="utf-8")
    description = read_description(tmp_path / "log.toml", plain.joint_names)

    (stored,) = described_logs(description, plain.joint_names, held=10_000)
    monkeypatch.undo()
    (held,) = described_logs(description, plain.joint_names)

    assert isinstance(stored, StoredLog)
    assert isinstance(held, Log)
    whole = stored.held()
    assert np.array_equal(whole.time, held.time)
    assert np.abs(whole.position - held.position).max() < 1e-12
    assert np.abs(whole.effort - held.effort).max() < 1e-9
    assert np.array_equal(held.time, plain.time[2:-2])
    torque = plain.effort[4:, 4:] @ np.linalg.inv([[0.5, 0.5], [0.5, -0.5]])
    assert np.abs(held.effort[:, 4:] - torque).max() < 1e-9
    earlier = 0.5 * (plain.position[:-4] + plain.position[1:-3])  # 1.5 rows before
    assert np.abs(held.position[:, :4] - earlier[:, :4]).max() < 1e-4
    assert np.abs(held.position[:, 4] - 0.5 * (earlier[:, 4] + earlier[:, 5])).max() < 1e-4


def test_a_load_from_a_described_log(tmp_path: Path):
    log = read_log(record(tmp_path / "loaded.csv", Run()))
    columns = {"t": log.time}
    for k in range(6):
        columns |= {f"q{k}": np.degrees(log.position[:, k]), f"i{k}": log.effort[:, k] / 20.0}
    write_columns(columns, tmp_path / "own.csv")
    joints = "".join(
        f'[[joint]]\nname = "{name}"\nposition = "q{k}"\neffort = "i{k}"\n'
        for k, name in enumerate(log.joint_names)
    )
    head = '[[log]]\nfile = "own.csv"\n[time]\ncolumn = "t"\n[position]\nunit = "deg"\n'
    head += '[effort]\nunit = "A"\ntorque_constant = 0.2\ngear_ratio = 100\n'
    (tmp_path / "log.toml").write_text(head + joints, encoding="utf-8")

    found = psdmc.identify_payload(bundled_model("kr6"), tmp_path / "log.toml")
    plain = psdmc.identify_payload(bundled_model("kr6"), tmp_path / "loaded.csv")

    assert found.mass == pytest.approx(MASS, rel=0.01)
    assert found.com == pytest.approx(COM, abs=0.01)
    assert found.mass == pytest.approx(plain.mass, rel=1e-6)
