"""Gradients of forward dynamics with wrenches against Pinocchio and against the blocks of derivatives."""

from __future__ import annotations

import numpy as np
import pytest
from against_pinocchio import ARMS, INTERPRETED, SEVERAL, bench, matches_pinocchio, program_matches_pinocchio
from wide_robots import is_pinocchios


@pytest.mark.parametrize(("robot", "real"), SEVERAL)
def test_it_is_pinocchios(robot: str, real: str) -> None:
    matches_pinocchio("forward_dynamics_with_wrenches_vjp", robot, real)


@pytest.mark.parametrize("robot", INTERPRETED)
def test_its_programs_are_pinocchios(robot: str) -> None:
    program_matches_pinocchio("forward_dynamics_with_wrenches_vjp", robot)


def test_it_is_pinocchios_where_joints_have_several_coordinates() -> None:
    is_pinocchios("forward_dynamics_with_wrenches_vjp", "small", 1e-9, in_c=False)


@pytest.mark.parametrize("robot", ARMS)
def test_gradient_times_tangent_is_cotangent_times_slope(robot: str) -> None:
    """Reverse against forward mode."""
    own = bench(robot)
    g, names = own.given, ("q", "qd", "tau", "wrenches")
    states, ways = ([g[prefix + name] for name in names] for prefix in ("", "d"))
    back = own.robot.forward_dynamics_with_wrenches_vjp(*states, g["cotangent"])[1:]
    ahead = own.robot.forward_dynamics_with_wrenches_jvp(*states, *ways)[1]
    sums = sum((grad * way).reshape(len(way), -1).sum(axis=1) for grad, way in zip(back, ways, strict=True))
    expected = (ahead * g["cotangent"]).sum(axis=1)
    np.testing.assert_allclose(sums, expected, atol=1e-12 * np.abs(expected).max())
