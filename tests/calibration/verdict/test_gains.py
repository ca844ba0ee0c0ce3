"""Gains and friction's power against closed forms: the log is made from the file's torque, so both are known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from psdmc.calibration.identify.motor_model import Motors
from psdmc.calibration.logs.low_pass import FilterOptions
from psdmc.calibration.plant.spoiled import noise_only, scaled, turned
from psdmc.calibration.verdict.effort_checks import Gain, friction_powers, joint_gains
from psdmc.calibration.verdict.evidence import Evidence, Motion, evidence_of
from psdmc.calibration.verdict.suspects import unit_suspect


def evidence(arm, log, theta_b=None) -> Evidence:
    model = arm.model if theta_b is None else replace(arm.model, theta_b=theta_b)
    return evidence_of(model, arm.regressor, [Motion(log)], Motors.torques(2), FilterOptions(cutoff=8.0))


def gains(found: Evidence) -> list[Gain]:
    """One per joint of the arm."""
    each = list(joint_gains(found))
    assert len(each) == 2
    return each


def test_a_file_that_is_right_has_a_gain_of_one(arm, log):
    for gain in gains(evidence(arm, log)):
        assert gain.visible
        assert gain.value == pytest.approx(1.0, abs=max(4 * gain.std, 5e-3))
        assert gain.std < 0.02


@pytest.mark.parametrize("factor", [-1.0, 1e-3, 1e3, 0.075])
def test_the_gain_is_what_the_log_was_multiplied_by(arm, log, factor: float):
    for gain in gains(evidence(arm, scaled(log, factor))):
        assert gain.visible
        assert gain.value == pytest.approx(factor, rel=0.05)


def test_a_joint_whose_torque_the_file_hardly_shows_has_no_gain_that_counts(arm, log):
    # the elbow's own parameters a thousandth of what is true, as wrists in many files
    bodies = arm.model.chain.parameters.copy()
    bodies[1] *= 1e-3
    model = replace(arm.model, theta_b=arm.model.B @ bodies.ravel())
    found = evidence_of(model, arm.regressor, [Motion(log)], Motors.torques(2), FilterOptions(cutoff=8.0))

    shoulder, elbow = joint_gains(found)

    assert shoulder.visible
    assert not elbow.visible
    assert abs(elbow.value) > 5.0


def test_noise_has_a_gain_of_none(arm, log):
    for gain in gains(evidence(arm, noise_only(log))):
        assert abs(gain.value) < 0.2


def test_without_parameters_in_the_file_there_is_no_gain(arm, log):
    model = replace(arm.model, theta_b=None)
    found = evidence_of(model, arm.regressor, [Motion(log)], Motors.torques(2), FilterOptions(cutoff=8.0))

    assert all(np.isnan(gain.value) and not gain.visible for gain in gains(found))


def test_friction_takes_the_power_that_the_log_was_given(arm, log):
    found = evidence(arm, log)
    # conftest.smooth_log: Coulomb 1.0 and 0.6 N m, viscous 0.8 and 0.5 N m s/rad
    expected = np.mean(
        np.array([1.0, 0.6]) * np.tanh(found.qd / 0.03) * found.qd + np.array([0.8, 0.5]) * found.qd**2,
        axis=0,
    )

    for power, true in zip(friction_powers(found), expected, strict=True):
        assert power.value == pytest.approx(true, rel=0.02)
        assert power.std < 0.1 * true


def test_friction_gives_power_where_effort_and_motion_disagree(arm, log):
    shoulder, elbow = friction_powers(evidence(arm, turned(log, 1, ["effort"])))

    assert shoulder.value > 0
    assert elbow.value < -10 * elbow.std


@pytest.mark.parametrize(
    ("gains", "words"),
    [
        ([1e-3, 1.4e-3], "kN m"),
        ([900.0, 1100.0], "mN m"),
        ([1 / 36.1, 1 / 24.4], "amperes"),
        ([1.1, 0.8], None),
        ([1e-3, 1.0], None),
        ([-1.0, -1.0], None),
    ],
)
def test_gains_point_to_a_unit(gains: list[float], words: str | None):
    found = unit_suspect([Gain(value, 0.01 * abs(value), True) for value in gains])

    assert (found is None) if words is None else (found is not None and words in found.words)


def test_gains_that_say_nothing_point_to_no_unit():
    assert unit_suspect([Gain(1e-3, 1e-5, False), Gain(1.0, 0.1, True)]) is None
