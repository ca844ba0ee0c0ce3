"""A friction run beside its prediction: the bristles are simulated where they change, and only there."""

from __future__ import annotations

import numpy as np
import pytest

from psdmc.calibration.identify import friction
from psdmc.calibration.identify.friction import MOST_KEPT, JointRun
from psdmc.calibration.identify.state_friction import friction_torque
from psdmc.calibration.identify.steps import FrictionOptions
from psdmc.calibration.logs.low_pass import FilterOptions, LowPass
from psdmc.friction.terms import STATE_LAW

PERIOD = 1e-3


@pytest.fixture
def run() -> JointRun:
    time = np.arange(500) * PERIOD
    rows = np.arange(len(time))
    still = np.zeros(len(time))
    low_pass = LowPass.design(FilterOptions(cutoff=40.0), PERIOD)
    qd, qdd = np.sin(20.0 * time), 20.0 * np.cos(20.0 * time)
    return JointRun(time, PERIOD, qd, qdd, still, still, low_pass, rows, rows, rows)


def unknowns(coulomb: float = 3.0, inertia: float = 0.5, offset: float = 0.1) -> np.ndarray:
    return np.array([coulomb, 0.4, np.log(0.02), 2.0, 0.7, np.log(1e4), 10.0, inertia, offset, 0.0])


def test_friction_is_simulated_once_for_equal_parameters(run: JointRun, monkeypatch: pytest.MonkeyPatch):
    simulated = []

    def counted(*given: object) -> np.ndarray:
        simulated.append(given)
        return friction_torque(*given)  # type: ignore[arg-type]

    monkeypatch.setattr(friction, "friction_torque", counted)

    first, second = run.torque(unknowns()), run.torque(unknowns(inertia=0.8, offset=-0.3))
    assert len(simulated) == 1
    np.testing.assert_allclose(second - first, 0.3 * run.qdd - 0.4, atol=1e-12)

    other = run.torque(unknowns(coulomb=3.5))
    assert len(simulated) == 2
    expected = (
        friction_torque(STATE_LAW.from_unknowns(unknowns(coulomb=3.5)[:7]), run.qd, PERIOD)
        + 0.5 * run.qdd
        + 0.1
    )
    np.testing.assert_array_equal(other, expected)


def test_a_delayed_inertia_is_not_taken_for_friction():
    """The first step of the fit, on a motion of 2 and 6 Hz; the law and the inertia's torque in closed form."""
    time = np.arange(8000) * PERIOD
    low_pass = LowPass.design(FilterOptions(cutoff=40.0), PERIOD)
    coulomb, viscous, exponent, inertia, delay = 3.0, 4.0, 0.7, 1.05, 1e-3
    w, size = 2.0 * np.pi * np.array([2.0, 6.0]), np.array([3.0, 2.0])

    def motion(t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        turn = t[:, None] * w
        return (size * np.sin(turn)).sum(1), (size * w * np.cos(turn)).sum(1)

    speed, acceleration = motion(time + delay)
    torque = (coulomb + viscous * np.abs(speed) ** exponent) * np.sign(speed) + inertia * acceleration
    every = np.arange(500, 7500, 12)
    still = np.zeros(len(time))
    data = JointRun(time, PERIOD, *motion(time), still, low_pass(torque), low_pass, every, every, every)

    found = friction._fast(data, FrictionOptions())

    assert found[0] == pytest.approx(coulomb, rel=0.5)  # the filter smooths reversals
    assert found[3] == pytest.approx(inertia, rel=0.01)
    assert found[5] == pytest.approx(delay, rel=0.15)
    assert abs(friction._fast(data, FrictionOptions(estimate_delay=False))[0] - coulomb) > coulomb


@pytest.mark.parametrize("which", range(7))
def test_each_of_the_seven_counts(run: JointRun, which: int):
    moved = unknowns()
    moved[which] *= 1.1

    assert not np.array_equal(run.friction(unknowns()), run.friction(moved))


def test_few_simulations_are_held(run: JointRun):
    for coulomb in np.linspace(1.0, 5.0, 3 * MOST_KEPT):
        run.torque(unknowns(coulomb))
        assert len(run.kept) <= MOST_KEPT
