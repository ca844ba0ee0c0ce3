"""examples/trajectory_optimisation in a short form: what iLQR finds are motions, and another solver finds the same."""

from __future__ import annotations

import sys

import numpy as np
import pytest
from bundled import ROBOTS, bundled_robot

from psdmc.robot.reference import reference

EXAMPLES = ROBOTS.parent / "trajectory_optimisation"
sys.path.insert(0, str(EXAMPLES))

import ilqr  # noqa: E402


@pytest.fixture(scope="module")
def kr6() -> ilqr.Problem:
    return ilqr.kr6(steps=12, duration=0.6)


@pytest.fixture(scope="module")
def acrobot() -> ilqr.Problem:
    return ilqr.acrobot()


def test_jacobians_of_the_step_are_its_difference_quotients(kr6: ilqr.Problem) -> None:
    rng = np.random.default_rng(1)
    x, u = rng.uniform(-1.0, 1.0, 12), kr6.held + rng.uniform(-5.0, 5.0, 6)
    A, B = kr6.jacobians(x, u)
    h = 1e-6
    by_x = [(kr6.step(x + h * e, u) - kr6.step(x - h * e, u)) / (2 * h) for e in np.eye(12)]
    by_u = [(kr6.step(x, u + h * e) - kr6.step(x, u - h * e)) / (2 * h) for e in np.eye(6)]
    assert np.abs(A - np.transpose(by_x)).max() < 1e-6 * np.abs(A).max()
    assert np.abs(B - np.transpose(by_u)).max() < 1e-6 * np.abs(B).max()


def test_the_kr6_arrives(kr6: ilqr.Problem) -> None:
    found = ilqr.solve(kr6)
    assert all(after < before for before, after in zip(found.costs, found.costs[1:], strict=False))
    assert np.abs(found.x[-1] - kr6.goal)[:6].max() < 0.02
    pinocchio = reference(bundled_robot("kr6"))
    rates = (found.x[1:, 6:] - found.x[:-1, 6:]) / kr6.dt
    torques = pinocchio.inverse_dynamics(found.x[:-1, :6], found.x[:-1, 6:], rates)
    assert np.abs(torques - found.u).max() < 1e-8 * np.abs(found.u).max()


def test_the_acrobot_is_swung_up(acrobot: ilqr.Problem) -> None:
    """By a motor in the elbow, which cannot hold the first link: it is swung back and forth."""
    found = ilqr.solve(acrobot)
    assert np.abs(found.x[-1] - acrobot.goal).max() < 0.02
    assert found.u.shape == (acrobot.steps, 1)


def test_crocoddyl_finds_the_same_motion(kr6: ilqr.Problem) -> None:
    pytest.importorskip("crocoddyl")
    import in_crocoddyl

    own = ilqr.solve(kr6).costs[-1]
    cost, *_ = in_crocoddyl.solved(in_crocoddyl.with_psdmc(kr6), kr6)
    theirs, *_ = in_crocoddyl.solved(in_crocoddyl.with_pinocchio(kr6, in_crocoddyl.kr6_of_pinocchio()), kr6)
    assert cost == pytest.approx(own, rel=1e-7)
    assert theirs == pytest.approx(own, rel=1e-7)
