"""Forward dynamics and its derivatives by joint positions, rates and torques."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from psdmc.dynamics.arrow import Matrix, any_limbs, eliminated
from psdmc.dynamics.derivatives import Derivatives, inverse_dynamics_derivatives
from psdmc.dynamics.forward_dynamics import KNOWN_BY_Q, KNOWN_BY_QD, known_derivatives
from psdmc.dynamics.frames import has_floating_base
from psdmc.dynamics.newton_euler import NO_WRENCHES, Wrench
from psdmc.dynamics.scalar import Scalar
from psdmc.dynamics.solve import factorize, inner_product, inverse, solve
from psdmc.program.products import Product, Thin
from psdmc.program.signature import QD, QDD, TAU, THIN, Q, Signature, jacobian_of
from psdmc.recipes.recipe import Arrays, Given, Ingredients, Outputs, Recipe, Reference, RobotOnArrays
from psdmc.recipes.torques_and_accelerations import MASS_MATRIX, less_friction, with_friction_slopes
from psdmc.reproducible import inverse as inverted
from psdmc.reproducible import times


def trace(g: Ingredients) -> Outputs:
    """Compute accelerations and their derivatives: d qdd = M^-1 (d tau - d tau_id). The function tau_id(q, qd, qdd) is
    inverse dynamics, at the computed acceleration.

    M and d tau_id / d qd do not depend on the acceleration. The torques of Coriolis forces and gravity are h = (d
    tau_id / d qd) qd / 2 + g, because h - g is quadratic in qd. The derivatives of tau_id by q and qd are multiplied by
    M^-1 after these operations, by matrix products. The derivative by qd comes first, because its entries are known
    first.
    """
    return _in_limbs(g) if any_limbs(g.frames) else traced(g, g.inputs["tau"])


def traced(
    g: Ingredients, torques: Sequence[Scalar], external: Mapping[int, Wrench] = NO_WRENCHES
) -> Outputs:
    """Trace without limbs, also for other functions. `torques` are the sums of joint torques and of those of external
    wrenches on the links."""
    at_rest = _torque_derivatives(g, g.still)
    factors = factorize(at_rest.by_qdd)
    rates, gravity = g.inputs["qd"], at_rest.gravity
    bias = [0.5 * inner_product(row, rates) + own for row, own in zip(at_rest.by_qd, gravity, strict=True)]
    load = [tau - h for tau, h in zip(less_friction(g, torques), bias, strict=True)]
    accelerations = solve(factors, load)
    at_rest = with_friction_slopes(g, at_rest)
    moving = with_friction_slopes(g, _torque_derivatives(g, accelerations, external))
    by_tau = inverse(factors)
    return {
        "dtau_dqd": list(zip(*at_rest.by_qd, strict=True)),
        "qdd": accelerations,
        "dtau_dq": list(zip(*moving.by_q, strict=True)),
        "dqdd_dtau": by_tau,
        "pivot": factors.pivots,
    }


def _in_limbs(g: Ingredients) -> Outputs:
    """Compute the derivatives by thin factors, without a product of n x n matrices."""
    at_rest = _torque_derivatives(g, g.still)
    arrow = eliminated(g.frames, at_rest.by_qdd)
    load = [tau - own for tau, own in zip(g.inputs["tau"], at_rest.gravity, strict=True)]
    accelerations = arrow.solved(load, at_rest.by_qd, [0.5 * rate for rate in g.inputs["qd"]])
    moving = _torque_derivatives(g, accelerations)
    blocks: list[Matrix] = [moving.by_q, at_rest.by_qd]
    if has_floating_base(g.frames):
        known = known_derivatives(g.frames, g.inputs["q"], g.inputs["qd"], g.base_acceleration)
        thin = [
            _with_block(arrow.thin(_without_columns(matrix, count)), block, count - 3)
            for matrix, block, count in zip(blocks, known, (KNOWN_BY_Q, KNOWN_BY_QD), strict=True)
        ]
    else:
        thin = [arrow.thin(matrix) for matrix in blocks]
    return {
        "qdd": accelerations,
        "dqdd_dq": thin[0],
        "dqdd_dqd": thin[1],
        "dqdd_dtau": arrow.thin_inverse(),
        "pivot": arrow.pivots,
        THIN: arrow.thin_factors(),
    }


def _without_columns(matrix: Matrix, count: int) -> list[list[Scalar]]:
    """The matrix, with zeros in its first columns."""
    return [[0.0] * count + list(row[count:]) for row in matrix]


def _with_block(matrix: Matrix, block: Matrix, column: int) -> list[list[Scalar]]:
    """The matrix, with a block in its first rows."""
    found = [list(row) for row in matrix]
    for row, values in zip(found, block, strict=False):
        row[column : column + len(values)] = values
    return found


def multiplied(g: Ingredients) -> Outputs:
    """Return accelerations and their derivatives like `trace`, with the products with M^-1 written out. Functions such
    as the Runge-Kutta step use the result in further computations."""
    found = trace(g)
    by_tau = found["dqdd_dtau"]
    blocks = {
        f"dqdd_d{by}": [[-inner_product(row, column) for column in found[f"dtau_d{by}"]] for row in by_tau]
        for by in ("q", "qd")
    }
    return {"qdd": found["qdd"], **blocks, "dqdd_dtau": by_tau, "pivot": found["pivot"]}


def _torque_derivatives(
    g: Ingredients, qdd: Sequence[Scalar], external: Mapping[int, Wrench] = NO_WRENCHES
) -> Derivatives:
    q, qd = g.inputs["q"], g.inputs["qd"]
    return inverse_dynamics_derivatives(
        g.frames, g.bodies, g.drives, q, qd, qdd, g.base_acceleration, g.choices, external
    )


def reference(robot: RobotOnArrays, given: Given) -> Arrays:
    by_q, by_qd, by_qdd = robot.torque_derivatives(given["q"], given["qd"], given["qdd"])
    by_tau = inverted(by_qdd)
    return {
        "qdd": given["qdd"],
        "dqdd_dq": -times(by_tau, by_q),
        "dqdd_dqd": -times(by_tau, by_qd),
        "dqdd_dtau": by_tau,
    }


def pinocchio(robot: Reference, given: Given) -> Arrays:
    qdd, by_q, by_qd, by_tau = robot.forward_dynamics_derivatives(given["q"], given["qd"], given["tau"])
    return {"qdd": qdd, "dqdd_dq": by_q, "dqdd_dqd": by_qd, "dqdd_dtau": by_tau}


RECIPE = Recipe(
    Signature(
        "forward_dynamics_derivatives",
        22,
        "qdd, d qdd / d q, d qdd / d qd and d qdd / d tau = M(q)^-1; row i: derivatives of qdd[i]",
        (Q, QD, TAU),
        (QDD, *(jacobian_of("qdd", by) for by in ("q", "qd", "tau"))),
        theta=True,
        summary="Compute the accelerations qdd of forward dynamics. Also compute the derivatives of qdd by q, qd and "
        "tau.",
        factorises=(MASS_MATRIX,),
        products=(Product("dqdd_dq", "dqdd_dtau", "dtau_dq"), Product("dqdd_dqd", "dqdd_dtau", "dtau_dqd")),
        thin=(Thin("dqdd_dq", KNOWN_BY_Q), Thin("dqdd_dqd", KNOWN_BY_QD), Thin("dqdd_dtau")),
    ),
    "derivatives of forward dynamics",
    trace,
    reference,
    "computeABADerivatives",
    pinocchio,
    shares="inverse_dynamics",
    in_limbs=True,
    benched=True,
)
