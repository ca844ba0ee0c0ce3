"""Axes from exactly parallel to a tenth of a radian apart: torques to 1e-12 of each joint's largest, whatever the tilt."""

from __future__ import annotations

import os
from itertools import product

import numpy as np
import pytest
from bundled import bundled_robot
from nearly_parallel import tilted_chain
from random_chains import Oracle, random_chain, relative_error, states

from psdmc.derivation.base_parameters import reduced, reduction_of, sampled_reduction
from psdmc.derivation.derive import derive_model
from psdmc.derivation.expand import EXTENDED, IN_DOUBLE, precision_for
from psdmc.derivation.interpolate import DOUBLE, interpolation, nodes, quadratic_basis
from psdmc.derivation.scaled import extended, has_small_entries, orthonormal, scaled
from psdmc.robot.joints import PRISMATIC, REVOLUTE, JointType

ACCURACY = 1e-12
WHOLE = os.environ.get("PSDMC_ACCURACY") == "whole"
"""`make test-accuracy`: each chain with and without E and P, and four times as many tilts."""
TILTS = (0.0, *(10.0**k for k in np.arange(-10.0, -0.9, 0.5 if WHOLE else 2.0)))


@pytest.mark.parametrize("kinds", ["RR", "RRR", "RRRP", "RPRR"])
@pytest.mark.parametrize("tilt", TILTS, ids=lambda tilt: f"{tilt:.0e}")
def test_torques_at_any_tilt(kinds: str, tilt: float) -> None:
    cases = product(range(3), (False, True)) if WHOLE else enumerate((True, True, False))
    for seed, expand in cases:
        chain = tilted_chain(seed, kinds, tilt)
        q, qd, qdd = states(len(kinds), 100)
        expected = Oracle(chain).rnea(q, qd, qdd)
        model = derive_model(chain, expand=expand)
        assert relative_error(model.inverse_dynamics(q, qd, qdd), expected) < ACCURACY
        assert model.certificate.max() < ACCURACY


def test_coefficients_stay_small_where_axes_are_nearly_parallel() -> None:
    """One pass in x order divides by residuals of the size of the tilt, or of its square: entries of 1e7 and more."""
    for tilt in (1e-7, 1e-5, 1e-3):
        for seed in range(8):
            assert np.abs(derive_model(tilted_chain(seed, "RRR", tilt), expand=False).B).max() < 10.0


def test_a_small_column_is_not_clear() -> None:
    """Column 0 is independent by all of itself, and column 1 would be 1e9 times as much of it."""
    rows = np.array([[1e-9, 1.0, 0.0], [0.0, 0.0, 1.0]])
    assert not reduced(rows).is_clear
    assert reduced(rows * [1e9, 1.0, 1.0]).is_clear


def test_bundled_robots_are_decided_in_double() -> None:
    """Nothing about them is nearly special: their models stay as they are, bit for bit."""
    for name in ("kr6", "lbr7", "denso_wall", "scara", "two_link_full"):
        robot = scaled(bundled_robot(name).chain)
        assert reduction_of(robot).is_clear
        assert precision_for(robot, reduction_of(robot)) is IN_DOUBLE


def test_a_tilt_is_decided_in_extended_precision() -> None:
    robot = scaled(tilted_chain(0, "RRR", 1e-5))
    assert not sampled_reduction(robot).is_clear
    assert precision_for(robot, reduction_of(robot)) is EXTENDED


def test_a_small_angle_that_leaves_the_rank_clear_is_seen_in_the_geometry() -> None:
    assert not has_small_entries(scaled(random_chain(0, "RRR")))
    assert has_small_entries(scaled(tilted_chain(0, "RR", 1e-6)))
    assert not has_small_entries(scaled(tilted_chain(0, "RR", 0.0)))


def test_rotations_are_orthonormal_to_all_digits() -> None:
    for joint in random_chain(3, "RRRRR").joints:
        exact = orthonormal(joint.placement.rotation)
        off = np.abs(np.einsum("ji,jk->ik", exact, exact) - np.eye(3)).max()
        assert off < 8 * np.finfo(np.longdouble).eps
        assert np.abs(exact - joint.placement.rotation).max() < 1e-15


def test_zeros_of_a_rotation_about_an_axis_stay() -> None:
    c, s = np.cos(0.7), np.sin(0.7)
    exact = orthonormal(np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]))
    assert np.array_equal(exact == 0.0, np.array([[0, 0, 1], [0, 0, 1], [1, 1, 0]], dtype=bool))


@pytest.mark.parametrize("kind", [REVOLUTE, PRISMATIC])
def test_interpolation_in_extended_precision(kind: JointType) -> None:
    long = np.dtype(np.longdouble)
    basis = quadratic_basis(kind, nodes(kind).astype(long))
    product = np.einsum("ij,jk->ik", interpolation(kind, long), basis)
    assert np.abs(product - np.eye(len(basis))).max() < 32 * np.finfo(long).eps
    assert interpolation(kind, DOUBLE).dtype == DOUBLE


def test_gravity_is_a_unit_vector_in_extended_precision() -> None:
    up = np.array(extended(scaled(tilted_chain(1, "RR", 1e-6))).up)
    assert abs(np.sum(up * up) - 1.0) < 4 * np.finfo(np.longdouble).eps
