"""A description that does not fit its logs, or the model, is refused in one line that begins with its name."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from psdmc.calibration.description.description import read_description
from psdmc.calibration.description.read_described import described_logs
from psdmc.errors import InputError

NAMES = ("a", "b")
HEAD = '[[log]]\nfile = "run.csv"\n[time]\ncolumn = "t"\n'
JOINTS = '[[joint]]\nname = "a"\nposition = "q1"\neffort = "i1"\n[[joint]]\nname = "b"\nposition = "q2"\neffort = "i2"\n'

FAULTS = {
    JOINTS.replace(
        '"q2"', '"q3"'
    ): "joint 'b': position: no column 'q3' in {folder}/run.csv, which has 't', 'q1'",
    JOINTS.replace('"q2"', "9"): "joint 'b': position: column 9, but {folder}/run.csv has 6",
    JOINTS.replace(
        '"q2"', "0"
    ): "joint 2 ('b'): position: found 0, expected a column's name, its number from 1",
    JOINTS.replace(
        '"q2"', "true"
    ): "joint 2 ('b'): position: found true, expected a column's name, its number",
    JOINTS.replace('"b"', '"c"'): "joint: name: found 'c', expected joints of the model: 'a', 'b'",
    JOINTS.replace('"b"', '"a"'): "joint: name 'a' twice, expected one [[joint]] for each",
    JOINTS.replace('"q2"', '"mode"'): "line 2, column 'mode': 'run' is no number",
    JOINTS.split('[[joint]]\nname = "b"')[
        0
    ]: "joint 'b': no column for its position, expected 'position_rad.b'",
    JOINTS
    + "[position]\nunit = 'degrees'": "position: unit: found 'degrees', expected one of rad, deg, rev, ticks",
    JOINTS + "[position]\nunit = 'ticks'": "joint 'a': position: unit 'ticks' without ticks_per_rev",
    JOINTS + "[position]\nticks_per_rev = 4096": "ticks_per_rev, but its unit is SI, expected ticks",
    JOINTS + "[position]\nsign = 0": "position: sign: found 0, expected 1 or -1",
    JOINTS + "[position]\nscale = 0": "position: scale: found 0, expected another number",
    JOINTS
    + "[position]\ntorque_constant = 1": "position: unknown key(s) 'torque_constant', known are unit, scale",
    JOINTS
    + "[effort]\ntorque_constant = 1": "joint 'a': effort: torque_constant, but its unit is SI, expected A or mA",
    JOINTS
    + "[effort]\nunit = 'A'\ngear_ratio = 3": "effort: gear_ratio without torque_constant for joint(s) 'a', 'b'",
    JOINTS.replace(
        '"i2"', "{ column = 'i2', unit = 'A' }"
    ): "torque_constant missing for joint(s) 'b': other joints",
    JOINTS.replace('"i2"', "{ column = 'i2', unit = 'N' }").replace(
        '"q2"', "{ column = 'q2', unit = 'rad' }"
    ): "joint b: its position is of a turning one, its effort is of a sliding one, expected units of one kind",
    JOINTS.replace(
        '"i2"', "{ column = 'i2', quantity = 'joint_torque' }"
    ): "joints hold 'a' motor_torque, 'b' joint_",
    JOINTS.replace(
        '"q2"', "{ column = 'q2', table = 'x' }"
    ): "joint 'b': position: table 'x', but its log is one file: expected none",
    JOINTS
    + "[csv]\nseparator = 'bar'": "csv: separator: found 'bar', expected one of comma, semicolon, tab, space",
    JOINTS + "[csv]\nskip = 99": "run.csv: holds no table",
    JOINTS
    + "[[coupling]]\njoints = ['a', 'b']\nmatrix = [[1, 1], [1, 1]]": "coupling 1: matrix: has no inverse",
    JOINTS
    + "[[coupling]]\njoints = ['a', 'c']\nmatrix = [[1, 0], [1, 1]]": "coupling 1: name: found 'c', expected",
    JOINTS
    + "[[coupling]]\njoints = ['a', 'b']\nmatrix = [[1, 0]]": "coupling 1: matrix: found a list of 1, expected 2 ro",
    JOINTS
    + "[[coupling]]\njoints = ['a', 'b']\nmatrix = [[1, 0], [0, 1]]\nquantities = ['x']": "quantities: found 'x'",
    JOINTS.replace('"i1"', "{ column = 'i1', unit = 'A', torque_constant = 1 }").replace(
        '"i2"', "{ column = 'i2', quantity = 'joint_torque' }"
    ): "effort: 'a' current, 'b' joint_torque: currents make motor torques, expected one quantity",
    JOINTS
    + "[effort]\nunit = 'A'\nquantity = 'joint_torque'": "quantity 'joint_torque' of joint(s) 'a', 'b', whose unit is A",
    JOINTS + "[csv]\nskip = 1.5": "csv: skip: found 1.5, expected a whole number from 0 to 10000",
    JOINTS + "[fit]\nblocks = 2.5": "fit: blocks: found 2.5, expected a whole number from 0 to 1000",
    "[[joint]]\nname = 'a'\nlogged_as = 'x'": "joint 'a': no column for its position, expected 'position_rad.x', or",
}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    rng = np.random.default_rng(1)
    rows = [f"{0.01 * k},{','.join(f'{x:.3f}' for x in rng.normal(size=4))},run" for k in range(20)]
    (tmp_path / "run.csv").write_text("t,q1,q2,i1,i2,mode\n" + "\n".join(rows), encoding="utf-8")
    return tmp_path


@pytest.mark.parametrize("text", FAULTS, ids=[text[:30] for text in FAULTS.values()])
def test_what_does_not_fit_is_named(folder: Path, text: str):
    path = folder / "log.toml"
    path.write_text(HEAD + text, encoding="utf-8")

    with pytest.raises(InputError) as raised:
        described_logs(read_description(path, NAMES), NAMES)

    message = raised.value.message
    assert message.startswith(f"{path}: ")
    assert FAULTS[text].format(folder=folder) in message
    assert "\n" not in message
    assert raised.value.hint


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ('[[log]]\nfile = "none.csv"\n', "none.csv: no such file"),
        ('[[log]]\nfile = "run.xls"\n', "run.xls: '.xls' is no log format"),
        (
            '[[log]]\nfile = "run.csv"\nstart = 5\n' + HEAD[24:] + JOINTS,
            "no rows from 5 to inf s, it lasts 0.19 s",
        ),
        (
            '[[log]]\nfile = "run.csv"\ntopic = "/arm"\n' + HEAD[24:] + JOINTS,
            "run.csv: topic '/arm', but it is no bag",
        ),
        ('[[log]]\nfile = "run.csv"\n' + JOINTS, "time: no column 'time_s' in"),
        (
            '[[log]]\ntables = { x = "run.csv", y = "run.csv" }\n' + HEAD[24:] + JOINTS,
            "column 'q1' stands 2 times in",
        ),
        ("[[log]]\ntables = 3\n" + JOINTS, "log 1: tables: found 3, expected NAME = FILE"),
    ],
)
def test_a_log_that_is_not_what_is_said(folder: Path, text: str, fault: str):
    path = folder / "log.toml"
    path.write_text(text, encoding="utf-8")

    with pytest.raises(InputError) as raised:
        described_logs(read_description(path, NAMES), NAMES)

    assert raised.value.message.startswith(f"{path}: ")
    assert fault in raised.value.message


def test_a_joint_of_another_unit_does_not_have_the_others_ticks_and_torque_constant(folder: Path):
    """What [position] and [effort] say of ticks and of motors holds for joints in ticks and amperes."""
    path = folder / "log.toml"
    odd = JOINTS.replace('"q2"', "{ column = 'q2', unit = 'deg' }").replace(
        '"i2"', "{ column = 'i2', unit = 'Nm' }"
    )
    usual = "[position]\nunit = 'ticks'\nticks_per_rev = 4096\n[effort]\nunit = 'A'\ntorque_constant = 0.3\n"
    path.write_text(HEAD + usual + odd, encoding="utf-8")
    table = np.loadtxt(folder / "run.csv", delimiter=",", skiprows=1, usecols=range(5))

    (log,) = described_logs(read_description(path, NAMES), NAMES)

    turns = table[:, 1:3] * [2.0 * np.pi / 4096, np.pi / 180.0]
    assert np.abs(log.rows(0, 20).position - turns).max() < 1e-12
    assert np.abs(log.rows(0, 20).effort - table[:, 3:] * [0.3, 1.0]).max() < 1e-12
    assert log.quantity == "motor_torque"
