"""Forward dynamics and its derivatives in C, against Pinocchio and difference quotients."""

from __future__ import annotations

import numpy as np
import pytest
from against_pinocchio import EVERY, bench, matches_pinocchio

from psdmc.compiler import compile


@pytest.mark.parametrize(("robot", "real"), EVERY)
def test_they_are_pinocchios(robot: str, real: str) -> None:
    matches_pinocchio("forward_dynamics_derivatives", robot, real)


@pytest.mark.parametrize("robot", ["scara", "kr6"])
def test_they_are_the_slopes_of_forward_dynamics(robot: str) -> None:
    own = bench(robot)
    step, states = 1e-6, [own.given[name][:10] for name in ("q", "qd", "tau")]
    forward = compile(own.model, functions=["forward_dynamics"]).forward_dynamics
    found = own.robot.forward_dynamics_derivatives(*states)
    np.testing.assert_allclose(found.qdd, forward(*states), rtol=1e-9, atol=1e-9)
    for by, block in enumerate((found.dqdd_dq, found.dqdd_dqd, found.dqdd_dtau)):
        for j in range(own.model.n):
            ahead, behind = (
                [
                    values + h * np.eye(own.model.n)[j] if k == by else values
                    for k, values in enumerate(states)
                ]
                for h in (step, -step)
            )
            slope = (forward(*ahead) - forward(*behind)) / (2 * step)
            np.testing.assert_allclose(block[:, :, j], slope, atol=1e-5 * np.abs(block).max())
