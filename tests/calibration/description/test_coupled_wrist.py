"""A wrist whose motors drive two joints together, by an independent plant: Pinocchio's recursion, friction on the motors,
logged as motor angles in degrees and currents in amperes; calibrated by the command that a user types."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from bundled import bundled_model, bundled_robot, robot_path
from command_line import status

from psdmc.calibration.logs.log_files import write_columns
from psdmc.model.load import load
from psdmc.robot.reference import reference

ROBOT = "denso_wall"
N = 6
C = np.eye(N)
C[4:, 4:] = [[0.5, 0.5], [0.5, -0.5]]
C[4, 3], C[5, 3] = 0.1, -0.2
"""q_joint = C q_motor: a differential that also follows the joint before it."""
GEARS = np.array([120.0, 160.0, 120.0, 100.0, 100.0, 100.0])
CONSTANTS = np.array([0.2, 0.2, 0.15, 0.1, 0.08, 0.08])
SIGNS = np.array([1.0, -1.0, 1.0, 1.0, -1.0, 1.0])
ZEROS = np.array([0.0, 30.0, -45.0, 720.0, 3.5, -11.0])
COULOMB = np.array([6.0, 8.0, 5.0, 1.5, 1.2, 0.9])
VISCOUS = np.array([8.0, 10.0, 6.0, 1.8, 1.4, 1.1])
OFFSET = np.array([0.5, -0.8, 0.3, 0.1, -0.1, 0.05])
NOISE = np.array([0.4, 0.4, 0.3, 0.05, 0.05, 0.05])
"""N m, of the motors after their gears."""
HARMONICS = 6


def log(path: Path, seed: int, seconds: float, noise_seed: int = 0) -> None:
    """A run of the plant, as its drives record it."""
    rng, sensors = np.random.default_rng(seed), np.random.default_rng([seed, noise_seed])
    time = np.arange(0.0, seconds, 0.004)
    rates, starts = rng.uniform(0.5, 5.0, (HARMONICS, N)), rng.uniform(0.0, 6.0, (HARMONICS, N))
    size = np.array([0.14, 0.1, 0.12, 0.25, 0.2, 0.3])
    turning = np.einsum("t,kj->tkj", time, rates) + starts
    q, qd = size * np.sin(turning).sum(axis=1), size * (rates * np.cos(turning)).sum(axis=1)
    qdd = -size * (rates**2 * np.sin(turning)).sum(axis=1)
    model = reference(bundled_robot(ROBOT)).model
    data = model.createData()
    rigid = np.array([pin.rnea(model, data, *state) for state in zip(q, qd, qdd, strict=True)])
    of_motors = np.linalg.inv(C)
    angle, speed = q @ of_motors.T, qd @ of_motors.T
    torque = rigid @ C + np.tanh(speed / 0.03) * (COULOMB + VISCOUS * np.abs(speed)) + OFFSET
    torque += NOISE * sensors.standard_normal(torque.shape)
    angle = angle + 2e-6 * sensors.standard_normal(angle.shape)
    degrees = SIGNS * np.degrees(angle) * GEARS + ZEROS
    amperes = SIGNS * torque / (GEARS * CONSTANTS)
    write_columns(
        {"Time": time}
        | {f"{what}{k}": v[:, k] for k in range(N) for what, v in (("pos", degrees), ("cur", amperes))},
        path,
    )


def description(names: tuple[str, ...]) -> str:
    lines = [
        "[[log]]",
        'file = "fit.csv"',
        "[[log]]",
        'file = "check.csv"',
        'use = "validate"',
        "[time]",
        'column = "Time"',
        "[position]",
        'unit = "deg"',
        "[effort]",
        'unit = "A"',
        "[[coupling]]",
        f"joints = {json.dumps(names[3:])}",
        f"matrix = {C[3:, 3:].tolist()}",
    ]
    for k, name in enumerate(names):
        both = f"sign = {SIGNS[k]:g}, gear_ratio = {GEARS[k]!r}"
        lines += [
            "[[joint]]",
            f"name = {json.dumps(name)}",
            f'position = {{ column = "pos{k}", offset = {float(ZEROS[k])!r}, {both} }}',
            f'effort = {{ column = "cur{k}", torque_constant = {float(CONSTANTS[k])!r}, {both} }}',
        ]
    return "\n".join(lines).replace("np.float64(", "").replace(")", "")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """With the model of a file whose masses are wrong by up to a quarter, two logs and their description."""
    folder = tmp_path_factory.mktemp("wrist")
    log(folder / "fit.csv", 1, 60.0)
    log(folder / "check.csv", 2, 30.0)
    factors = iter([1.2, 0.85, 1.1, 0.8, 1.25, 0.9, 1.15])
    text = robot_path(ROBOT).read_text(encoding="utf-8")
    wrong = re.sub(r"^mass = (\S+)", lambda m: f"mass = {float(m[1]) * next(factors):.6g}", text, flags=re.M)
    assert wrong != text
    (folder / "wrong.toml").write_text(wrong, encoding="utf-8")
    assert status("derive", folder / "wrong.toml", "-o", folder / "wrong.npz") == 0
    (folder / "log.toml").write_text(description(bundled_model(ROBOT).joint_names), encoding="utf-8")
    return folder


def test_a_coupled_wrist_is_recovered(folder: Path, capsys: pytest.CaptureFixture[str]):
    words = (folder / "wrong.npz", folder / "log.toml", "-o", folder / "out.npz")

    assert status("calibrate", *words, "--report", folder / "out.html") == 0

    assert capsys.readouterr().out.splitlines()[0].startswith("verdict: usable")
    truth, found = bundled_model(ROBOT), load(folder / "out.npz")
    assert pytest.approx(truth.B) == found.B
    kept = json.loads((folder / "out.json").read_text(encoding="utf-8"))
    sure = [
        (row["name"], row["value"], row["std"], true)
        for row, true in zip(kept["base_parameters"], truth.known_theta_b(), strict=True)
        if row["identifiable"]
    ]
    friction = {"coulomb": COULOMB, "viscous": VISCOUS, "offset": OFFSET}
    joints = dict(zip(truth.joint_names, range(N), strict=True))
    sure += [
        (
            f"{row['joint']} {row['name']}",
            row["value"],
            row["std"],
            friction[row["name"]][joints[row["joint"]]],
        )
        for row in kept["friction"]
        if row["seen"]
    ]
    assert len(sure) > 35
    off = {name: (value - true) / std for name, value, std, true in sure}
    assert 0.6 < np.sqrt(np.mean(np.square(list(off.values())))) < 1.4
    assert {name: round(x, 2) for name, x in off.items() if abs(x) >= 3.0} == {}
    assert [log.get("use", "fit") for log in kept["facts"]["data"]] == ["fit", "validate"]
    assert status("show", folder / "out.npz") == 0
    shown = capsys.readouterr().out
    assert "log: check.csv, 7,500 rows, 30 s, held out whole" in shown
    assert "friction: of the motors, some of which drive several joints together" in shown
    cells = [
        re.findall(r"<td[^>]*>([^<]*)</td>", row)
        for row in (folder / "out.html").read_text("utf-8").split("<tr>")
    ]
    used = {row[0]: (row[1], row[2], row[4]) for row in cells if len(row) == 5 and row[0].endswith(".csv")}
    assert used == {"fit.csv": ("15,000", "60", "fitted"), "check.csv": ("7,500", "30", "held out whole")}
    for both in kept["quality"]["All"].values():
        assert both["held_out"]["r2"] > 0.99


def refused(capsys: pytest.CaptureFixture[str], *words: object) -> str:
    assert status(*words) == 2
    return capsys.readouterr().err


@pytest.mark.slow
def test_what_has_no_place_for_motors_says_so(folder: Path, capsys: pytest.CaptureFixture[str]):
    assert status("calibrate", folder / "wrong.npz", folder / "log.toml", "-o", folder / "again.npz") == 0

    text = refused(capsys, "emit-c", folder / "again.npz", "-o", folder / "again", "--friction")
    assert "its friction is of motors that drive several joints together" in text
    assert not (folder / "again").exists()
    assert status("export-urdf", folder / "again.npz", "-o", folder / "again.urdf") == 0
    text = capsys.readouterr().out
    assert (
        "not in the files: friction of motors that drive several joints together: joint 'J4', 'J5', 'J6'"
        in text
    )
    damping = re.findall(r'<dynamics damping="([^"]*)"', (folder / "again.urdf").read_text(encoding="utf-8"))
    assert [float(value) > 0.0 for value in damping] == [True, True, True, False, False, False]


def test_a_motor_s_wrong_sign_is_found_by_motor(folder: Path, capsys: pytest.CaptureFixture[str]):
    """The sixth motor's current turned: its own gain is negative, though both joints of the wrist feel it."""
    text = (folder / "log.toml").read_text(encoding="utf-8")
    own = next(line for line in text.splitlines() if 'column = "cur5"' in line)
    (folder / "turned.toml").write_text(
        text.replace(own, own.replace("sign = 1", "sign = -1")), encoding="utf-8"
    )

    assert status("calibrate", folder / "wrong.npz", folder / "turned.toml", "-o", folder / "turned.npz") == 6
    shown = capsys.readouterr().out
    assert "friction would give power instead of taking it: joint J6" in shown
    assert not (folder / "turned.npz").exists()
