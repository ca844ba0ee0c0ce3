"""Motors that drive two joints although log.toml does not say so: Pinocchio's torques, mixed by the test itself. psdmc's
lines are typed into log.toml as they stand, and the torque of both joints is then predicted."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from bundled import robot_path

from psdmc.calibration.logs.log_files import write_columns
from psdmc.cli.boundary import run
from psdmc.robot.load import load_robot
from psdmc.robot.reference import reference

N = 6
COULOMB = np.array([6.0, 8.0, 5.0, 1.5, 0.4, 0.3])
VISCOUS = np.array([8.0, 10.0, 6.0, 1.8, 0.4, 0.3])
OFFSET = np.array([0.5, -0.8, 0.3, 0.1, -0.1, 0.05])
NOISE = np.array([0.4, 0.4, 0.3, 0.05, 0.03, 0.03])
"""N m, of the motors after their gears."""
HARMONICS = 6
TOOL = """mass = 2.0
com = [0.12, 0.02, 0.05]
inertia_com = { xx = 0.003, yy = 0.006, zz = 0.005, xy = 0.0, xz = 0.0, yz = 0.0 }
"""


def mixed(**entries: float) -> np.ndarray:
    """C of q_joint = C q_motor: c54 = 0.9 says that the motor of J5 also moves J6."""
    matrix = np.eye(N)
    for name, value in entries.items():
        matrix[int(name[1]), int(name[2])] = value
    return matrix


def recorded(folder: Path, C: np.ndarray, of_motors: bool, seed: int = 1) -> Path:
    """The log of a minute: torques of motors, and positions of motors or of joints; and its log.toml."""
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, 60.0, 0.01)
    rates, starts = rng.uniform(0.5, 5.0, (HARMONICS, N)), rng.uniform(0.0, 6.0, (HARMONICS, N))
    size = np.array([0.14, 0.1, 0.12, 0.25, 0.3, 0.4])
    turning = np.einsum("t,kj->tkj", time, rates) + starts
    q, qd = size * np.sin(turning).sum(axis=1), size * (rates * np.cos(turning)).sum(axis=1)
    qdd = -size * (rates**2 * np.sin(turning)).sum(axis=1)
    robot = load_robot(folder / "arm.toml")
    model = reference(robot).model
    data = model.createData()
    rigid = np.array([pin.rnea(model, data, *state) for state in zip(q, qd, qdd, strict=True)])
    onto_motors = np.linalg.inv(C).T
    speed = qd @ onto_motors
    torque = rigid @ C + np.tanh(speed / 0.03) * COULOMB + VISCOUS * speed + OFFSET
    torque += NOISE * rng.standard_normal(torque.shape)
    logged = q @ onto_motors if of_motors else q
    logged = logged + 2e-6 * rng.standard_normal(q.shape)
    columns = {"time_s": time}
    for k, joint in enumerate(robot.chain.joints):
        columns |= {f"position_rad.{joint.name}": logged[:, k], f"motor_torque_nm.{joint.name}": torque[:, k]}
    write_columns(columns, folder / "run.csv")
    (folder / "log.toml").write_text('[[log]]\nfile = "run.csv"\n', encoding="utf-8")
    return folder / "log.toml"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """With the model of an arm that carries a tool beside the axis of its last joint."""
    text = robot_path("denso_wall").read_text(encoding="utf-8")
    first, last = text.rsplit("[joint.link]\n", 1)
    assert "mass = 0.0" in last
    (tmp_path / "arm.toml").write_text(f"{first}[joint.link]\n{TOOL}", encoding="utf-8")
    typed("derive", tmp_path / "arm.toml", "-o", tmp_path / "arm.npz")
    return tmp_path


def typed(*words: object) -> object:
    """The exit status of a command."""
    with pytest.raises(SystemExit) as ended:
        run([str(word) for word in words])
    return ended.value.code


def calibrated(folder: Path, capsys: pytest.CaptureFixture[str]) -> tuple[object, list[str], dict]:
    """Exit status, console lines and JSON of a calibration."""
    capsys.readouterr()
    words = ("calibrate", folder / "arm.npz", folder / "log.toml", "-o", folder / "out.npz", "--keep")
    status = typed(*words, "--report", folder / "out.html")
    lines = capsys.readouterr().out.splitlines()
    return status, lines, json.loads((folder / "out.json").read_text(encoding="utf-8"))


def r2(numbers: dict, joint: str) -> float:
    return numbers["quality"]["All"][joint]["held_out"]["r2"]


@pytest.mark.parametrize(
    ("entry", "ratio", "of_motors"), [("c54", -1.0, True), ("c54", 0.8, False)]
)
def test_the_proposed_lines_describe_the_wrist(
    folder: Path, capsys: pytest.CaptureFixture[str], entry: str, ratio: float, of_motors: bool
):
    table = recorded(folder, mixed(**{entry: ratio}), of_motors)

    _, lines, before = calibrated(folder, capsys)

    start = lines.index("# proposed for log.toml, not applied:")
    count = 4 if of_motors else 5
    proposed = "\n".join(lines[start : start + count]) + "\n"
    print(*lines, sep="\n")
    found = before["facts"]["proposed_coupling"]
    assert found["toml"] in proposed
    (item,) = found["items"]
    assert (item["motor"], item["joint"]) == ("J5", "J6")
    assert abs(item["ratio"] - ratio) < 3.0 * item["std"]
    table.write_text(table.read_text(encoding="utf-8") + proposed, encoding="utf-8")
    status, lines, after = calibrated(folder, capsys)
    print(*lines, sep="\n")
    for joint in ("J5", "J6"):
        print(joint, r2(before, joint), r2(after, joint))
    for joint in ("J5", "J6"):
        assert r2(before, joint) < 0.9
        assert r2(after, joint) > 0.96
    assert status == 0
    assert "proposed_coupling" not in after["facts"]
