"""Derivatives of inverse dynamics in C, against Pinocchio and against both modes of differentiating its PROGRAM."""

from __future__ import annotations

import numpy as np
import pytest
from against_pinocchio import ARM, EVERY, bench, matches_pinocchio

from psdmc.lower.kernels import lower
from psdmc.program.interpret import interpret
from psdmc.program.program import Op
from psdmc.program.slopes import Block, jacobians

NAMES = ("dtau_dq", "dtau_dqd", "dtau_dqdd")


@pytest.mark.parametrize(("robot", "real"), EVERY)
def test_they_are_pinocchios(robot: str, real: str) -> None:
    matches_pinocchio("inverse_dynamics_derivatives", robot, real)


@pytest.mark.parametrize("mode", ["forward", "reverse"])
@pytest.mark.parametrize("robot", sorted({"two_link", "scara", ARM, "sliding"}))
def test_they_are_what_differentiating_inverse_dynamics_gives(robot: str, mode: str) -> None:
    own = bench(robot)
    n = own.model.n
    program = lower(own.model, "factored", ["inverse_dynamics"], theta_variants=False)[
        "inverse_dynamics"
    ].single
    blocks = [Block(name, "tau", by, n, n) for name, by in zip(NAMES, ("q", "qd", "qdd"), strict=True)]
    given = {name: own.given[name][:20] for name in ("q", "qd", "qdd")}
    expected = interpret(jacobians(program, blocks, mode), given, {"tau": n, **dict.fromkeys(NAMES, n * n)})
    found = own.robot.inverse_dynamics_derivatives(*given.values())
    assert found._fields == NAMES
    for name in NAMES:
        matrix = expected[name].reshape(20, n, n)
        np.testing.assert_allclose(getattr(found, name), matrix, atol=1e-12 * np.abs(matrix).max())


def test_the_derivative_by_accelerations_is_the_mass_matrix() -> None:
    own = bench(ARM)
    q, qd, qdd = (own.given[name] for name in ("q", "qd", "qdd"))
    found = own.robot.inverse_dynamics_derivatives(q, qd, qdd).dtau_dqdd
    np.testing.assert_allclose(found, own.model.mass_matrix(q), atol=1e-13 * np.abs(found).max())


def test_results_belong_to_the_caller() -> None:
    """A second call does not see what the caller writes into the results of the first."""
    own = bench(ARM)
    states = [own.given[name] for name in ("q", "qd", "qdd")]
    for robot in (own.model, own.robot):
        found = robot.inverse_dynamics_derivatives(*states)
        before = found.dtau_dq.copy()
        found.dtau_dq[...] = 0.0
        np.testing.assert_array_equal(robot.inverse_dynamics_derivatives(*states).dtau_dq, before)


@pytest.mark.parametrize("name", ["inverse_dynamics_derivatives", "forward_dynamics_derivatives"])
def test_an_upright_arm_takes_no_sine_of_its_first_angle(name: str) -> None:
    """It turns about gravity: its second moment about its own axis is added and subtracted again, turned."""
    kernel = lower(bench("kr6").model, "factored", [name], theta_variants=False)[name]
    for program in (kernel.single, kernel.batch):
        turned = [program.body[i.args[0]].slot for i in program.body if i.op in (Op.SIN, Op.COS)]
        assert ("q", 0) not in turned
        assert ("q", 5) in turned
