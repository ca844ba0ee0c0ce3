"""Kinetic energy against Pinocchio and against the mass matrix of E, P and theta_b."""

from __future__ import annotations

import numpy as np
import pytest
from against_pinocchio import ARM, EVERY, bench, matches_pinocchio
from bundled import robot_path
from unoptimised import without_optimisation

from psdmc.compiler import compile, derive


@pytest.mark.parametrize(("robot", "real"), EVERY)
def test_the_energy_is_pinocchios(robot: str, real: str) -> None:
    matches_pinocchio("kinetic_energy", robot, real)


@pytest.mark.parametrize("robot", sorted({"two_link", "scara", ARM}))
def test_it_is_half_of_qd_m_qd(robot: str) -> None:
    own = bench(robot)
    q, qd = own.given["q"], own.given["qd"]
    expected = 0.5 * np.einsum("si,sij,sj->s", qd, own.model.mass_matrix(q), qd)
    found = own.robot.kinetic_energy(q, qd)
    np.testing.assert_allclose(found, expected, atol=1e-12 * expected.max())
    assert (found > 0).all()


def test_drives_have_energy_too() -> None:
    model = derive(robot_path("scara"), drive_inertia=(0.3, 0.2, 0.1, 0.05))
    q, qd = np.random.default_rng(4).normal(size=(2, 50, 4))
    expected = 0.5 * np.einsum("si,sij,sj->s", qd, model.mass_matrix(q), qd)
    with without_optimisation():
        found = compile(model, functions=["kinetic_energy"]).kinetic_energy(q, qd)
    np.testing.assert_allclose(found, expected, rtol=1e-12)
