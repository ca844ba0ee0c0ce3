"""The way between two positions, against Pinocchio, and in forty digits where that is less exact."""

from __future__ import annotations

import mpmath
import numpy as np
import pytest
from against_pinocchio import ARM, EVERY, bench, matches_pinocchio
from wide_robots import KINDS, is_pinocchios, wide_robot

from psdmc.robot.joints import FREE, PLANAR, SPHERICAL


@pytest.mark.parametrize(("robot", "real"), EVERY)
def test_it_is_pinocchios(robot: str, real: str) -> None:
    matches_pinocchio("difference", robot, real)


def test_a_chain_subtracts() -> None:
    own = bench(ARM)
    q0, q1 = own.given["q0"], own.given["q1"]
    np.testing.assert_array_equal(own.robot.difference(q0, q1), q1 - q0)


@pytest.mark.parametrize("name", KINDS)
def test_of_wide_joints_it_is_pinocchios(name: str) -> None:
    is_pinocchios("difference", name)


@pytest.mark.parametrize("name", KINDS)
def test_it_leads_to_the_other_position(name: str) -> None:
    """Whatever Pinocchio says: quaternions of both signs are the same turn."""
    own = wide_robot(name)
    robot = own.compiled("integrate", "difference")
    q0, q1 = own.given["q0"], own.given["q1"]
    end = robot.integrate(q0, robot.difference(q0, q1))
    np.testing.assert_allclose(robot.difference(end, q1), 0.0, atol=1e-12)
    assert np.abs(robot.difference(q0, q0)).max() < 2e-16


ANGLES = [1e-12, 1e-9, 1e-5, 1e-3, 0.1, 1.0, 2.0, 3.0, 3.14, 3.141592653]
"""rad; the last is 6e-10 below half a turn."""


def turned(angle: float) -> np.ndarray:
    """A unit quaternion about (2, -1, 2) / 3, from forty digits."""
    with mpmath.workdps(40):
        half = mpmath.mpf(angle) / 2
        return np.array([*(float(mpmath.sin(half) * k / 3) for k in (2, -1, 2)), float(mpmath.cos(half))])


@pytest.mark.parametrize("angle", ANGLES)
@pytest.mark.parametrize("sense", [1.0, -1.0])
def test_angles_are_right_to_the_last_digits(angle: float, sense: float) -> None:
    """Relative to the angle itself, near none and near half a turn; of both quaternions for one turn."""
    axis = np.array([2.0, -1.0, 2.0]) / 3.0
    found = SPHERICAL.difference(SPHERICAL.neutral, sense * turned(angle))
    np.testing.assert_allclose(found, angle * axis, rtol=2e-15)


@pytest.mark.parametrize("angle", ANGLES)
def test_ways_are_right_to_the_last_digits(angle: float) -> None:
    """A frame that goes along its own x and turns about its z moves on a circle; so does one about another axis."""
    with mpmath.workdps(40):
        t = mpmath.mpf(angle)
        place = np.array([float(mpmath.sin(t) / t), float((1 - mpmath.cos(t)) / t)])
        cosine, sine = float(mpmath.cos(t)), float(mpmath.sin(t))
        half = np.array([0.0, 0.0, float(mpmath.sin(t / 2)), float(mpmath.cos(t / 2))])
    planar = PLANAR.difference(PLANAR.neutral, np.array([*place, cosine, sine]))
    np.testing.assert_allclose(planar, [1.0, 0.0, angle], rtol=2e-15, atol=4e-16)
    free = FREE.difference(FREE.neutral, np.array([*place, 0.0, *half]))
    np.testing.assert_allclose(free, [1.0, 0.0, 0.0, 0.0, 0.0, angle], rtol=2e-15, atol=4e-16)
    end = FREE.integrated(FREE.neutral, np.array([1.0, 0.0, 0.0, 0.0, 0.0, angle]))
    np.testing.assert_allclose(end, [*place, 0.0, *half], rtol=2e-15, atol=4e-16)


def test_half_a_turn_has_a_sense() -> None:
    """Exactly: the cosine of half the angle is zero."""
    found = SPHERICAL.difference(SPHERICAL.neutral, np.array([0.0, 1.0, 0.0, 0.0]))
    np.testing.assert_allclose(found, [0.0, np.pi, 0.0], rtol=1e-15)
    turned_about = PLANAR.difference(PLANAR.neutral, np.array([0.0, 0.0, -1.0, 0.0]))
    np.testing.assert_allclose(turned_about[2], np.pi, rtol=1e-15)
