"""Torques of small robots as SymPy expressions, term by term from E and P."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from psdmc.errors import InputError, ToolchainError
from psdmc.model.expansion import Expansion, RowBlocks
from psdmc.reproducible import length
from psdmc.robot.limits import shown
from psdmc.robot.mechanism import Array, Mechanism

if TYPE_CHECKING:
    import sympy


MOST_MONOMIALS = 2000
"""Of one torque. SymPy takes about a millisecond for each."""


def torque_expression(
    robot: Mechanism, expansion: Expansion, joint: int | str, theta_b: Array | None
) -> sympy.Expr:
    """Return the torque of one joint as a SymPy expression: the sum of monomials times combinations of theta_b.

    joint    number from 0, or name
    theta_b  (l,) numbers that replace the symbols theta_b0, theta_b1 and so on; None: the symbols stay

    The symbols q1, qd1, qdd1 and so on are real. In them, joints are numbered from 1, as in the equations of base
    parameters. Symbols theta_b0 and so on are numbered as the entries of theta_b.

    Raises InputError if there is no such joint, or if the torque has more than MOST_MONOMIALS monomials. Raises
    ToolchainError if SymPy is not installed.
    """
    sp, number = _sympy(), _joint_number(robot, joint)
    entries = expansion.entries
    own = np.flatnonzero(entries.joint == number)
    used, place = np.unique(entries.row[own], return_inverse=True)
    if len(used) > MOST_MONOMIALS:
        raise InputError(
            f"the torque of joint {shown(robot.v_names[number])} has {len(used)} monomials, "
            f"expressions are made of up to {MOST_MONOMIALS}",
            "lock joints or cut the chain; model.E, model.P and psdmc show --terms have all of them",
        )
    thetas = _parameters(sp, expansion.l, theta_b)
    weights: list[list[Any]] = [[] for _ in used]
    for k, entry in zip(place.tolist(), own.tolist(), strict=True):
        weights[k].append(_number(sp, float(entries.value[entry])) * thetas[entries.column[entry]])
    factors = _factors(sp, robot.nv)
    strength = _number(sp, length(np.asarray(robot.gravity)))
    terms = (
        sp.Add(*weight) * _monomial(sp, expansion, int(column), factors, strength)
        for column, weight in zip(used, weights, strict=True)
    )
    found: sympy.Expr = sp.Add(*terms)
    return found


def _joint_number(robot: Mechanism, joint: int | str) -> int:
    numbers = {name: i for i, name in enumerate(robot.v_names)} | {i: i for i in range(robot.nv)}
    if joint not in numbers:
        raise InputError(
            f"no joint {shown(joint)}",
            f"the joints are 0 to {robot.nv - 1}: {', '.join(robot.v_names)}",
        )
    return numbers[joint]


def _sympy() -> Any:
    try:
        import sympy
    except ImportError as error:
        raise ToolchainError("torque expressions need SymPy", "pip install 'psdmc[notebook]'") from error
    return sympy


def _parameters(sp: Any, l: int, theta_b: Array | None) -> list[Any]:
    if theta_b is not None:
        return [sp.Float(value) for value in theta_b.tolist()]
    return list(sp.symbols(f"theta_b:{l}", real=True))


def _factors(sp: Any, n: int) -> list[Any]:
    """The quantities that the rows of E are exponents of."""
    q, qd, qdd = (sp.symbols(f"{letters}1:{n + 1}", real=True) for letters in ("q", "qd", "qdd"))
    return [*q, *map(sp.sin, q), *map(sp.cos, q), *qd, *qdd]


def _monomial(sp: Any, expansion: Expansion, column: int, factors: list[Any], strength: Any) -> Any:
    """A column of E as a product; one without rates times |g|."""
    exponents = expansion.E[:, column]
    product = sp.Mul(*(factors[row] ** int(exponents[row]) for row in np.flatnonzero(exponents)))
    return product if exponents[RowBlocks.of(expansion.n).rates].any() else strength * product


def _number(sp: Any, value: float) -> Any:
    """A whole number as such, any other one as SymPy's float."""
    return sp.Integer(int(value)) if value.is_integer() else sp.Float(value)
