"""The inverse of the mass matrix against Pinocchio and against the mass matrix."""

from __future__ import annotations

import numpy as np
import pytest
from against_pinocchio import (
    ARM,
    ARMS,
    INTERPRETED,
    SEVERAL,
    bench,
    matches_pinocchio,
    program_matches_pinocchio,
)
from direct import Direct


@pytest.mark.parametrize(("robot", "real"), SEVERAL)
def test_it_is_pinocchios(robot: str, real: str) -> None:
    matches_pinocchio("mass_matrix_inverse", robot, real)


@pytest.mark.parametrize("robot", INTERPRETED)
def test_its_programs_are_pinocchios(robot: str) -> None:
    program_matches_pinocchio("mass_matrix_inverse", robot)


@pytest.mark.parametrize("robot", ARMS)
def test_it_takes_the_mass_matrix_to_one(robot: str) -> None:
    own = bench(robot)
    mass = own.model.mass_matrix(own.given["q"])
    found = own.robot.mass_matrix_inverse(own.given["q"])
    assert np.array_equal(found, found.transpose(0, 2, 1))
    error = np.abs(found @ mass - np.eye(own.model.n)).max(axis=(1, 2))
    assert (error < 1e-14 * np.linalg.cond(mass)).all()


def test_a_mass_matrix_that_is_not_positive_has_none_and_says_where() -> None:
    own = bench(ARM)
    q, n = np.ascontiguousarray(own.given["q"][:1]), own.model.n
    found, theta_b = np.zeros((1, n, n)), -np.asarray(own.model.theta_b)
    call = Direct(own.package, own.robot.library)
    assert 1 <= call("mass_matrix_inverse_theta", q, theta_b, found) <= n
    assert np.isnan(found).all()
    assert call("mass_matrix_inverse", q, found) == 0
    assert np.isfinite(found).all()
