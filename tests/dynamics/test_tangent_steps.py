"""Derivatives of `integrate` along tangents, against Pinocchio's dIntegrate and at fifty digits."""

from __future__ import annotations

import mpmath
import numpy as np
import pinocchio as pin
import pytest
from slow_cases import slow_but_for

from psdmc.dynamics.frames import frames_of
from psdmc.dynamics.manifold import _coefficients, step_slopes
from psdmc.robot.joints import FREE, PLANAR, WIDE_TYPES

TYPES = {kind: getattr(pin, f"JointModel{kind.pinocchio}") for kind in WIDE_TYPES.values()}
SIZES = (1e-9, 1e-4, 1e-2, 0.3, 2.0, 6.0, 20.0)
"""Of the way: rad and m."""
EXACT = 1e-15
"""Of the largest entry, for each rad beside ten of them: a turn is no better than its angle."""
SERIES = 2e-10
"""What Pinocchio's own dIntegrate is taken for, which has series for small turns."""


class One:
    """A frame that has a joint and nothing else."""

    def __init__(self, joint) -> None:
        self.joint, self.mimic = joint, None


def exact(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Ad(exp(-x)) and J(x) of a free body's way x, linear then angular, as series of ad(x) at fifty digits."""
    with mpmath.workdps(60):
        v, w = [mpmath.mpf(float(k)) for k in x[:3]], [mpmath.mpf(float(k)) for k in x[3:]]

        def skew(a):
            return [[0, -a[2], a[1]], [a[2], 0, -a[0]], [-a[1], a[0], 0]]

        ad = mpmath.zeros(6)
        for i in range(3):
            for j in range(3):
                ad[i, j] = ad[3 + i, 3 + j] = skew(w)[i][j]
                ad[i, 3 + j] = skew(v)[i][j]
        term, start, way = mpmath.eye(6), mpmath.zeros(6), mpmath.zeros(6)
        for k in range(1, 160):
            start, way = start + term, way + term / k
            term = -(term * ad) / k
            if mpmath.mnorm(term, 1) < mpmath.eps:
                break
        return np.array(start.tolist(), float), np.array(way.tolist(), float)


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("joint", slow_but_for([FREE, PLANAR], TYPES), ids=lambda joint: joint.word)
def test_they_are_the_series_of_the_group(joint, size: float) -> None:
    rng = np.random.default_rng(4)
    places = [(*linear, *angular).index(1.0) for linear, angular in joint.twists]
    for _ in range(10):
        x = np.zeros(6)
        x[places] = rng.normal(size=len(places))
        x *= size / np.linalg.norm(x)
        (found,) = step_slopes([One(joint)], list(x[places]))
        for own, expected in zip(found, exact(x), strict=True):
            part = expected[np.ix_(places, places)]
            assert np.abs(np.array(own, float) - part).max() <= EXACT * (10.0 + size) * np.abs(part).max()


@pytest.mark.parametrize("joint", TYPES, ids=lambda joint: joint.word)
def test_they_are_pinocchios(joint) -> None:
    model = pin.Model()
    model.addJoint(0, TYPES[joint](), pin.SE3.Identity(), "joint")
    rng = np.random.default_rng(5)
    for size in (1e-2, 0.3, 2.0):
        q, v = (
            pin.randomConfiguration(model, -np.ones(model.nq), np.ones(model.nq)),
            rng.normal(size=model.nv),
        )
        v *= size / np.linalg.norm(v)
        (found,) = step_slopes([One(joint)], list(v))
        for own, which in zip(found, (pin.ARG0, pin.ARG1), strict=True):
            expected = pin.dIntegrate(model, q, v, which)
            assert np.abs(np.array(own, float) - expected).max() <= SERIES


def test_coefficients_keep_their_digits() -> None:
    """Where the quotients that they are named by would lose all: against 150 digits."""
    for t in (0.0, 1e-12, 1e-6, 1e-3, 0.1, 1.0, 3.0, 6.3, 12.0, 25.0):
        found = _coefficients(t * t)
        with mpmath.workdps(150):
            x = mpmath.mpf(t) if t else mpmath.mpf(10) ** -20
            b, c = (1 - mpmath.cos(x)) / x**2, (x - mpmath.sin(x)) / x**3
            expected = [b, c, (mpmath.mpf(1) / 2 - b) / x**2, (3 * c - b) / (2 * x**2)]
        for own, value in zip(found, expected, strict=True):
            assert abs(own - float(value)) <= 4e-16 * max(1.0, t) * max(
                abs(float(value)), 1.0 / max(1.0, t * t)
            )


def test_a_joint_of_one_rate_has_none() -> None:
    from bundled import bundled_model

    frames = frames_of(bundled_model("two_link").mechanism)
    assert step_slopes(frames, [0.3, 0.4]) == [None, None]
