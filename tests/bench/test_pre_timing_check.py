"""Who is wrong is named and not timed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from psdmc.bench.contestant import Runner
from psdmc.bench.machine import native_flags
from psdmc.bench.rivals import psdmc_c
from psdmc.bench.run import checked, relative_error, tolerance
from psdmc.bench.states import States
from psdmc.program.kernel import Kernel
from psdmc.program.program import Op, Program
from psdmc.robot.load import load_robot


def with_a_wrong_sign(kernel: Kernel) -> Kernel:
    """The kernel with its first addition turned into a subtraction."""
    body = list(kernel.single.body)
    index = next(i for i, instr in enumerate(body) if instr.op is Op.ADD)
    body[index] = body[index]._replace(op=Op.SUB)
    wrong = Program(tuple(body), kernel.single.outputs)
    return replace(kernel, single=wrong, batch=wrong)


@pytest.mark.needs("g++")
def test_every_function_of_psdmc_passes(two_link):
    contestants = psdmc_c.factored(two_link, (*native_flags(), "-O0"))

    right, errors, wrong = checked(two_link, contestants, seed=1)

    assert (len(right), wrong) == (3 * len(psdmc_c.FUNCTIONS), ())
    assert max(errors) < 1e-10


@pytest.mark.needs("g++")
def test_a_wrong_sign_in_the_program_is_found_before_timing(two_link, monkeypatch):
    kernels = psdmc_c.kernels_of(two_link.model, "factored", ("inverse_dynamics",))
    broken = {name: with_a_wrong_sign(kernel) for name, kernel in kernels.items()}
    monkeypatch.setattr(psdmc_c, "kernels_of", lambda *given: broken)
    contestants = psdmc_c.contestants(two_link, "factored", ("inverse_dynamics",), native_flags())

    right, _, wrong = checked(two_link, contestants, seed=1)

    assert right == []
    assert len(wrong) == 3
    assert wrong[0].rival == "psdmc factored, inverse_dynamics (state)"
    assert "wrong results" in wrong[0].reason


@pytest.mark.needs("g++")
def test_regressors_are_compared_by_the_torques_they_give(two_link):
    contestants = psdmc_c.factored(two_link, (*native_flags(), "-O0"))
    regressor = next(c for c in contestants if c.function == "regressor")
    states = States.random(two_link.chain, 64, seed=3)

    torques = Runner(regressor, states).outputs().reshape(64, 2, -1) @ two_link.model.theta_b

    assert relative_error(torques, states.tau) < 1e-12


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_what_is_no_number_is_infinitely_wrong(bad):
    assert relative_error(np.array([[bad, 1.0]]), np.array([[1.0, 1.0]])) == np.inf


def test_a_block_that_is_zero_throughout_is_no_division_by_zero():
    """A SCARA's gravity has no slopes."""
    assert relative_error(np.zeros((3, 4)), np.zeros((3, 4))) == 0.0
    assert relative_error(np.full((3, 4), 1e-3), np.zeros((3, 4))) == 1e-3


def test_an_output_that_is_always_zero_is_compared_on_the_others_scale():
    expected = np.array([[0.0, 100.0]])

    assert relative_error(np.array([[1e-12, 100.0]]), expected) < 1e-10
    assert relative_error(np.array([[1.0, 100.0]]), expected) > 1.0


GANTRY = """<robot name="gantry"><link name="base"/>
<link name="a"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<link name="b"><inertial><mass value="1e-9"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="x" type="prismatic"><parent link="base"/><child link="a"/><axis xyz="1 0 0"/>
  <limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
<joint name="y" type="prismatic"><parent link="a"/><child link="b"/><axis xyz="0 1 0"/>
  <limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
</robot>"""


def test_a_nearly_singular_mass_matrix_allows_larger_errors(tmp_path, two_link):
    """The slides of a gantry carry both masses and the last one, and do not act on each other."""
    (tmp_path / "gantry.urdf").write_text(GANTRY)
    gantry = States.random(load_robot(tmp_path / "gantry.urdf").chain, 64, seed=1)
    arm = States.random(two_link.chain, 64, seed=1)

    assert gantry.condition == pytest.approx(1e9 + 1, rel=1e-6)
    assert tolerance("forward_dynamics", gantry) == pytest.approx(100 * 2.0**-52 * 1e9, rel=1e-6)
    assert tolerance("inverse_dynamics", gantry) == 1e-10
    assert tolerance("forward_dynamics", arm) == 1e-7
