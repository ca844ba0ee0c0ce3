"""[[springs]] and [friction] as people write them: what is wrong is named with its table and key."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bundled import bundled_model
from command_line import status
from sprung_plant import Run, recorded, torsional_spring

from psdmc.calibration.columns.columns import read_columns
from psdmc.calibration.columns.effect import Motion
from psdmc.calibration.columns.kinds import KINDS
from psdmc.calibration.identify.linear_problem import motion_of
from psdmc.calibration.identify.motor_model import Coupling
from psdmc.calibration.logs.log_files import write_log
from psdmc.errors import InputError

BASE = {"link": "base", "point": [0.1, 0.0, 0.2]}
ARM = {"link": "link2", "point": [0.1, 0.0, 0.0]}
COIL = {"kind": "torsional", "name": "coil", "joint": "joint_3"}


def spring(**keys: Any) -> dict[str, Any]:
    return {"springs": [keys]}


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ({"springs": 3}, "springs: found 3, expected [[springs]]"),
        ({"springs": [3]}, "spring 1: found 3, expected a table"),
        (spring(name="x"), "spring 1: kind: missing, expected one of gas, linear, torsional"),
        (spring(kind="rubber", name="x"), "kind: found 'rubber'"),
        (spring(kind=["gas"], name="x"), "kind: found a list of 1"),
        (spring(kind="torsional", joint="joint_3"), "spring 1: name: missing"),
        (spring(kind="torsional", name="x\x00", joint="joint_3"), "name: found 'x\\x00'"),
        (spring(kind="torsional", name="x", joint="joint_9"), "joint 'joint_9' is not the robot's, it has joint_1"),
        (spring(kind="torsional", name="x", joint="joint_3", stiffness=3), "unknown key(s) 'stiffness'"),
        (spring(kind="torsional", name="x", joint="joint_3", rest=float("nan")), "rest: found nan"),
        (spring(kind="gas", name="x", to=ARM), "spring 1: from: link: missing"),
        (spring(**{"kind": "gas", "name": "x", "from": BASE, "to": {"link": "é", "point": [0, 0, 0]}}), "link 'é' is not"),
        (spring(**{"kind": "gas", "name": "x", "from": BASE, "to": {"link": "link2", "point": [0, 0]}}), "three numbers"),
        (spring(**{"kind": "gas", "name": "x", "from": BASE, "to": BASE}), "no joint changes the distance"),
        (
            spring(**{"kind": "gas", "name": "x", "from": ARM, "to": {"link": "link2", "point": [0, 1, 0]}}),
            "no joint changes the distance",
        ),
        (spring(**{"kind": "gas", "name": "x", "from": BASE, "to": ARM, "friction": 1}), "friction: found 1"),
        (spring(**{"kind": "linear", "name": "x", "from": BASE, "joints": {"joint_1": 1}}), "expected one of them"),
        (spring(kind="linear", name="x", joints={}), "joints: expected a table"),
        (spring(kind="linear", name="x", joints={"joint_1": 0}), "'joint_1': expected a number, not zero"),
        (spring(kind="linear", name="x", joints={"elbow": 1.0}), "joint 'elbow' is not the robot's"),
        ({"springs": [COIL, COIL]}, "springs: name 'coil' twice"),
        ({"springs": [COIL] * 51}, "at most 50"),
        ({"friction": []}, "friction: found a list of 0, expected a table"),
        ({"friction": {"coulomb": True}}, "friction: unknown key(s) 'coulomb'"),
        ({"friction": {"asymmetric": "joint_1"}}, "asymmetric: found 'joint_1', expected true, false, or a list"),
        ({"friction": {"asymmetric": ["knee"]}}, "asymmetric: joint(s) 'knee' are not the robot's"),
        ({"friction": {"stribeck": [0.1]}}, "friction: stribeck: found a list of 1, expected a table"),
        ({"friction": {"stribeck": {}}}, "speeds: found a list of 0, expected 1 to 6 numbers"),
        ({"friction": {"stribeck": {"speeds": [0.0]}}}, "expected 1 to 6 numbers from 0.0001 to 100"),
        ({"friction": {"stribeck": {"speeds": [0.1, 0.1]}}}, "one of them twice"),
        ({"friction": {"load": 0.1}}, "load: found 0.1, expected true, false"),
        ({"friction": {"offset": "none"}}, "offset: found 'none'"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_named(content: dict[str, Any], said: str) -> None:
    with pytest.raises(InputError) as refused:
        read_columns(content, bundled_model("kr6").mechanism, "log.toml")
    assert refused.value.message.startswith("log.toml: ")
    assert said in refused.value.message
    assert "\x00" not in refused.value.message
    assert "\n" not in refused.value.message


def test_every_kind_has_a_file_of_its_own() -> None:
    assert tuple(KINDS) == ("gas", "linear", "torsional")


def test_slopes_are_those_of_the_length() -> None:
    """Of a spring between two moving links, by differences."""
    chain = bundled_model("kr6").mechanism
    ends = {
        "from": {"link": "link1", "point": [0.0, 0.1, 0.05]},
        "to": {"link": "link5", "point": [0.02, 0.1, 0.3]},
    }
    (effect,) = read_columns(spring(kind="linear", name="x", rest=0.0, **ends), chain).effects
    rng = np.random.default_rng(4)
    q, step = rng.uniform(-1.0, 1.0, (20, 6)), 1e-6

    def length(at: np.ndarray) -> np.ndarray:
        return np.asarray(effect.way.length(at)[0])  # type: ignore[attr-defined]

    by_difference = np.stack([(length(q + d) - length(q - d)) / (2 * step) for d in step * np.eye(6)], axis=1)
    columns = effect.columns(Motion(q, 0 * q, q, 0 * q, 0.03))[:, :, 0]
    assert np.abs(columns - length(q)[:, None] * by_difference).max() < 1e-8
    assert np.abs(columns[:, 0]).max() < 1e-12
    assert np.abs(columns[:, 1]).max() > 1e-2


def test_friction_s_columns_are_their_formulas() -> None:
    chain = bundled_model("two_link_full").mechanism
    tables = {"asymmetric": True, "load": [chain.joint_names[1]], "stribeck": {"speeds": [0.1, 0.7]}}
    columns = read_columns({"friction": tables}, chain)
    rng = np.random.default_rng(1)
    v, load = 0.1 * rng.normal(size=(30, 2)), rng.normal(size=(30, 2))
    found = columns.values(Motion(0 * v, v, 0 * v, v, 0.03, load))
    sign, own = np.tanh(v / 0.03), np.eye(2)
    expected = [np.abs(sign[:, k, None]) * own[k] for k in range(2)]
    expected += [(sign * np.abs(load))[:, 1, None] * own[1]]
    peaks = [sign * np.exp(-((v / speed) ** 2)) for speed in (0.1, 0.7)]
    expected += [peak[:, k, None] * own[k] for k in range(2) for peak in peaks]
    assert np.abs(found - np.stack(expected, axis=2)).max() < 1e-15
    names = [(unknown.owner, unknown.name) for unknown in columns.unknowns]
    assert names[-1] == (chain.joint_names[1], "stribeck_0.7")
    assert not columns.plain_offsets


def test_motors_that_drive_several_joints_rub_themselves() -> None:
    """With q_joint = C q_motor: friction at the motors' speeds, by virtual work on the joints."""
    chain = bundled_model("two_link_full").mechanism
    matrix = np.array([[1.0, 0.0], [-0.5, 2.0]])
    columns = read_columns({"friction": {"asymmetric": True, "load": True}}, chain)
    rng = np.random.default_rng(1)
    v, load = rng.normal(size=(30, 2)), rng.normal(size=(30, 2))
    found = columns.values(motion_of(0 * v, v, 0.03, load, Coupling.of(matrix.tolist())))
    motors = np.linalg.solve(matrix, v.T).T
    sign, carried = np.tanh(motors / 0.03), load @ matrix
    of_motors = np.stack([np.abs(sign) * [3.0, 0.0], sign * np.abs(carried) * [0.0, 0.2]]).sum(axis=0)
    expected = np.linalg.solve(matrix.T, of_motors.T).T
    assert np.abs(found @ [3.0, 0.0, 0.0, 0.2] - expected).max() < 1e-13


LOG_TOML = """
[[log]]
file = "coil.csv"

[[springs]]
kind = "torsional"
name = "coil"
joint = "joint_3"

[friction]
stribeck = { speeds = [0.1], joints = ["joint_1"] }
"""


def calibration(folder: Path, description: str) -> list[str]:
    """The words that calibrate the KR6 by this description, both in `folder`."""
    (folder / "log.toml").write_text(description, encoding="utf-8")
    bundled_model("kr6").save(folder / "kr6.npz")
    return ["calibrate", str(folder / "kr6.npz"), str(folder / "log.toml"), "-o", str(folder / "out.npz")]


@pytest.mark.slow
def test_a_description_s_springs_reach_the_calibrated_file(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write_log(recorded(tmp_path / "coil.csv", (torsional_spring,), Run(seconds=20.0)), tmp_path / "coil.csv")
    words = calibration(tmp_path, LOG_TOML)
    code = status(*words, "--report", tmp_path / "out.html")
    assert not code, capsys.readouterr()
    page = (tmp_path / "out.html").read_text(encoding="utf-8")
    assert "<h2>Springs</h2>" in page
    capsys.readouterr()
    assert status("show", tmp_path / "out.npz") == 0
    (line,) = [line for line in capsys.readouterr().out.splitlines() if line.startswith("coil")]
    assert float(line.split()[2]) == pytest.approx(8.0, abs=0.15)


def test_a_wrong_table_is_one_line_and_exit_2(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_log(recorded(tmp_path / "coil.csv", (), Run(seconds=5.0)), tmp_path / "coil.csv")
    words = calibration(tmp_path, LOG_TOML.replace("joint_3", "elbow\\u0007"))
    assert status(*words) == 2
    said = capsys.readouterr().err
    assert "log.toml" in said
    assert "spring 1: joint: found 'elbow\\x07'" in said
    assert not (tmp_path / "out.npz").exists()
