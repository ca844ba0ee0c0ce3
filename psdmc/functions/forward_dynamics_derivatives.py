"""Forward dynamics and its derivatives by joint positions, rates and torques."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from psdmc.dynamics.derivatives import Derivatives, inverse_dynamics_derivatives
from psdmc.dynamics.scalar import Scalar
from psdmc.dynamics.solve import factorize, inverse, solve
from psdmc.program.signature import QD, QDD, TAU, Q, Quantity, Signature
from psdmc.recipes.accelerations import PIVOTS
from psdmc.recipes.on_arrays import RobotOnArrays
from psdmc.recipes.recipe import Arrays, Ingredients, Outputs, Recipe
from psdmc.robot.mechanism import Array

if TYPE_CHECKING:
    from psdmc.robot.reference import Reference


def trace(g: Ingredients) -> Outputs:
    """d qdd = M^-1 (d tau - d tau_id); tau_id are the torques of inverse dynamics at the same acceleration.

    M and d tau_id / d qd need no acceleration; h = (d tau_id / d qd) qd / 2 + g, as h - g is quadratic in qd.
    """
    at_rest = _torque_derivatives(g, g.still)
    factors = factorize(at_rest.by_qdd)
    rates, gravity = g.inputs["qd"], at_rest.gravity
    bias = [0.5 * _product(row, rates) + own for row, own in zip(at_rest.by_qd, gravity, strict=True)]
    load = [tau - h for tau, h in zip(g.inputs["tau"], bias, strict=True)]
    accelerations = solve(factors, load)
    moving = _torque_derivatives(g, accelerations)
    by_tau = inverse(factors)
    return {
        "qdd": accelerations,
        "dqdd_dq": _minus_product(by_tau, moving.by_q),
        "dqdd_dqd": _minus_product(by_tau, moving.by_qd),
        "dqdd_dtau": by_tau,
        "pivot": factors.pivots,
    }


def _torque_derivatives(g: Ingredients, qdd: Sequence[Scalar]) -> Derivatives:
    q, qd = g.inputs["q"], g.inputs["qd"]
    return inverse_dynamics_derivatives(
        g.frames, g.bodies, g.drives, q, qd, qdd, g.base_acceleration, g.choices
    )


def _product(a: Sequence[Scalar], b: Sequence[Scalar]) -> Scalar:
    total: Scalar = 0.0
    for x, y in zip(a, b, strict=True):
        total = total + x * y
    return total


def _minus_product(a: Sequence[Sequence[Scalar]], b: Sequence[Sequence[Scalar]]) -> list[list[Scalar]]:
    """- a b"""
    columns = list(zip(*b, strict=True))
    return [[-_product(row, column) for column in columns] for row in a]


def reference(robot: RobotOnArrays, given: Mapping[str, Array]) -> Arrays:
    by_q, by_qd, by_qdd = robot.torque_derivatives(given["q"], given["qd"], given["qdd"])
    by_tau = np.linalg.inv(by_qdd).astype(np.float64)
    return {"qdd": given["qdd"], "dqdd_dq": -by_tau @ by_q, "dqdd_dqd": -by_tau @ by_qd, "dqdd_dtau": by_tau}


def pinocchio(robot: Reference, given: Mapping[str, Array]) -> Arrays:
    qdd, by_q, by_qd, by_tau = robot.forward_dynamics_derivatives(given["q"], given["qd"], given["tau"])
    return {"qdd": qdd, "dqdd_dq": by_q, "dqdd_dqd": by_qd, "dqdd_dtau": by_tau}


RECIPE = Recipe(
    Signature(
        "forward_dynamics_derivatives",
        22,
        "qdd, d qdd / d q, d qdd / d qd and d qdd / d tau = M(q)^-1; row i: derivatives of qdd[i]",
        (Q, QD, TAU),
        (QDD, *(Quantity(name, ("nv", "nv")) for name in ("dqdd_dq", "dqdd_dqd", "dqdd_dtau"))),
        theta=True,
        positive=PIVOTS,
    ),
    "derivatives of forward dynamics",
    trace,
    reference,
    "computeABADerivatives",
    pinocchio,
    shares="inverse_dynamics",
    benched=True,
)
