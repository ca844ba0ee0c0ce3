"""Right angles written 1.57: kept, and said with the remedy, which works."""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np
import pytest
from bundled import robot_path

from psdmc.robot.load import LoadedRobot, load_robot, load_robot_text
from psdmc.robot.placement import coarse_right_angles

ARM = robot_path("rounded_arm").read_text(encoding="utf-8")
COARSE = ARM.replace("1.5708", "1.57").replace("3.1416", "3.14")
DH = """
name = "arm"
convention = "standard"
gravity = [0.0, 0.0, -9.81]
[[joint]]
name = "waist"
type = "revolute"
a = 0.0
alpha = {}
d = 0.3
theta = 0.0
[[joint]]
name = "elbow"
type = "revolute"
a = 0.4
alpha = 0.0
d = 0.0
theta = 0.0
"""


def said(loaded: LoadedRobot) -> list[str]:
    return [note for note in loaded.mechanism.notes if "few digits" in note]


def test_each_joint_is_named_with_what_it_has_and_the_remedy_makes_it_exact() -> None:
    (note,) = said(load_robot_text(COARSE, "urdf"))

    assert note.startswith(
        "right angles written with few digits, at joint(s) 'shoulder' (-1.57), 'elbow' (3.14, -1.57), "
    )
    assert "kept as written, up to 1.6e-03 rad off" in note
    remedy = re.search(r"--snap ([\de.-]+) takes them for exact", note)
    assert remedy is not None
    exact = load_robot_text(COARSE, "urdf", snap=float(remedy[1]))
    assert said(exact) == []
    assert len(exact.snap_report) > 0
    for one, other in zip(exact.mechanism.joints, load_robot_text(ARM, "urdf").mechanism.joints, strict=True):
        np.testing.assert_array_equal(one.placement.rotation, other.placement.rotation)


def test_what_is_exact_or_snapped_or_wanted_as_written_is_not_said() -> None:
    assert said(load_robot_text(ARM, "urdf")) == []
    assert said(load_robot_text(ARM, "urdf", snap=0.0)) == []
    assert said(load_robot_text(COARSE, "urdf", snap=0.0)) == []
    assert len(said(load_robot_text(ARM, "urdf", snap=1e-6))) == 1


def test_a_dh_table_is_told_likewise(tmp_path: Path) -> None:
    for number, text in enumerate(("1.57", "1.5708", '"90 deg"', repr(math.pi / 2))):
        path = tmp_path / f"{number}.toml"
        path.write_text(DH.format(text), encoding="utf-8")
        notes = said(load_robot(path))
        assert [("'waist' (1.57)" in note, "--snap 0.0008" in note) for note in notes] == [(True, True)] * (
            text == "1.57"
        )


@pytest.mark.parametrize("angle", [0.0, 1e-3, 0.79, 1.5712345, 1.572, 1.5705, math.pi, -3.1416, 1.6])
def test_angles_of_a_calibration_and_others_are_no_rounded_right_angles(angle: float) -> None:
    assert coarse_right_angles({"j": (angle,)}, 1e-5) == ()


@pytest.mark.parametrize("angle", [1.57, -1.57, 1.571, 3.14, 3.142, 4.71, -4.712, 6.28])
def test_right_angles_of_two_or_three_digits_are(angle: float) -> None:
    (note,) = coarse_right_angles({"a\x07b": (angle,)}, 1e-5)

    assert f"({angle:g})" in note
    assert "\x07" not in note
