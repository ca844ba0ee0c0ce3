"""Positions after constant rates, against Pinocchio."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from against_pinocchio import ARM, EVERY, bench, matches_pinocchio
from wide_robots import KINDS, is_pinocchios, wide_robot

from psdmc.errors import InputError


@pytest.mark.parametrize(("robot", "real"), EVERY)
def test_it_is_pinocchios(robot: str, real: str) -> None:
    matches_pinocchio("integrate", robot, real)


def test_a_chain_adds() -> None:
    own = bench(ARM)
    np.testing.assert_array_equal(
        own.robot.integrate(own.given["q"], own.given["v"]), own.given["q"] + own.given["v"]
    )


@pytest.mark.parametrize("name", KINDS)
def test_of_wide_joints_it_is_pinocchios(name: str) -> None:
    is_pinocchios("integrate", name)


@pytest.mark.parametrize("size", [0.0, 1e-160, 1e-12, 1e-6, 1e-3, 1.0, 40.0])
def test_steps_of_any_size(size: float) -> None:
    """From none at all to several turns; where Pinocchio takes series for small angles it is right to 4e-14."""
    own = wide_robot("free")
    q, way = own.given["q"], size * own.given["v"]
    found = own.compiled("integrate", "difference").integrate(q, way)
    expected = np.array([pin.integrate(own.pinocchio.model, *row) for row in zip(q, way, strict=True)])
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-13 * max(1.0, size))


def test_quaternions_come_out_with_length_one_whatever_went_in() -> None:
    own = wide_robot("free")
    robot, q, way = own.compiled("integrate", "difference"), own.given["q"].copy(), own.given["v"]
    expected = robot.integrate(q, way)
    units = own.model.mechanism.types[0].unit
    q[:, units] *= 3.7
    found = robot.integrate(q, way)
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-14)
    np.testing.assert_allclose(np.linalg.norm(found[:, units], axis=1), 1.0, rtol=0.0, atol=4e-16)


def test_float32_is_right_to_its_digits() -> None:
    own = wide_robot("spherical")
    robot = own.compiled("integrate")
    import psdmc

    single = psdmc.compile(own.model, functions=["integrate", "difference"], real="float32")
    for size in (0.0, 1e-8, 1e-3, 1.0):
        q, way = own.given["q"].astype(np.float32), (size * own.given["v"]).astype(np.float32)
        expected = robot.integrate(own.given["q"], size * own.given["v"])
        np.testing.assert_allclose(single.integrate(q, way), expected, rtol=0.0, atol=2e-6)
        back = single.difference(q, single.integrate(q, way / 3))
        np.testing.assert_allclose(back, size * own.given["v"] / 3, rtol=0.0, atol=4e-6)


def test_other_functions_refuse_quaternions_of_another_length_by_row() -> None:
    own = wide_robot("free")
    robot = own.compiled("integrate", "difference", "gravity")
    q = own.given["q"].copy()
    q[7, 3:7] *= 1.0 + 2e-6
    with pytest.raises(InputError) as refused:
        robot.gravity(q)
    assert str(refused.value) == "gravity: q[3:7] of row 7 has length 1.000002, expected one"
    assert refused.value.hint == "divide it by its length, or let integrate do it: integrate(q, 0 * v)"
    with pytest.raises(InputError, match=r"difference: q1\[3:7\] of row \(1, 7\) has length 1.000002"):
        robot.difference(own.given["q"], np.stack([own.given["q"], q]))
    with pytest.raises(InputError, match=r"gravity: q\[3:7\] has length nan"):
        robot.gravity(np.full(own.model.nq, np.nan))
    robot.gravity(robot.integrate(q, 0.0 * own.given["v"]))
    q[7, 3:7] *= (1.0 + 1e-7) / (1.0 + 2e-6)
    robot.gravity(q)
