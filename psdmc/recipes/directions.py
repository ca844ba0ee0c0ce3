"""Derivatives along a given change of the inputs, and gradients of weighted sums of the outputs, for joint torques."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from psdmc import reproducible
from psdmc.dynamics.manifold import coordinate_rates, pulled_back
from psdmc.dynamics.newton_euler import NO_WRENCHES, Wrench
from psdmc.dynamics.scalar import Scalar
from psdmc.program import dimensions
from psdmc.program.interpret import substituted
from psdmc.program.signature import QD, QDD, TAU, Q, Quantity, Signature
from psdmc.program.slopes import gradients, slopes
from psdmc.recipes.recipe import Arrays, Given, Ingredients, Outputs, Recipe, Reference, RobotOnArrays
from psdmc.recipes.torques_and_accelerations import torques
from psdmc.reproducible import times
from psdmc.robot.mechanism import Array

COTANGENT = Quantity(
    "cotangent", ("nv",), means="weights of the sum: cotangent[i] multiplies tau[i]", unit="1", powers=(1,)
)
"""Of torques; their weighted sum, and that of accelerations, has the unit of energy here."""

COTANGENT_OF_QDD = replace(COTANGENT, means=COTANGENT.means.replace("tau", "qdd"), unit="J s^2", powers=(-1,))


def direction_of(quantity: Quantity) -> Quantity:
    """A change of this input: a vector that is its direction."""
    name, axes = quantity.name, ("nv",) if quantity is Q else quantity.axes
    which = name if quantity.default is None else f"the argument `{name}`"
    means = f"derivative of {which} by e: for a small number e, the new value is {name} + e d{name}"
    if quantity is Q:
        means += ", or integrate(q, e dq) if the robot has a ball joint or a floating base"
    return replace(quantity, name=f"d{name}", axes=axes, largest=1.0, means=means, default=None)


def along_direction(quantity: Quantity) -> Quantity:
    """The derivative of this output along a direction of the inputs."""
    name = quantity.name
    means = (
        f"derivative of {name} by e at e = 0: for a small number e, the change of {name} is about e d{name}"
    )
    return replace(quantity, name=f"d{name}", means=means)


def gradient_by(quantity: Quantity) -> Quantity:
    """The gradient of a weighted sum, which has the unit of energy, by this input."""
    return Quantity(
        f"grad_{quantity.name}",
        ("nv",) if quantity is Q else quantity.axes,
        means=f"gradient of the weighted sum by {quantity.name}: entry j is the derivative by {quantity.name}[j]",
        unit=str(dimensions.times(dimensions.dimension_of("J"), quantity.dimension, -1)),
        powers=(-quantity.powers[0],),
        by_q=quantity is Q,
    )


DQ, DQD, DQDD, DTAU = map(direction_of, (Q, QD, QDD, TAU))
"""Directions of inputs, and derivatives of outputs along them."""

GRADIENT_Q, GRADIENT_QD, GRADIENT_QDD, GRADIENT_TAU = map(gradient_by, (Q, QD, QDD, TAU))
GRADIENT_THETA = Quantity(
    "grad_theta_b", ("l",), means="gradient of the weighted sum by theta_b", unit="J", powers=(-1,)
)
"""Derivatives of the weighted sum of outputs by each input."""


def hessian_of(last: Quantity, axis: str) -> Quantity:
    """The symmetric matrix of second derivatives of a weighted sum by q, qd and a third quantity."""
    means = (
        "symmetric matrix of the second derivatives of the weighted sum. The first nv rows and columns are for q, the next "
        f"nv for qd, the last nv for {last.name}"
    )
    return Quantity("hessian", (axis, axis), means=means, unit="J", powers=(-1, -1), by_q=True)


_FREE = "free_qdd"
"""Name of an input that no function has: the accelerations while torques are differentiated."""


def torque_gradients(
    g: Ingredients,
    qdd: Sequence[Scalar],
    weights: Sequence[Scalar],
    external: Mapping[int, Wrench] = NO_WRENCHES,
    others: Sequence[Any] = (),
) -> tuple[list[Scalar], list[Scalar], list[Scalar]]:
    """Return the gradients of the weighted sum of torques, sum of weights[i] tau[i], by q and by qd, nv entries each.
    The accelerations `qdd` count as constants.

    The entries for q are for small motions along the joint rates; a quaternion moves by small rotations.
    """
    q, qd, free = g.inputs["q"], g.inputs["qd"], _free(g, qdd)
    tau = torques(g, qd, free, g.base_acceleration, external=external)
    by_q, by_qd, by_others = gradients(tau, weights, (q, qd, others))
    found = substituted([*by_q, *by_qd, *by_others], free, qdd)
    by_q, by_qd, by_others = found[: len(q)], found[len(q) : len(q) + len(qd)], found[len(q) + len(qd) :]
    return pulled_back(g.frames, q, by_q), by_qd, by_others


def parameter_gradient(g: Ingredients, qdd: Sequence[Scalar], weights: Sequence[Scalar]) -> list[Scalar]:
    """Return the l derivatives of the weighted sum of torques, sum of weights[i] tau[i], by the base parameters
    theta_b. They are Y^T weights, where Y is the regressor. The accelerations `qdd` count as constants."""
    theta_b, bodies, drives = g.by_theta()
    loose, free = replace(g, bodies=bodies, drives=drives), _free(g, qdd)
    (found,) = gradients(torques(loose, g.inputs["qd"], free, g.base_acceleration), weights, (theta_b,))
    return substituted(found, free, qdd)


def torque_slopes(
    g: Ingredients,
    qdd: Sequence[Scalar],
    external: Mapping[int, Wrench] = NO_WRENCHES,
    others: Sequence[Any] = (),
    along: Sequence[Scalar] = (),
) -> list[Scalar]:
    """Return the derivatives of the joint torques along the changes dq of q and dqd of qd. The accelerations `qdd`
    count as constants."""
    q, qd, free = g.inputs["q"], g.inputs["qd"], _free(g, qdd)
    tau = torques(g, qd, free, g.base_acceleration, external=external)
    direction = [*coordinate_rates(g.frames, q, g.inputs[DQ.name]), *g.inputs[DQD.name], *along]
    return substituted(slopes(tau, [*q, *qd, *others], direction), free, qdd)


def _free(g: Ingredients, qdd: Sequence[Scalar]) -> list[Scalar]:
    """Accelerations as inputs, so that a derivative at fixed accelerations does not follow what they are computed from."""
    found: list[Scalar] = g.inputs["q"][0].tracer.stand_ins(_FREE, qdd)
    return found


def solved(matrices: Array, right: Array) -> Array:
    """(k, n) matrix^-1 right, state by state."""
    return reproducible.solved(matrices, right[..., None])[..., 0]


def weighted(weights: Array, matrices: Array) -> Array:
    """(k, ...) weights^T matrix (k, n, ...), state by state."""
    count, rows, *others = matrices.shape
    found = times(weights[:, None], matrices.reshape(count, rows, -1))[:, 0]
    return np.asarray(found.reshape(count, *others))


def along(matrices: Array, direction: Array) -> Array:
    """(k, n) matrix direction, state by state."""
    return np.asarray(times(matrices, direction[..., None])[..., 0])


def with_parameter_gradient(
    state: Recipe,
    order: int,
    meaning: str,
    summary: str,
    trace: Callable[[Ingredients], Outputs],
    reference: Callable[[RobotOnArrays, Given], Arrays],
    pinocchio: Callable[[Reference, Given], Arrays],
) -> Recipe:
    """Return the recipe of a function NAME_parameters. It has the outputs of the function NAME (recipe `state`), and
    the gradient by theta_b as an additional output."""
    known = state.signature
    return Recipe(
        Signature(
            f"{known.name}_parameters",
            order,
            meaning,
            known.inputs,
            (*known.outputs, GRADIENT_THETA),
            theta=True,
            factorises=known.factorises,
            spoilt=known.spoilt,
            summary=summary,
        ),
        f"{state.title}, by parameters too",
        trace,
        reference,
        state.against,
        pinocchio,
        shares=state.shares,
        gradient=GRADIENT_THETA.name,
        closes=state.closes,
    )
