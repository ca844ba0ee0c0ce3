"""Verdicts on a real UR10's log, where it is at hand: good as it is, not when cut, negated, scaled or swapped."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from shared_data import UR10_LOG
from slow_cases import slow_but_for

from psdmc.calibration.calibrate import CalibrateOptions, calibrate_logs
from psdmc.calibration.identify.predictor import ChainRegressor
from psdmc.calibration.logs.log import Log
from psdmc.calibration.logs.log_files import read_log
from psdmc.calibration.plant.spoiled import ALL, MOVED, noise_only, scaled, swapped, turned
from psdmc.derivation.derive import derive_model
from psdmc.model.calibrated import Verdict
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.robot.load import load_robot

pytestmark = pytest.mark.skipif(not UR10_LOG.exists(), reason="the UR10 log is not part of the project")

GAINS = np.array([13.58, 14.30, 11.37, 11.24, 11.77, 11.77])
"""N m/A, as the log's publishers state them."""
LIFT, ELBOW, WRIST_2, WRIST_3 = 1, 2, 4, 5

WRONG = {
    "negated": (lambda log: scaled(log, -1.0), "the effort of every joint has the opposite sign"),
    "kN m": (lambda log: scaled(log, 1e-3), "kN m"),
    "amperes": (lambda log: scaled(log, 1.0 / GAINS), "amperes in an effort column"),
    "lift's effort turned": (
        lambda log: turned(log, LIFT, ["effort"]),
        "effort of shoulder_lift_joint has the opposite sign",
    ),
    "last effort turned": (
        lambda log: turned(log, WRIST_3, ["effort"]),
        "effort of wrist_3_joint has the opposite sign",
    ),
    "lift's position turned": (
        lambda log: turned(log, LIFT, MOVED),
        "position of shoulder_lift_joint has the opposite sign",
    ),
    "efforts swapped": (
        lambda log: swapped(log, LIFT, ELBOW, ["effort"]),
        "shoulder_lift_joint and elbow_joint look swapped (effort)",
    ),
    "wrist's efforts swapped": (
        lambda log: swapped(log, WRIST_2, WRIST_3, ["effort"]),
        "wrist_2_joint and wrist_3_joint look swapped (effort)",
    ),
    "joints swapped": (
        lambda log: swapped(log, LIFT, ELBOW, ALL),
        "shoulder_lift_joint and elbow_joint look swapped (position and effort)",
    ),
}
QUICK = ["negated", "amperes", "lift's effort turned", "lift's position turned", "joints swapped"]
"""Of every way to be wrong one; the others are further joints, a further factor, and efforts alone."""


@pytest.fixture(scope="module")
def model() -> DynamicsModel:
    folder = pytest.importorskip("cmeel").__path__[0]
    found = sorted((Path(folder).parent / "cmeel.prefix").rglob("ur10_robot.urdf"))
    if not found:
        pytest.skip("example-robot-data is not installed")
    return derive_model(load_robot(found[0], drive_inertia=True).chain, expand=False)


@pytest.fixture(scope="module")
def log(model: DynamicsModel) -> Log:
    return read_log(UR10_LOG / "exciting_trajectory.csv").ordered(model.joint_names)


def verdict_on(model: DynamicsModel, log: Log) -> Verdict:
    record = calibrate_logs(model, [log], CalibrateOptions(), ChainRegressor(model), None, lambda step: None)
    assert record.verdict is not None
    return record.verdict


def test_the_log_as_it_is_can_be_used(model, log):
    found = verdict_on(model, log)

    assert found.usable
    assert found.suspects == ()
    visible = [joint.joint for joint in found.joints if joint.visible]
    assert visible == ["shoulder_pan_joint", "shoulder_lift_joint", "elbow_joint"]


@pytest.mark.parametrize("kind", slow_but_for(QUICK, WRONG))
def test_a_wrong_log_cannot_and_the_cause_is_named(model, log, kind: str):
    spoil, words = WRONG[kind]

    found = verdict_on(model, spoil(log))

    assert found.word == "not usable"
    assert any(words in suspect for suspect in found.suspects)


@pytest.mark.parametrize("seconds", slow_but_for([3.0], [3.0, 5.0]))
def test_a_piece_of_it_has_too_few_samples(model, log, seconds: float):
    found = verdict_on(model, log.between(0.0, seconds))

    assert not found.usable
    assert "independent samples for" in found.reasons[0]


def test_noise_cannot(model, log):
    assert not verdict_on(model, noise_only(log)).usable
