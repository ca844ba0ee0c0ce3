"""Motions in the formats of robots' controllers, read back by other readers, against closed forms."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ElementTree
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.polynomial import Polynomial
from rosbags.typesys import Stores, get_typestore

from psdmc.calibration.campaign import write_campaign
from psdmc.calibration.campaign_plan import CampaignOptions, PlannedRun
from psdmc.calibration.motions.excite import Excitation
from psdmc.calibration.motions.formats import FORMATS
from psdmc.calibration.motions.formats.motion_format import resampled
from psdmc.calibration.motions.limited_sines import SineSum
from psdmc.calibration.motions.trajectory import Trajectory
from psdmc.errors import InputError

SHARED = 1.17
"""Duration in s, which is no multiple of 8 ms."""

CURVES = [Polynomial(np.random.default_rng(k).uniform(-1.0, 1.0, 6)) for k in range(7)]
"""Positions of seven joints as polynomials of time. Degree 5: a resampled motion is exact."""


def motion(joints: int, rate: float = 100.0, sliding: tuple[str, ...] = ()) -> Trajectory:
    time = np.arange(round(SHARED * rate) + 1) / rate
    q, qd, qdd = (np.column_stack([curve.deriv(k)(time) for curve in CURVES[:joints]]) for k in range(3))
    return Trajectory(tuple(f"j{k}" for k in range(joints)), time, q, qd, qdd, sliding)


@pytest.mark.parametrize("rate", [30.0, 100.0, 125.0, 1000.0])
def test_rows_at_another_rate_lie_on_the_curve(rate: float) -> None:
    found = resampled(motion(3), rate)
    assert found.time[-1] >= SHARED - 1e-9 > found.time[-2] - 1e-9
    at = np.minimum(found.time, SHARED)
    for k, values in enumerate((found.q, found.qd, found.qdd)):
        wanted = np.column_stack([curve.deriv(k)(at) for curve in CURVES[:3]])
        # a k-th derivative by rows that are 0.01 s apart amplifies rounding by 100^k
        assert np.abs(values - wanted).max() < 1e-14 * 10.0 * 100.0**k


def test_ros_2_reads_its_message() -> None:
    yaml = pytest.importorskip("yaml", reason="PyYAML, which dask brings, is not installed")
    joints = ('a"b\n- c: 1', "ü")
    given = replace(motion(2, sliding=("ü",)), joint_names=joints, sliding=("ü",))
    read = yaml.safe_load(FORMATS["ros2"].text(given))
    assert read["joint_names"] == list(joints)
    store = get_typestore(Stores.ROS2_HUMBLE)
    types, point = store.types, "trajectory_msgs/msg/JointTrajectoryPoint"
    points = [
        types[point](
            positions=np.array(each["positions"]),
            velocities=np.array(each["velocities"]),
            accelerations=np.array(each["accelerations"]),
            effort=np.array([]),
            time_from_start=types["builtin_interfaces/msg/Duration"](**each["time_from_start"]),
        )
        for each in read["points"]
    ]
    header = types["std_msgs/msg/Header"](types["builtin_interfaces/msg/Time"](0, 0), "")
    whole = types["trajectory_msgs/msg/JointTrajectory"](header, list(joints), points)
    name = "trajectory_msgs/msg/JointTrajectory"
    back: Any = store.deserialize_cdr(store.serialize_cdr(whole, name), name)
    times = [each.time_from_start.sec + each.time_from_start.nanosec * 1e-9 for each in back.points]
    assert times == pytest.approx(given.time, abs=1e-9)
    for k, part in enumerate(("positions", "velocities", "accelerations")):
        wanted = np.column_stack([curve.deriv(k)(given.time) for curve in CURVES[:2]])
        assert np.array([getattr(each, part) for each in back.points]) == pytest.approx(wanted, abs=1e-9)


def test_urscript_moves_to_the_start_and_follows_the_curve() -> None:
    lines = FORMATS["urscript"].text(motion(6)).splitlines()
    assert (lines[0], lines[-1]) == ("def psdmc_motion():", "end")
    poses = [[float(x) for x in re.findall(r"-?\d+\.\d{6}", line)] for line in lines[1:-2]]
    assert [re.match(r"  (\w+)\(", line)[1] for line in lines[1:-1]] == [  # type: ignore[index]
        "movej",
        *["servoj"] * (len(poses) - 1),
        "stopj",
    ]
    assert all("t=0.008," in line for line in lines[2:-2])
    at = np.minimum(np.arange(len(poses)) * 0.008, SHARED)
    assert np.array(poses) == pytest.approx(np.column_stack([c(at) for c in CURVES[:6]]), abs=6e-7)


def test_rsi_corrects_from_the_first_position_in_degrees() -> None:
    lines = FORMATS["rsi"].text(motion(6)).splitlines()
    rows = [ElementTree.fromstring(line).attrib for line in lines]
    found = [[float(row[f"A{k}"]) for k in range(1, 7)] for row in rows]
    at = np.minimum(np.arange(len(rows)) / 250.0, SHARED)
    wanted = np.column_stack([np.degrees(c(at) - c(0.0)) for c in CURVES[:6]])
    assert np.array(found) == pytest.approx(wanted, abs=6e-6)


def test_franka_reads_rows_of_seven_angles(tmp_path: Path) -> None:
    file = tmp_path / "q.csv"
    file.write_text(FORMATS["franka"].text(motion(7)))
    at = np.minimum(np.arange(1171) / 1000.0, SHARED)
    assert np.loadtxt(file, delimiter=",") == pytest.approx(
        np.column_stack([c(at) for c in CURVES]), abs=1e-9
    )


@pytest.mark.parametrize(
    ("name", "given", "message"),
    [
        ("urscript", motion(7), "--format urscript is for 6 joints, the robot has 7"),
        ("franka", motion(6), "--format franka is for 7 joints, the robot has 6"),
        ("rsi", motion(6, sliding=("j2",)), "--format rsi has angles only, and joint(s) 'j2' slide"),
    ],
)
def test_a_robot_that_does_not_fit_is_refused(name: str, given: Trajectory, message: str) -> None:
    with pytest.raises(InputError) as raised:
        FORMATS[name].text(given)
    assert raised.value.message == message


def test_unknown_formats_are_refused() -> None:
    with pytest.raises(InputError, match="--format is 'abb'"):
        CampaignOptions(formats=("abb",))


def test_an_old_motion_is_deleted_where_its_format_is_not_written_again(tmp_path: Path) -> None:
    ones = np.ones((6, 1))
    found = Excitation(SineSum(1.0, (1,), ones[:, 0], ones, ones), 1.0, np.ones(1), np.ones((1, 2)), 1, 1.0)
    runs = [PlannedRun("inertial", "exciting", motion(6))]
    write_campaign(tmp_path, runs, found, "csv", ("urscript", "rsi"))
    write_campaign(tmp_path, runs, found, "csv", ("ros2",), force=True)
    names = sorted(path.name for path in (tmp_path / "trajectories").iterdir())
    assert names == ["exciting.csv", "exciting.ros2.yaml"]
