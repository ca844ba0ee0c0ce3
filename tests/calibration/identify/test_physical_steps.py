"""Physical consistency of the four steps: theta_b and friction move together, and nothing unphysical is delivered."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from psdmc.calibration.calibrate import CalibrateOptions, calibrate_campaign
from psdmc.calibration.campaign_file import read_campaign
from psdmc.calibration.identify.four_steps import Runs, calibrate_four_steps
from psdmc.calibration.identify.state_friction import PARAMETERS
from psdmc.calibration.identify.steps import CalibrationOptions
from psdmc.calibration.logs.log import Log
from psdmc.calibration.verdict.record import Calibration
from psdmc.model.parameter_checks import check_mass_matrix

pytest.importorskip("cvxpy")
HEAVIER = 1.2
LIGHTER = 0.9
"""kg m^2 taken from the shoulder's inertia, which has about 1: less than its links must have for their weights."""


@pytest.fixture(scope="module")
def runs(ideal_logs: Path) -> Runs:
    """Ideal sensors, but as if the shoulder accelerated more easily than bodies of its weights can."""
    found = read_campaign(ideal_logs)
    return replace(
        found,
        friction=[replace(run, log=lighter(run.log, HEAVIER)) for run in found.friction],
        inertial=[replace(run, log=lighter(run.log, LIGHTER)) for run in found.inertial],
    )


def lighter(log: Log, inertia: float) -> Log:
    """Currents of the shoulder (12 N m/A) as if `inertia` were missing from it."""
    step = log.time[1] - log.time[0]
    qdd = np.zeros(len(log))
    qdd[1:-1] = np.diff(log.position[:, 0], 2) / step**2
    smooth = np.convolve(qdd, np.ones(5) / 5, mode="same")
    less = inertia * smooth / 12.0
    return replace(log, effort=log.effort - np.stack([less, 0 * less], axis=1))


def calibrated(arm, runs: Runs, physical: bool) -> Calibration:
    options = CalibrateOptions(physical=physical)
    return calibrate_campaign(arm.unknown, runs, options, arm.regressor, None, lambda step: None)


@pytest.fixture(scope="module")
def plain(arm, runs: Runs) -> Calibration:
    return calibrated(arm, runs, physical=False)


@pytest.fixture(scope="module")
def physical(arm, runs: Runs) -> Calibration:
    return calibrated(arm, runs, physical=True)


def lugre(record: Calibration, joint: str) -> np.ndarray:
    return np.array([row.value for row in record.friction if row.joint == joint])


def test_the_case_is_one_that_no_robot_can_have(plain):
    mass = check_mass_matrix(plain.model)

    assert mass is not None
    assert not mass.passed


def test_what_is_delivered_a_robot_can_have(physical):
    mass = check_mass_matrix(physical.model)

    assert mass is not None
    assert mass.passed
    for joint in ("shoulder", "elbow"):
        coulomb, static, stribeck, viscous, exponent, stiffness, damping = lugre(physical, joint)
        assert min(coulomb, stribeck, exponent, stiffness) > 0
        assert static >= coulomb
        assert min(viscous, damping) >= 0
    assert physical.prediction is not None
    assert min(run.inertia for run in physical.prediction.runs.values()) >= 0


def test_friction_runs_have_no_negative_inertia_in_the_bare_fit_either(plain):
    assert plain.prediction is not None
    assert plain.prediction.runs["shoulder"].inertia >= 0


def test_friction_moves_with_theta_as_far_as_its_run_lets_it(plain, physical):
    """The inertial run was the wrong one: where theta_b cannot follow it, friction does what it can."""
    moved = (lugre(physical, "shoulder") - lugre(plain, "shoulder")) / np.array(
        [row.std for row in plain.friction if row.joint == "shoulder"]
    )

    assert np.abs(moved).max() > 0.1
    assert np.abs(moved[[PARAMETERS.index("coulomb"), PARAMETERS.index("viscous")]]).max() < 30


@pytest.mark.slow
def test_one_vector_costs_less_than_theta_moved_alone(arm, runs: Runs):
    """The steps' own costs, written down a second time, from what they hand on: no better vector is near."""
    from psdmc.calibration.identify.four_steps import physical_steps

    found = calibrate_four_steps(arm.model.chain, arm.regressor, arm.model.l, runs, CalibrationOptions())
    near = physical_steps(arm.unknown, found)

    def cost(theta: np.ndarray, joints: dict) -> float:
        gravity, inertial, split = found.gravity.estimate, found.inertial.estimate, found.gravity.split
        phi = theta[split.pivots] + split.dependence @ theta[split.rest] - gravity.values
        seven = [joints[k].friction - old.friction for k, old in found.friction.joints.items()]
        sources = np.concatenate([np.zeros(2), phi, *seven])
        psi = theta[split.rest] - inertial.values - inertial.considered @ sources
        own = sum(
            d @ np.linalg.pinv(old.covariance, rcond=1e-12, hermitian=True) @ d
            for d, old in zip(seven, found.friction.joints.values(), strict=True)
        )
        whitened = (gravity.whitening @ phi, inertial.whitening @ psi)
        return float(sum(part @ part for part in whitened) + own)

    staged = cost(near.theta_b, found.friction.joints)
    together = cost(near.theta_b, near.found.friction.joints)

    assert together < staged
    assert near.distance > 1


def test_its_price_is_said_of_friction_runs_too(physical):
    (note,) = [text for text in physical.notes if "physical consistency moved" in text]

    assert "shoulder -" in note
    assert "of friction runs by" in note
