"""Derivatives of PROGRAMs: against 50-digit differences, closed forms, and forward against reverse mode."""

from __future__ import annotations

import numpy as np
import pytest
from fifty_digits import fifty_digit_jacobian

from psdmc.program.cost import cost
from psdmc.program.interpret import interpret
from psdmc.program.program import Program, check
from psdmc.program.slopes import Block, jacobians, jvp, vjp
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

BLOCKS = (Block("dtau_dq", "tau", "q", 3, 3), Block("dtau_dqd", "tau", "qd", 3, 3))
SIZES = {"tau": 3, "dtau_dq": 9, "dtau_dqd": 9}


def differences(program: Program, point: dict[str, np.ndarray], by: str) -> np.ndarray:
    """(3, 3)"""
    return fifty_digit_jacobian(program, point, "tau", 3, by)


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


TURNING = """
    s = sin a
    c = cos a
    cx = mul c x
    sy = mul s y
    cy = mul c y
    sx = mul s x
    u = add cx sy
    v = sub cy sx
"""
"""(u, v): the vector (x, y), turned back by a."""

TURNED = parse(f"""
    a = load q[0]
    x = load q[1]
    y = load qd[0]
    {TURNING}
    w = mul u u
    out tau[0] = w
    out tau[1] = v
    out tau[2] = cy
""")
"""A vector that is turned, and a component of it alone."""


@pytest.mark.parametrize("mode", ["forward", "reverse"])
def test_a_turned_vector_is_its_own_slope(mode: str):
    """d u / d a = v is taken as it stands, where u and v are needed; every derivative is what 50 digits say."""
    point = {"q": np.array([0.3, -0.8, 0.0]), "qd": np.array([0.4, 0.0, 0.0])}
    found = interpret(check(jacobians(TURNED, BLOCKS, mode)), point, SIZES)
    for block in BLOCKS:
        assert relative(found[block.name].reshape(3, 3), differences(TURNED, point, block.by)) < 1e-15


def test_a_gradient_costs_a_few_times_the_function(some_program: Program):
    """Griewank's bound: at most four operations for one, and each sine brings a cosine."""
    back = vjp(some_program, {"tau": "tau_bar"}, {"q": "q_bar", "qd": "qd_bar"}, {"q": 3, "qd": 3})
    assert len(back) <= 5 * len(some_program) + 20


def test_the_slopes_of_a_turned_vector_are_there_already():
    """Six operations turn it; along a tangent each component takes a product, and backwards both take a sum too."""
    turn = parse(f"""
        a = load angle[0]
        x = load v[0]
        y = load v[1]
        {TURNING}
        out tau[0] = u
        out tau[1] = v
    """)
    assert cost(jvp(turn, {"angle": "angle_dot"}, {"tau": "tau_dot"})).total == 6 + 2
    assert cost(vjp(turn, {"tau": "tau_bar"}, {"angle": "angle_bar"}, {"angle": 1})).total == 6 + 3


def test_what_is_held_fixed_costs_nothing():
    text = show(jvp(QUOTIENT, {"qd": "qd_dot"}, {"tau": "tau_dot"}))
    assert "q_dot" not in text.replace("qd_dot", "")
    assert "load qd_dot[1]" in text
