"""Links that the robot's file simplifies to rods and points: physical consistency keeps to what such bodies can be."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from bundled import bundled_model

from psdmc import calibrate
from psdmc.calibration.logs.log import Log
from psdmc.calibration.logs.log_files import write_log
from psdmc.model.parameter_checks import check_mass_matrix


def planar_log(path: Path) -> None:
    """Eight seconds of the two-link arm whose links have no moment of inertia along themselves, with friction and
    noise of 10 mN m; its torques by the closed form of a planar double pendulum of rods."""
    t = np.arange(0.0, 8.0, 0.01)
    w = 2 * np.pi * np.array([[0.25, 0.4], [0.7, 1.1]])
    q = 0.3 * sum(np.sin(np.outer(t, row)) for row in w)
    qd = 0.3 * sum(row * np.cos(np.outer(t, row)) for row in w)
    qdd = 0.3 * sum(-(row**2) * np.sin(np.outer(t, row)) for row in w)
    tau = planar_torques(q, qd, qdd) + 0.3 * np.sign(qd) + 0.2 * qd
    tau += np.random.default_rng(0).normal(scale=0.01, size=tau.shape)
    write_log(Log("run", bundled_model("two_link").joint_names, t, q, qd, tau, "motor_torque"), path)


def planar_torques(q: np.ndarray, qd: np.ndarray, qdd: np.ndarray) -> np.ndarray:
    """The double pendulum of facts: m 2, 1.5 kg; centres 0.65 and 0.6 m from the joints; Izz 0.25, 0.15; gravity -y."""
    m1, m2, a1, c1, c2, i1, i2, g = 2.0, 1.5, 1.2, 0.65, 0.6, 0.25, 0.15, 9.81
    cos2, sin2 = np.cos(q[:, 1]), np.sin(q[:, 1])
    m22 = i2 + m2 * c2**2
    m12 = m22 + m2 * a1 * c2 * cos2
    m11 = i1 + m1 * c1**2 + m22 + m2 * (a1**2 + 2 * a1 * c2 * cos2)
    h = m2 * a1 * c2 * sin2
    far = m2 * g * c2 * np.cos(q.sum(axis=1))
    first = m11 * qdd[:, 0] + m12 * qdd[:, 1] - h * (2 * qd[:, 0] * qd[:, 1] + qd[:, 1] ** 2)
    second = m12 * qdd[:, 0] + m22 * qdd[:, 1] + h * qd[:, 0] ** 2
    return np.stack([first + (m1 * c1 + m2 * a1) * g * np.cos(q[:, 0]) + far, second + far], axis=1)


def test_the_closed_form_is_the_robot() -> None:
    rng = np.random.default_rng(1)
    q, qd, qdd = rng.uniform(-2, 2, (3, 50, 2))

    np.testing.assert_allclose(
        bundled_model("two_link").inverse_dynamics(q, qd, qdd),
        planar_torques(q, qd, qdd),
        rtol=1e-12,
        atol=1e-12,
    )


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("flat") / "log.csv"
    planar_log(path)
    return path


def test_a_clean_log_of_an_arm_of_rods_is_usable(log: Path) -> None:
    model = bundled_model("two_link")

    found = calibrate(model, log)

    assert found.verdict is not None
    assert found.verdict.word == "usable"
    mass = check_mass_matrix(found.model)
    assert mass is not None
    assert mass.passed
    np.testing.assert_allclose(found.model.theta_b, model.theta_b, rtol=5e-3, atol=5e-3)
