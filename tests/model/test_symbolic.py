"""Torques as SymPy expressions: numerically Pinocchio's, and for two links the textbook's formula."""

from __future__ import annotations

import sys
from dataclasses import replace

import numpy as np
import pytest
from bundled import bundled_model, bundled_robot

from psdmc.errors import InputError, ToolchainError
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.robot.reference import reference

sympy = pytest.importorskip("sympy")


def values(model: DynamicsModel, state: np.ndarray) -> dict[str, float]:
    words = ("q", "qd", "qdd")
    return {f"{word}{j + 1}": float(state[k, j]) for k, word in enumerate(words) for j in range(model.n)}


@pytest.mark.parametrize("name", ["two_link", "two_link_full", "scara"])
def test_expressions_have_pinocchios_torques(name: str) -> None:
    model, pinocchio = bundled_model(name), reference(bundled_robot(name))
    state = np.random.default_rng(3).uniform(-2.0, 2.0, (3, model.n))
    expected = pinocchio.inverse_dynamics(*state[:, None, :])[0]
    given = values(model, state)
    thetas = {f"theta_b{k}": value for k, value in enumerate(model.theta_b.tolist())}
    for joint in range(model.n):
        with_symbols = model.torque_expression(joint)
        by_symbols = {s: (given | thetas)[s.name] for s in with_symbols.free_symbols}
        assert float(with_symbols.subs(by_symbols)) == pytest.approx(expected[joint], rel=1e-12)
        with_numbers = model.torque_expression(model.joint_names[joint], numbers=True)
        by_numbers = {s: given[s.name] for s in with_numbers.free_symbols}
        assert float(with_numbers.subs(by_numbers)) == pytest.approx(expected[joint], rel=1e-12)


def test_the_elbow_of_two_links_is_the_textbooks() -> None:
    """Spong, Hutchinson, Vidyasagar, section 7.4: I2 (qdd1 + qdd2) + m2 r2 (a1 (qdd1 c2 + qd1^2 s2) + g c12)."""
    q1, q2, qd1, qdd1, qdd2 = sympy.symbols("q1 q2 qd1 qdd1 qdd2", real=True)
    m2, r2, a1, about_joint = 1.5, 1.1 - 0.5, 1.2, 0.15 + 1.5 * (1.1 - 0.5) ** 2
    textbook = about_joint * (qdd1 + qdd2) + m2 * r2 * (
        a1 * (qdd1 * sympy.cos(q2) + qd1**2 * sympy.sin(q2)) + 9.81 * sympy.cos(q1 + q2)
    )
    found = bundled_model("two_link").torque_expression("elbow", numbers=True)
    difference = sympy.expand(sympy.expand_trig(textbook - found))
    assert all(abs(float(term.as_coeff_Mul()[0])) < 1e-12 for term in sympy.Add.make_args(difference))


def test_an_unknown_joint_is_refused_with_the_names() -> None:
    with pytest.raises(InputError, match="no joint 'hip'") as caught:
        bundled_model("two_link").torque_expression("hip")
    assert caught.value.hint == "the joints are 0 to 1: shoulder, elbow"


def test_a_torque_of_too_many_monomials_is_refused() -> None:
    with pytest.raises(InputError, match=r"the torque of joint .joint_1. has \d+ monomials"):
        bundled_model("lbr7").torque_expression(0)


def test_a_model_without_expansion_says_so() -> None:
    with pytest.raises(InputError, match="derived without E and P"):
        replace(bundled_model("two_link"), expansion=None).torque_expression(0)


def test_without_sympy_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "sympy", None)
    with pytest.raises(ToolchainError, match="need SymPy") as caught:
        bundled_model("two_link").torque_expression(0)
    assert caught.value.hint == "pip install 'psdmc[notebook]'"
