"""Torque constants: for currents only, positive, and for joints that there are."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from psdmc.calibration.calibrate import CalibrateOptions, calibrate_logs
from psdmc.calibration.identify.estimate import Estimate, FitOptions
from psdmc.calibration.identify.four_steps import Runs, calibrate_four_steps
from psdmc.calibration.identify.linear_fit import calibrate_linear
from psdmc.calibration.identify.linear_problem import LinearOptions
from psdmc.calibration.identify.motor_model import Motors
from psdmc.calibration.identify.steps import FrictionRun, GravityRun, InertialRun
from psdmc.calibration.logs.log import Log
from psdmc.errors import InputError

GIVEN = {"shoulder": 2.0, "elbow": 3.0}


def refused(arm, logs: list[Log], constants: dict[str, float] | None) -> str:
    with pytest.raises(InputError) as raised:
        calibrate_logs(arm.unknown, logs, CalibrateOptions(), arm.regressor, constants, lambda step: None)
    return raised.value.message


@pytest.mark.parametrize("quantity", ["motor_torque", "joint_torque"])
def test_they_are_refused_for_logs_that_hold_torques(arm, log: Log, quantity: str):
    text = refused(arm, [replace(log, quantity=quantity)], GIVEN)

    assert text == f"smooth: holds {quantity}, which torque constants are not for"


@pytest.mark.parametrize("value", [0.0, -2.0, np.nan, np.inf, 1e300])
def test_a_constant_that_is_no_positive_number_is_refused(arm, log: Log, value: float):
    currents = replace(log, quantity="current")

    text = refused(arm, [currents], GIVEN | {"elbow": value})

    assert f"torque constants: joint elbow: {value:g}: expected positive numbers" in text


def test_a_constant_for_no_joint_is_refused(arm, log: Log):
    text = refused(arm, [replace(log, quantity="current")], GIVEN | {"wrist": 1.0})

    assert "torque constants: no joint(s) 'wrist'" in text


def test_a_joint_without_one_is_named(arm, log: Log):
    assert "no torque constant for joint(s) elbow" in refused(
        arm, [replace(log, quantity="current")], {"shoulder": 2.0}
    )


@pytest.mark.parametrize("constants", [GIVEN, None])
def test_logs_of_different_quantities_are_refused_by_name(arm, log: Log, constants: dict[str, float] | None):
    currents = replace(log, name="amperes.csv", quantity="current", effort=log.effort / [2.0, 3.0])

    text = refused(arm, [currents, log], constants)

    assert text == "the logs hold different things: current in amperes.csv; motor_torque in smooth"


def test_currents_with_constants_give_what_torques_give(arm, log: Log):
    currents = replace(log, quantity="current", effort=log.effort / [2.0, 3.0])

    found = [
        calibrate_logs(arm.unknown, [data], CalibrateOptions(), arm.regressor, given, lambda step: None)
        for data, given in ((currents, GIVEN), (log, None))
    ]

    one, other = (record.model.theta_b for record in found)
    assert one == pytest.approx(other, rel=1e-6)  # the convex solver stops at about 1e-9


def test_uncertain_constants_make_base_parameters_and_friction_uncertain(arm, log: Log):
    """By as much as the fit's values change with each constant."""
    step, share = 0.01, 0.05
    plain = LinearOptions(fit=FitOptions(method="ols"))  # linear in the torque

    def fitted(constants: np.ndarray, relative: float = 0.0) -> Estimate:
        motors = Motors(constants, np.full(2, relative))
        return calibrate_linear(arm.model.chain, arm.regressor, arm.model.l, [log], plain, motors).estimate

    exact, vague = fitted(np.ones(2)), fitted(np.ones(2), share)

    changes = [(fitted(1.0 + step * own).values - exact.values) / step for own in np.eye(2)]
    expected = np.sqrt(exact.std**2 + sum((share * change) ** 2 for change in changes))
    assert vague.values == pytest.approx(exact.values, rel=1e-9)
    assert vague.std == pytest.approx(expected, rel=0.05)
    assert np.median(vague.std / exact.std) > 10


def runs_of(log: Log) -> Runs:
    friction = [FrictionRun(joint, log) for joint in log.joint_names]
    return Runs(motor=[], gravity=[GravityRun(log)], friction=friction, inertial=[InertialRun(log)])


@pytest.mark.parametrize(
    ("quantity", "constants", "message"),
    [
        ("motor_torque", GIVEN, "smooth: holds motor_torque, which torque constants are not for"),
        ("current", GIVEN | {"elbow": 0.0}, "torque constants: joint elbow: 0"),
        ("current", GIVEN | {"wrist": 1.0}, "torque constants: no joint(s) 'wrist'"),
    ],
)
def test_campaigns_refuse_the_same(arm, log: Log, quantity: str, constants: dict[str, float], message: str):
    runs = runs_of(replace(log, quantity=quantity))

    with pytest.raises(InputError, match=re.escape(message)):
        calibrate_four_steps(arm.model.chain, arm.regressor, arm.model.l, runs, torque_constants=constants)
