"""`psdmc calibrate --describe` drafts a description that reads the log as it is meant, and never replaces a file."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from bundled import bundled_model
from command_line import status
from shared_data import UR10_LOG

from psdmc.calibration.description.description import read_description
from psdmc.calibration.description.draft import drafted
from psdmc.calibration.description.read_described import described_logs
from psdmc.calibration.logs.log import Log
from psdmc.calibration.logs.log_files import write_columns
from psdmc.errors import InputError

TIME = np.arange(0.0, 4.0, 0.01)
N = 6
Q = 0.9 * np.sin(np.outer(TIME, np.arange(1, N + 1))) + 0.1 * np.arange(N)
QD = np.gradient(Q, TIME, axis=0)
TAU = 3.0 * Q + QD


def columns(time: str, *groups: tuple[str, np.ndarray]) -> dict[str, np.ndarray]:
    return {time: TIME} | {pattern.format(k): v[:, k - 1] for pattern, v in groups for k in range(1, N + 1)}


def drafted_log(folder: Path, file: str) -> Log:
    """The log as the draft for KR6's joints reads it."""
    names = bundled_model("kr6").joint_names
    draft = drafted([folder / file], folder / "log.toml", names)
    assert draft.missing == ()
    (folder / "log.toml").write_text(draft.text, encoding="utf-8")
    (log,) = described_logs(read_description(folder / "log.toml", names), names)
    assert isinstance(log, Log)
    return log


@pytest.mark.parametrize(
    "groups",
    [
        (("q{}", Q), ("qd{}", QD), ("tau{}", TAU)),
        (("actual_q_{}", Q), ("target_q_{}", 9 * Q), ("actual_qd_{}", QD), ("actual_torque_{}", TAU)),
        (("Position of joint {} [rad]", Q), ("Velocity of joint {} [rad/s]", QD), ("Torque {} [Nm]", TAU)),
        (("joint_{}/pos", Q), ("joint_{}/vel", QD), ("joint_{}/effort", TAU)),
        (
            ("jointPos{}", np.degrees(Q)),
            ("jointVel{}", np.degrees(QD)),
            ("jointTrq{}_mNm", 1000 * TAU),
        ),
        (("q{}_deg", np.degrees(Q)), ("n{}_rpm", QD * 30 / np.pi), ("tau{}", TAU)),
    ],
    ids=["plain", "targets", "spelled", "by name", "degrees", "rpm"],
)
def test_named_columns_are_recognised(tmp_path: Path, groups):
    write_columns(columns("time", *groups), tmp_path / "log.csv")

    log = drafted_log(tmp_path, "log.csv")

    assert np.abs(log.position - Q).max() < 1e-12
    assert log.velocity is not None or "rpm" in str(groups)
    if log.velocity is not None:
        assert np.abs(log.velocity - QD).max() < 1e-12
    assert np.abs(log.effort - TAU).max() < 1e-12
    assert np.array_equal(log.time, TIME)


MOTOR = Q + 0.003 * np.cos(Q)
"""Positions of motors, divided by the gear ratio: they differ by what an elastic gear bends."""


@pytest.mark.parametrize(
    "groups",
    [
        (("motor_q{}", MOTOR), ("motor_qd{}", 9 * QD), ("link_q{}", Q), ("link_qd{}", QD)),
        (("q{}", Q), ("qd{}", QD), ("q_motor_{}", MOTOR)),
        (("q{}", MOTOR), ("qd{}", 9 * QD), ("load_q{}", Q), ("load_qd{}", QD)),
        (("motor{}Pos_deg", -np.degrees(50.0 * MOTOR)), ("output{}Pos_rad", Q), ("output{}Vel", QD)),
    ],
    ids=["both named", "motor named", "link named", "own turns"],
)
def test_positions_of_motor_and_link_are_told_apart(tmp_path: Path, groups):
    write_columns(
        columns("time", *groups, ("motor_torque{}", TAU), ("load{}", 9 * TAU)), tmp_path / "log.csv"
    )

    log = drafted_log(tmp_path, "log.csv")

    assert np.abs(log.position - Q).max() < 1e-12
    assert log.motor_position is not None
    assert np.abs(log.motor_position - MOTOR).max() < 1e-12
    assert log.velocity is not None
    assert np.abs(log.velocity - QD).max() < 1e-12
    assert np.abs(log.effort - TAU).max() < 1e-12


def test_one_encoder_is_the_position_whatever_its_name(tmp_path: Path):
    write_columns(columns("time", ("motor_q{}", Q), ("load_{}", TAU)), tmp_path / "log.csv")

    log = drafted_log(tmp_path, "log.csv")

    assert log.motor_position is None
    assert np.abs(log.position - Q).max() < 1e-12
    assert np.abs(log.effort - TAU).max() < 1e-12


def test_columns_without_names_are_taken_in_order(tmp_path: Path):
    np.savetxt(tmp_path / "bare.csv", np.column_stack([1000 * TIME, Q, QD, TAU]), "%.17g", ",")

    log = drafted_log(tmp_path, "bare.csv")

    assert np.abs(log.time - TIME).max() < 1e-12
    assert np.array_equal(log.position, Q)
    assert np.array_equal(log.effort, TAU)


def test_what_was_not_found_is_named_and_the_draft_asks_for_it(tmp_path: Path):
    found = columns("t", ("q{}", Q), ("tau{}", TAU))
    del found["tau3"]
    write_columns(found, tmp_path / "log.csv")
    names = bundled_model("kr6").joint_names

    draft = drafted([tmp_path / "log.csv"], tmp_path / "log.toml", names)

    assert draft.missing == ("effort of 'joint_3'",)
    (tmp_path / "log.toml").write_text(draft.text, encoding="utf-8")
    with pytest.raises(
        InputError, match=r"log\.toml: joint 'joint_3': effort: no column '\?' in .*log\.csv, which has"
    ):
        described_logs(read_description(tmp_path / "log.toml", names), names)


def test_hostile_names_stay_in_their_strings(tmp_path: Path):
    names = ('j"\n[fit]', "gelenk_ä", "a\\", "x" * 250)
    wild = {"time": TIME} | {f"position.{name}": Q[:, k] for k, name in enumerate(names)}
    wild |= {f"effort.{name}": TAU[:, k] for k, name in enumerate(names)}
    np.savez(tmp_path / "log.npz", **wild)

    draft = drafted([tmp_path / "log.npz"], tmp_path / "log.toml", names)

    (tmp_path / "log.toml").write_text(draft.text, encoding="utf-8")
    assert "[fit]" not in draft.text.splitlines()
    assert max(map(len, draft.text.splitlines())) < 500
    with pytest.raises(InputError, match="name: found 'j"):
        read_description(tmp_path / "log.toml", names)


def typed(capsys: pytest.CaptureFixture[str], *words: object) -> tuple[object, str]:
    code = status(*words)
    shown = capsys.readouterr()
    return code, shown.out + shown.err


def test_the_command_drafts_once_and_says_what_to_type_next(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
):
    write_columns(columns("time", ("q{}", Q), ("tau{}", TAU)), tmp_path / "run.csv")
    bundled_model("kr6").save(tmp_path / "kr6.npz")
    monkeypatch.chdir(tmp_path)

    code, text = typed(capsys, "calibrate", "--describe", "kr6.npz", "run.csv")

    assert code == 0
    assert "log.toml: log description drafted" in text
    assert "next: psdmc calibrate kr6.npz log.toml -o kr6_calibrated.npz" in text
    before = (tmp_path / "log.toml").read_bytes()
    code, text = typed(capsys, "calibrate", "--describe", "run.csv")
    assert code == 2
    assert "log.toml: exists already, and is left as it is" in text
    assert (tmp_path / "log.toml").read_bytes() == before
    code, text = typed(capsys, "calibrate", "--describe", "kr6.npz", "-o", "other.toml")
    assert code == 2
    assert "kr6.npz: a model, and no log to describe" in text
    code, text = typed(capsys, "calibrate", "kr6.npz", "run.csv")
    assert code == 2
    assert "no -o MODEL.npz" in text


@pytest.mark.skipif(not UR10_LOG.exists(), reason="the UR10 log is not part of the project")
def test_a_bag_s_draft_reads_what_the_bag_holds(tmp_path: Path):
    from psdmc.calibration.logs.log_files import read_log

    bag = UR10_LOG / "exciting_trajectory.db3"
    plain = read_log(bag)
    draft = drafted([bag], tmp_path / "log.toml", plain.joint_names)
    (tmp_path / "log.toml").write_text(draft.text, encoding="utf-8")

    (log,) = described_logs(read_description(tmp_path / "log.toml", plain.joint_names), plain.joint_names)

    assert np.array_equal(log.time, plain.time)
    assert np.array_equal(log.position, plain.position)
    assert np.array_equal(log.effort, plain.effort)
