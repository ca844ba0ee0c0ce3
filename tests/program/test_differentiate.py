"""Derivatives of PROGRAMs: against 50-digit differences, closed forms, and forward against reverse mode."""

from __future__ import annotations

from collections.abc import Callable

import mpmath
import numpy as np
import pytest

from psdmc.program.check import check
from psdmc.program.differentiate import Block, jacobians, jvp, vjp
from psdmc.program.interpret import interpret
from psdmc.program.program import Op, Program
from psdmc.program.text import parse, show

QUOTIENT = parse("""
    a = load q[0]
    b = load qd[1]
    s = sin a
    c = cos b
    x = add s b
    two = const 2.0
    y = add c two
    z = div x y
    n = neg z
    m = mul n z
    out tau[0] = z
    out tau[2] = m
""")
"""Division, a square in disguise, an output that is not stored and inputs that are not read."""

_MP: dict[Op, Callable[..., mpmath.mpf]] = {
    Op.ADD: lambda a, b: a + b,
    Op.SUB: lambda a, b: a - b,
    Op.MUL: lambda a, b: a * b,
    Op.DIV: lambda a, b: a / b,
    Op.NEG: lambda a: -a,
    Op.SIN: mpmath.sin,
    Op.COS: mpmath.cos,
}

BLOCKS = (Block("dtau_dq", "tau", "q", 3, 3), Block("dtau_dqd", "tau", "qd", 3, 3))
SIZES = {"tau": 3, "dtau_dq": 9, "dtau_dqd": 9}


def exact(program: Program, point: dict[str, list[mpmath.mpf]]) -> list[mpmath.mpf]:
    """tau at a point with mpmath's digits."""
    values: list[mpmath.mpf] = []
    for instr in program.body:
        if instr.slot is not None:
            values.append(point[instr.slot.vector][instr.slot.index])
        elif instr.value is not None:
            values.append(mpmath.mpf(instr.value))
        else:
            values.append(_MP[instr.op](*(values[a] for a in instr.args)))
    tau = [mpmath.mpf(0)] * 3
    for slot, index in program.outputs:
        tau[slot.index] = values[index]
    return tau


def differences(program: Program, point: dict[str, np.ndarray], by: str) -> np.ndarray:
    """(3, 3) central differences of tau with 50 digits: exact to some 30."""
    with mpmath.workdps(50):
        step = mpmath.mpf(10) ** -16
        columns = []
        for j in range(3):
            sides = []
            for sign in (1, -1):
                there = {name: [mpmath.mpf(float(x)) for x in values] for name, values in point.items()}
                there[by][j] += sign * step
                sides.append(exact(program, there))
            columns.append([float((a - b) / (2 * step)) for a, b in zip(*sides, strict=True)])
    return np.array(columns).T


def relative(found: np.ndarray, expected: np.ndarray) -> float:
    return float(np.abs(found - expected).max() / max(1.0, np.abs(expected).max()))


@pytest.mark.parametrize("mode", ["forward", "reverse"])
def test_jacobians_are_those_of_fifty_digit_differences(some_program: Program, mode: str):
    point = dict(zip(("q", "qd"), np.random.default_rng(3).uniform(-1, 1, (2, 3)), strict=True))
    found = interpret(check(jacobians(some_program, BLOCKS, mode)), point, SIZES)
    for block in BLOCKS:
        assert relative(found[block.name].reshape(3, 3), differences(some_program, point, block.by)) < 1e-12


@pytest.mark.parametrize("mode", ["forward", "reverse"])
def test_quotients_zeros_and_inputs_that_are_not_read(mode: str):
    point = {"q": np.array([0.3, 0.0, 0.0]), "qd": np.array([0.0, -0.7, 0.0])}
    found = interpret(check(jacobians(QUOTIENT, BLOCKS, mode)), point, SIZES)
    a, b = 0.3, -0.7
    z, y = (np.sin(a) + b) / (np.cos(b) + 2), np.cos(b) + 2
    by_a, by_b = np.cos(a) / y, (1 + z * np.sin(b)) / y
    assert found["tau"] == pytest.approx([z, 0, -z * z])
    assert found["dtau_dq"].reshape(3, 3) == pytest.approx(
        np.array([[by_a, 0, 0], [0, 0, 0], [-2 * z * by_a, 0, 0]]), abs=1e-15
    )
    assert found["dtau_dqd"].reshape(3, 3) == pytest.approx(
        np.array([[0, by_b, 0], [0, 0, 0], [0, -2 * z * by_b, 0]]), abs=1e-15
    )


def test_products_with_tangents_and_cotangents_are_those_of_the_jacobians(some_program: Program):
    rng = np.random.default_rng(5)
    given = {name: rng.uniform(-1, 1, (20, 3)) for name in ("q", "qd", "q_dot", "qd_dot", "tau_bar")}
    whole = interpret(jacobians(some_program, BLOCKS, "forward"), given, SIZES)
    by_q, by_qd = (whole[block.name].reshape(20, 3, 3) for block in BLOCKS)

    along = jvp(some_program, {"q": "q_dot", "qd": "qd_dot"}, {"tau": "tau_dot"})
    found = interpret(check(along), given, {"tau": 3, "tau_dot": 3})
    expected = np.einsum("sij,sj->si", by_q, given["q_dot"]) + np.einsum("sij,sj->si", by_qd, given["qd_dot"])
    assert relative(found["tau_dot"], expected) < 1e-12

    back = vjp(some_program, {"tau": "tau_bar"}, {"q": "q_bar", "qd": "qd_bar"}, {"q": 3, "qd": 3})
    found = interpret(check(back), given, {"tau": 3, "q_bar": 3, "qd_bar": 3})
    for name, matrix in (("q_bar", by_q), ("qd_bar", by_qd)):
        assert relative(found[name], np.einsum("sij,si->sj", matrix, given["tau_bar"])) < 1e-12
    assert np.array_equal(found["tau"], whole["tau"])


def test_a_gradient_costs_a_few_times_the_function(some_program: Program):
    """Griewank's bound: at most four operations for one, and each sine brings a cosine."""
    back = vjp(some_program, {"tau": "tau_bar"}, {"q": "q_bar", "qd": "qd_bar"}, {"q": 3, "qd": 3})
    assert len(back) <= 5 * len(some_program) + 20


def test_what_is_held_fixed_costs_nothing():
    text = show(jvp(QUOTIENT, {"qd": "qd_dot"}, {"tau": "tau_dot"}))
    assert "q_dot" not in text.replace("qd_dot", "")
    assert "load qd_dot[1]" in text
