"""One vector, one fit, one prior: sums that the data show only together, joints that rest, friction that is not there.

Every log comes from a known robot; what the file delivers is computed here from the file alone, with Pinocchio.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from psdmc.calibration.calibrate import CalibrateOptions, calibrate_logs
from psdmc.calibration.identify.predictor import ChainRegressor
from psdmc.calibration.logs.log import Log
from psdmc.calibration.verdict.record import Calibration
from psdmc.derivation.derive import derive_model
from psdmc.model.calibrated import by_joint
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.model.load import load
from psdmc.model.parameter_checks import check_mass_matrix
from psdmc.model.store import save
from psdmc.robot.load import load_robot

ROBOTS = Path(__file__).resolve().parents[3] / "examples" / "robots"
RATE = 250.0


def along(model: DynamicsModel, q: np.ndarray, friction: np.ndarray, noise: float = 0.01) -> Log:
    """A log of even samples: torques of the model, of friction (N, n), and a little noise."""
    time = np.arange(len(q)) / RATE
    qd = np.gradient(q, 1.0 / RATE, axis=0)
    qdd = np.gradient(qd, 1.0 / RATE, axis=0)
    tau = model.inverse_dynamics(q, qd, qdd) + friction
    tau = tau + noise * np.random.default_rng(11).standard_normal(tau.shape)
    return Log("log", model.joint_names, time, q, None, tau, "motor_torque")


def calibrated(model: DynamicsModel, log: Log, physical: bool = True) -> Calibration:
    options = CalibrateOptions(physical=physical)
    return calibrate_logs(model, [log], options, ChainRegressor(model), None, lambda step: None)


def predicted(record: Calibration, log: Log, folder: Path) -> np.ndarray:
    """(N, n) torque by the written file: rigid bodies, and friction as the file's rows and its law say."""
    save(record.model, folder / "calibrated.npz")
    file = load(folder / "calibrated.npz")
    kept = file.calibrated
    assert kept is not None
    assert kept.prediction is not None
    value = by_joint(kept.friction)
    qd = np.gradient(log.position, 1.0 / RATE, axis=0)
    tau = file.inverse_dynamics(log.position, qd, np.gradient(qd, 1.0 / RATE, axis=0))
    for k, joint in enumerate(log.joint_names):
        sign = np.tanh(qd[:, k] / kept.prediction.sign_speed)
        tau[:, k] += (
            sign * value[joint, "coulomb"] + qd[:, k] * value[joint, "viscous"] + value[joint, "offset"]
        )
    return tau


def words(record: Calibration) -> dict[str, str]:
    own = {f"{row.name} of {row.joint}": row.visibility for row in record.friction}
    return {row.name: row.visibility for row in record.parameters} | own


def worst_error(record: Calibration, log: Log, folder: Path) -> np.ndarray:
    """(n,) RMS of the file's prediction over the whole log, relative to the torque's RMS."""
    middle = slice(200, -200)
    error = (predicted(record, log, folder) - log.effort)[middle]
    return np.sqrt(np.mean(error**2, axis=0) / np.mean(log.effort[middle] ** 2, axis=0))


@pytest.fixture
def one_way(arm) -> Log:
    """The elbow goes one way only: Coulomb friction and offset cannot be told apart."""
    time = np.arange(int(12 * RATE)) / RATE
    shoulder = 0.9 * np.sin(2 * np.pi * 0.31 * time)
    elbow = -2.0 + 0.33 * time + 0.03 * np.sin(2 * np.pi * 0.8 * time)
    q = np.stack([shoulder, elbow], axis=1)
    qd = np.gradient(q, 1.0 / RATE, axis=0)
    friction = np.tanh(qd / 0.03) * [1.0, 3.0] + qd * [0.8, 0.5] + [0.2, 1.5]
    assert qd[:, 1].min() > 0.15
    return along(arm.model, q, friction)


@pytest.mark.parametrize("physical", [True, False])
@pytest.mark.parametrize("known", [True, False])
def test_a_joint_that_never_reverses_shows_coulomb_and_offset_only_together(
    arm, one_way: Log, tmp_path: Path, known: bool, physical: bool
):
    model = arm.model if known else arm.unknown

    record = calibrated(model, one_way, physical)

    assert worst_error(record, one_way, tmp_path).max() < 0.02
    told = words(record)
    assert told["coulomb of elbow"].startswith("only in combination with")
    assert "offset of elbow" in told["coulomb of elbow"]
    assert told["coulomb of shoulder"] == "identified"
    value = {(row.joint, row.name): row.value for row in record.friction}
    assert value["elbow", "coulomb"] + value["elbow", "offset"] == pytest.approx(4.5, abs=0.1)
    (warning,) = [text for text in record.warnings if "only in combination" in text]
    assert "coulomb of elbow (with offset of elbow" in warning


@pytest.fixture(scope="module")
def scara() -> DynamicsModel:
    return derive_model(load_robot(ROBOTS / "scara.toml").chain)


@pytest.mark.parametrize("known", [True, False])
def test_a_weight_and_an_offset_show_only_together(scara: DynamicsModel, tmp_path: Path, known: bool):
    """The slider creeps: its mass weighs, but is never felt by acceleration."""
    time = np.arange(int(20 * RATE)) / RATE
    phase = 2 * np.pi * time
    q = np.stack(
        [
            0.8 * np.sin(0.3 * phase),
            0.7 * np.sin(0.4 * phase),
            0.15 + 0.05 * np.sin(0.05 * phase),
            np.sin(0.5 * phase),
        ],
        axis=1,
    )
    qd = np.gradient(q, 1.0 / RATE, axis=0)
    friction = np.tanh(qd / 0.03) * [2.0, 1.0, 0.0, 0.1] + qd * 0.5 + [0.0, 0.0, 7.0, 0.0]
    log = along(scara, q, friction, noise=0.02)
    model = scara if known else replace(scara, theta_b=None)

    record = calibrated(model, log)

    assert worst_error(record, log, tmp_path).max() < 0.03
    told = words(record)
    assert told["offset of J3"].startswith("only in combination with theta_")
    J3 = {row.name: row.value for row in record.friction if row.joint == "J3"}
    if known:
        weight = np.abs(record.model.gravity(np.zeros(4))[2] + J3["offset"])
        truth = np.abs(scara.gravity(np.zeros(4))[2] + 7.0)
        assert weight == pytest.approx(truth, rel=0.01)


def test_what_is_printed_is_what_the_file_delivers(arm, one_way: Log, tmp_path: Path):
    record = calibrated(arm.model, one_way)

    tau = predicted(record, one_way, tmp_path)

    for k, (name, both) in enumerate(record.steps[0].joints.items()):
        rows = slice(int(0.72 * len(tau)), -300)
        error, measured = (tau - one_way.effort)[rows, k], one_way.effort[rows, k]
        assert both.held_out.r2 == pytest.approx(1 - np.mean(error**2) / np.var(measured), abs=0.02), name


@pytest.mark.parametrize("known", [True, False])
@pytest.mark.parametrize("kind", ["normal", "two steps", "wandering"])
def test_a_joint_at_rest_that_ripples_shows_nothing_of_itself(arm, tmp_path: Path, kind: str, known: bool):
    """2e-4 rad of encoder noise on a resting elbow; the shoulder moves."""
    rng = np.random.default_rng(2)
    count = int(20 * RATE)
    time = np.arange(count) / RATE
    still = np.stack([0.9 * np.sin(2 * np.pi * 0.31 * time), np.full(count, 0.3)], axis=1)
    qd = np.gradient(still, 1.0 / RATE, axis=0)
    friction = np.tanh(qd / 0.03) * [1.0, 0.0] + qd * [0.8, 0.0]
    log = along(arm.model, still, friction)
    ripple = {
        "normal": 2e-4 * rng.standard_normal(count),
        "two steps": 2e-4 * np.round(rng.uniform(size=count)),
        "wandering": 2e-4 * np.repeat(np.round(rng.uniform(size=count // 25)), 25),
    }[kind]
    rippled = replace(log, position=still + np.stack([np.zeros(count), ripple], axis=1))
    model = arm.model if known else arm.unknown

    record = calibrated(model, rippled, physical=False)

    assert worst_error(record, log, tmp_path).max() < 0.02
    told = words(record)
    assert told["coulomb of elbow"] == "not visible: kept at zero"
    assert told["viscous of elbow"] == "not visible: kept at zero"
    assert arm.model.theta_b is not None
    values = np.array([row.value for row in record.parameters])
    assert np.abs(values).max() < 3 * np.abs(arm.model.theta_b).max()
    alone = np.array([row.identifiable for row in record.parameters])
    std = np.array([row.std for row in record.parameters])
    assert np.all(np.abs(values - arm.model.theta_b)[alone] < 5 * std[alone])
    assert any("ripple by no more than sensor noise" in text for text in record.warnings)


def test_a_joint_that_hardly_moves_is_judged_by_its_noise(arm):
    """The elbow trembles by as much again as its sensor's noise: too little for its inertia, and said."""
    rng = np.random.default_rng(2)
    time = np.arange(int(20 * RATE)) / RATE
    q = np.stack([0.9 * np.sin(2 * np.pi * 0.31 * time), 0.3 + 1e-3 * np.sin(2 * np.pi * 0.5 * time)], axis=1)
    log = along(arm.model, q, np.zeros_like(q))
    noisy = replace(log, position=log.position + [0.0, 5e-4] * rng.standard_normal(q.shape))

    record = calibrated(arm.unknown, noisy, physical=False)

    values = np.array([row.value for row in record.parameters])
    std = np.array([row.std for row in record.parameters])
    known = np.array([row.identifiable for row in record.parameters])
    assert np.all(np.abs(values - arm.model.theta_b)[known] < 5 * std[known])
    assert not known.all()


def test_friction_is_never_negative_however_the_log_has_it(arm, tmp_path: Path):
    """Torques that already have friction taken out, and too much of it."""
    time = np.arange(int(16 * RATE)) / RATE
    q = np.stack([0.9 * np.sin(2 * np.pi * 0.31 * time), 0.8 * np.sin(2 * np.pi * 0.47 * time + 0.4)], axis=1)
    qd = np.gradient(q, 1.0 / RATE, axis=0)
    log = along(arm.model, q, -0.2 * np.tanh(qd / 0.03) - 0.05 * qd, noise=0.05)

    bare, record = calibrated(arm.model, log, physical=False), calibrated(arm.model, log)

    assert min(row.value for row in bare.friction if row.name == "coulomb") < -0.1
    assert all(row.value >= 0 for row in record.friction if row.name != "offset")
    mass = check_mass_matrix(load_after(record, tmp_path))
    assert mass is not None
    assert mass.passed
    assert record.facts["physical_cost_r2"]["elbow"] > 0
    (note,) = [text for text in record.notes if "physical consistency moved" in text]
    assert "elbow -" in note


def load_after(record: Calibration, folder: Path) -> DynamicsModel:
    save(record.model, folder / "m.npz")
    return load(folder / "m.npz")
