"""The way between two positions, against Pinocchio, and in forty digits where that is less exact."""

from __future__ import annotations

from collections.abc import Sequence

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


EPSILON = np.finfo(float).eps

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


NEAR = [1e-3, 1e-5, 1e-7, 1e-9, 1e-11, 1e-12]
"""rad, of orientations that are nearly equal."""


def both_of(angle: float, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Two unit quaternions (x, y, z, w), rounded, about so far apart, about random axes."""
    rng = np.random.default_rng(seed)
    with mpmath.workdps(40):
        first = mpmath.matrix(rng.normal(size=4).tolist())
        first /= mpmath.norm(first)
        axis = mpmath.matrix(rng.normal(size=3).tolist())
        axis *= mpmath.sin(mpmath.mpf(angle) / 2) / mpmath.norm(axis)
        second = hamilton(first, [*axis, mpmath.cos(mpmath.mpf(angle) / 2)])
        return np.array([float(x) for x in first]), np.array([float(x) for x in second])


def hamilton(first: Sequence[mpmath.mpf], second: Sequence[mpmath.mpf]) -> list[mpmath.mpf]:
    """The product of two quaternions (x, y, z, w), by vectors: w v' + w' v + v x v', w w' - v . v'."""
    (*v, w), (*u, t) = first, second
    across = [v[1] * u[2] - v[2] * u[1], v[2] * u[0] - v[0] * u[2], v[0] * u[1] - v[1] * u[0]]
    scalar = w * t - sum(a * b for a, b in zip(v, u, strict=True))
    return [*(w * b + t * a + c for a, b, c in zip(v, u, across, strict=True)), scalar]


def turn_between(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """rad, the turn from one of these doubles to the other, in forty digits: 2 atan2(|v|, w) along v."""
    with mpmath.workdps(40):
        x, y, z, w = map(mpmath.mpf, first.tolist())
        *v, scalar = hamilton([-x, -y, -z, w], [mpmath.mpf(each) for each in second.tolist()])
        length = mpmath.norm(v)
        angle = 2 * mpmath.atan2(length, abs(scalar)) * (1 if scalar > 0 else -1)
        return np.array([float(angle * each / length) for each in v])


@pytest.mark.parametrize("angle", NEAR)
def test_nearly_equal_orientations_keep_their_digits(angle: float) -> None:
    """Relative to the angle between them, from whatever orientation, with both quaternions for one turn. Six roundings of
    half an ulp in a product of two quaternions, and a few in the rest: 16 epsilon is twice that."""
    for seed in range(20):
        first, second = both_of(angle, seed)
        expected = turn_between(first, second)
        for sense in (1.0, -1.0):
            found = np.array(SPHERICAL.difference(first, sense * second))
            assert np.linalg.norm(found - expected) < 16 * EPSILON * np.linalg.norm(expected)
        moved = FREE.difference([0.0, 0.0, 0.0, *first], [1.0, 2.0, 3.0, *second])
        assert np.linalg.norm(moved[3:] - expected) < 16 * EPSILON * np.linalg.norm(expected)
        pair = first[:2] / np.linalg.norm(first[:2]), second[:2] / np.linalg.norm(second[:2])
        with mpmath.workdps(40):
            (c, s), (c1, s1) = (map(mpmath.mpf, each.tolist()) for each in pair)
            flat = float(mpmath.atan2(c * s1 - s * c1, c * c1 + s * s1))
        planar = PLANAR.difference([0.0, 0.0, *pair[0]], [1.0, 2.0, *pair[1]])
        assert abs(planar[2] - flat) < 16 * EPSILON * abs(flat)


def test_compiled_code_keeps_them_too() -> None:
    """Passes may write sums in another order, and compilers fuse them."""
    own = wide_robot("pair")
    robot = own.compiled("difference")
    for angle in NEAR:
        first, second = both_of(angle, 7)
        q0, q1 = own.given["q0"][0].copy(), own.given["q1"][0].copy()
        q0[3:7], q1[3:7] = first, second
        expected = turn_between(first, second)
        for found in (
            robot.difference(q0, q1),
            robot.difference(np.tile(q0, (9, 1)), np.tile(q1, (9, 1)))[4],
        ):
            assert np.linalg.norm(found[3:6] - expected) < 16 * EPSILON * np.linalg.norm(expected)


def test_half_a_turn_has_a_sense() -> None:
    """Exactly: the cosine of half the angle is zero."""
    found = SPHERICAL.difference(SPHERICAL.neutral, np.array([0.0, 1.0, 0.0, 0.0]))
    np.testing.assert_allclose(found, [0.0, np.pi, 0.0], rtol=1e-15)
    turned_about = PLANAR.difference(PLANAR.neutral, np.array([0.0, 0.0, -1.0, 0.0]))
    np.testing.assert_allclose(turned_about[2], np.pi, rtol=1e-15)
