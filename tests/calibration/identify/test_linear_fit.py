"""One log, one linear fit: the truth, what the log cannot show, and parameters that a real robot could have."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from bundled import bundled_model, bundled_robot
from random_chains import Oracle

from psdmc.calibration.calibrate import CalibrateOptions, calibrate, calibrate_logs
from psdmc.calibration.identify import predictor
from psdmc.calibration.identify.linear_fit import calibrate_linear
from psdmc.calibration.identify.linear_problem import LinearOptions
from psdmc.calibration.identify.physical import nearest_physical
from psdmc.calibration.identify.predictor import ChainRegressor
from psdmc.calibration.logs.filter import SplitOptions
from psdmc.calibration.logs.log import Log
from psdmc.errors import InputError
from psdmc.robot.reference import Reference

HELD = LinearOptions(split=SplitOptions(held_out=0.3, blocks=0))


def fitted(arm, log: Log, options: LinearOptions = HELD):
    return calibrate_linear(arm.model.chain, arm.regressor, arm.model.l, [log], options)


def test_theta_and_friction_come_out(arm, log: Log):
    found = fitted(arm, log)

    assert np.abs(found.theta_b - arm.model.theta_b).max() < 5e-3
    assert np.all(np.abs(found.theta_b - arm.model.theta_b) < 4 * found.std)
    assert found.friction[:, 0] == pytest.approx([1.0, 0.6], abs=0.01)
    assert found.friction[:, 1] == pytest.approx([0.8, 0.5], abs=0.01)


def test_a_joint_at_rest_leaves_its_parameters_unidentifiable(arm, log: Log):
    position = np.array(log.position)
    position[:, 1] = 0.3
    assert log.velocity is not None
    velocity = np.array(log.velocity)
    velocity[:, 1] = 0.0

    found = fitted(arm, replace(log, position=position, velocity=velocity))

    assert not found.identifiable.all()
    assert np.isinf(found.std[~found.identifiable]).all()
    assert any("elbow stand still" in warning for warning in found.warnings)


def test_a_log_too_short_is_refused(arm, log: Log):
    with pytest.raises(InputError, match="too short"):
        fitted(arm, log.between(0.0, 1.0))


def test_a_log_of_zeros_is_refused(arm, log: Log):
    with pytest.raises(InputError, match="zero throughout"):
        fitted(arm, replace(log, effort=np.zeros_like(log.effort)))


def test_a_log_in_degrees_is_refused(arm, log: Log):
    with pytest.raises(InputError, match="degrees"):
        fitted(arm, replace(log, position=np.degrees(log.position), velocity=None))


def test_constant_motion_cannot_show_inertia(arm, log: Log):
    """Slow, steady motion: the inertial columns all but vanish, and nothing confident is said of them."""
    time = log.time
    q = np.stack([0.02 * time, -0.03 * time], axis=1)
    rng = np.random.default_rng(5)
    tau = arm.regressor.regressor(q, np.full_like(q, 0.02), np.zeros_like(q)) @ arm.model.theta_b
    slow = replace(log, position=q, velocity=None, effort=tau + 0.01 * rng.standard_normal(tau.shape))

    found = fitted(arm, slow)

    wrong = np.abs(found.theta_b - arm.model.theta_b) > 5 * found.std
    assert not wrong.any()


def test_currents_need_torque_constants(arm, log: Log):
    current = replace(log, quantity="current")

    with pytest.raises(InputError, match="no torque constants are known"):
        calibrate_logs(arm.unknown, [current], CalibrateOptions(), arm.regressor, None, lambda step: None)
    with pytest.raises(InputError, match=r"no torque constant for joint\(s\) elbow"):
        calibrate_logs(
            arm.unknown, [current], CalibrateOptions(), arm.regressor, {"shoulder": 1.0}, lambda step: None
        )


def test_no_log_at_all_is_refused(arm):
    with pytest.raises(InputError, match="no log"):
        calibrate(arm.unknown, [])


def test_a_physical_fit_has_a_positive_definite_mass_matrix(arm, log: Log):
    pytest.importorskip("cvxpy")
    loud = replace(log, effort=log.effort + 3.0 * np.random.default_rng(8).standard_normal(log.effort.shape))
    options = CalibrateOptions(physical=True, linear=HELD)

    record = calibrate_logs(arm.unknown, [loud], options, arm.regressor, None, lambda step: None)

    assert record.facts["physically_consistent"]
    assert smallest_inertia(arm, record.model.theta_b) > 0


def test_the_nearest_physical_parameters_repair_a_negative_mass_matrix(arm):
    pytest.importorskip("cvxpy")
    impossible = np.array(arm.model.theta_b)
    impossible -= 3.0 * np.abs(impossible)
    assert smallest_inertia(arm, impossible) < 0

    near = nearest_physical(arm.model, impossible, 10.0 * np.eye(arm.model.l))
    sound = nearest_physical(arm.model, np.array(arm.model.theta_b), 10.0 * np.eye(arm.model.l))

    assert smallest_inertia(arm, near.values) > 0
    assert near.distance > 1.0
    assert np.abs(sound.values - arm.model.theta_b).max() < 1e-3


def smallest_inertia(arm, theta_b: np.ndarray) -> float:
    """Smallest eigenvalue of the mass matrix over many poses, columns by unit accelerations."""
    q = np.random.default_rng(0).uniform(-3, 3, (200, 2))
    zero = np.zeros_like(q)
    gravity = arm.regressor.regressor(q, zero, zero) @ theta_b
    columns = [arm.regressor.regressor(q, zero, zero + unit) @ theta_b - gravity for unit in np.eye(2)]
    return float(np.linalg.eigvalsh(np.stack(columns, axis=-1)).min())


def test_the_regressor_in_numpy_is_pinocchios(monkeypatch: pytest.MonkeyPatch) -> None:
    """Also where base parameters make several parameters of bodies, with any factors, and in more states than are filled
    at once; and of one state."""
    model, oracle = bundled_model("lbr7"), Oracle(bundled_robot("lbr7").mechanism)
    rng = np.random.default_rng(5)
    q, qd, qdd = rng.uniform(-1.0, 1.0, (3, 2500, model.n))
    theta_b = np.asarray(model.theta_b)
    mixed = rng.uniform(-1.0, 1.0, (model.l, model.l))
    whole = predictor.expansion(model) @ mixed
    expected = Reference(oracle.model, "tip").inverse_dynamics(q, qd, qdd)

    plain = ChainRegressor(model).regressor(q, qd, qdd)
    monkeypatch.setattr(predictor, "expansion", lambda model: whole)
    found = ChainRegressor(model).regressor(q, qd, qdd)

    scale = np.abs(expected).max()
    np.testing.assert_allclose(plain @ theta_b, expected, atol=1e-12 * scale)
    np.testing.assert_allclose(found @ np.linalg.solve(mixed, theta_b), expected, atol=1e-9 * scale)
    np.testing.assert_allclose(ChainRegressor(model).regressor(q[7], qd[7], qdd[7]), found[7], rtol=1e-13)
