"""`psdmc calibrate` says first whether the result can be used, and writes nothing that cannot."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from bundled import bundled_model, bundled_robot
from command_line import status, typed

from psdmc.calibration.logs.log import Log
from psdmc.calibration.logs.log_files import write_log
from psdmc.model.load import load
from psdmc.model.store import save
from psdmc.robot.reference import reference

ROBOT = "two_link_full"
NOT_USABLE = 6


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A two-link arm's model, a log of it that is good (Pinocchio and friction), and the same negated."""
    made = tmp_path_factory.mktemp("verdict")
    save(bundled_model(ROBOT), made / "arm.npz")
    log = _log()
    write_log(log, made / "good.csv")
    write_log(replace(log, effort=-log.effort), made / "negated.csv")
    return made


def _log() -> Log:
    time = np.arange(3000) / 100.0
    w = 2 * np.pi * np.array([0.2, 0.33])
    slow, fast = w * time[:, None], 2.7 * w * time[:, None] + 1.0
    q = 0.8 * np.sin(slow) + 0.2 * np.sin(fast)
    qd = w * (0.8 * np.cos(slow) + 0.54 * np.cos(fast))
    qdd = -(w**2) * (0.8 * np.sin(slow) + 1.458 * np.sin(fast))
    torque = reference(bundled_robot(ROBOT)).inverse_dynamics(q, qd, qdd)
    noise = 0.02 * np.random.default_rng(1).standard_normal(q.shape)
    effort = torque + 2.0 * np.tanh(qd / 0.03) + 1.5 * qd + noise
    return Log("log", ("shoulder", "elbow"), time, q, qd, effort, "motor_torque")


def test_a_good_log_gives_a_model(folder: Path):
    done = typed("calibrate", "arm.npz", "good.csv", "-o", "good.npz", "--report", "good.html", cwd=folder)

    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[0] == "verdict: usable"
    assert load(folder / "good.npz").calibrated.verdict.usable is True


def test_a_negated_log_gives_a_reason_a_report_and_no_model(folder: Path):
    done = typed("calibrate", "arm.npz", "negated.csv", "-o", "bad.npz", "--report", "bad.html", cwd=folder)

    assert done.returncode == NOT_USABLE
    lines = done.stdout.splitlines()
    assert lines[0] == "verdict: not usable"
    assert any("likely: the effort of every joint has the opposite sign" in line for line in lines)
    assert "bad.npz: not written; add --keep to write it anyway" in lines
    assert not (folder / "bad.npz").exists()
    page = (folder / "bad.html").read_text(encoding="utf-8")
    assert page.index("Verdict: not usable") < page.index("Accuracy on held-out data")
    numbers = json.loads((folder / "bad.json").read_text(encoding="utf-8"))
    assert next(iter(numbers)) == "verdict"
    assert numbers["verdict"]["reasons"]


def test_what_stood_there_before_is_left_alone(folder: Path):
    (folder / "old.npz").write_bytes(b"an earlier calibration")

    assert (
        status("calibrate", folder / "arm.npz", folder / "negated.csv", "-o", folder / "old.npz")
        == NOT_USABLE
    )
    assert (folder / "old.npz").read_bytes() == b"an earlier calibration"


def test_who_insists_gets_the_file_and_the_status_all_the_same(folder: Path):
    words = ("calibrate", folder / "arm.npz", folder / "negated.csv", "-o", folder / "kept.npz", "--keep")

    assert status(*words) == NOT_USABLE
    assert load(folder / "kept.npz").calibrated.verdict.usable is False
