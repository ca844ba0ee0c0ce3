"""One step of the classical Runge-Kutta method of fourth order."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from psdmc.dynamics.scalar import Scalar
from psdmc.program.signature import QD, TAU, Positive, Q, Quantity, Signature
from psdmc.recipes.accelerations import PIVOTS, accelerations
from psdmc.recipes.on_arrays import RobotOnArrays
from psdmc.recipes.recipe import Arrays, Ingredients, Outputs, Recipe
from psdmc.recipes.steps import DT, Q_NEXT, QD_NEXT, step_on_arrays, stepped
from psdmc.robot.mechanism import Array

if TYPE_CHECKING:
    from psdmc.robot.reference import Reference

STAGE_PIVOTS = Positive(
    Quantity("pivot", ("4", "nv")),
    which="the joint whose pivot is not positive, plus n for each stage of the step before",
    reason=PIVOTS.reason,
    spoilt="states",
)

State = tuple[Sequence[Scalar], Sequence[Scalar]]
"""q and qd, or their rates."""


def trace(g: Ingredients) -> Outputs:
    (dt,), pivots = g.inputs[DT.name], []

    def rates(q: Sequence[Scalar], qd: Sequence[Scalar]) -> Sequence[Scalar]:
        there = replace(g, inputs={"q": list(q), "qd": list(qd)})
        qdd, factors = accelerations(there, g.inputs["tau"])
        pivots.append(factors.pivots)
        return qdd

    q_next, qd_next = _step((g.inputs["q"], g.inputs["qd"]), rates, dt)
    return {"q_next": q_next, "qd_next": qd_next, "pivot": pivots}


def _step(
    start: State, rates: Callable[[Sequence[Scalar], Sequence[Scalar]], Sequence[Scalar]], dt: Scalar
) -> State:
    """The state after dt: the slopes at the start, twice in the middle and at the end have the weights 1/6, 2/6, 2/6,
    1/6."""
    q, qd = start
    half = 0.5 * dt
    velocities, slopes = [qd], [rates(q, qd)]
    for part in (half, half, dt):
        there = stepped(q, velocities[-1], part)
        velocities.append(stepped(qd, slopes[-1], part))
        slopes.append(rates(there, velocities[-1]))
    sixth = (1.0 / 6.0) * dt
    return stepped(q, _total(velocities), sixth), stepped(qd, _total(slopes), sixth)


def _total(slopes: Sequence[Sequence[Scalar]]) -> list[Scalar]:
    return [(a + d) + 2.0 * (b + c) for a, b, c, d in zip(*slopes, strict=True)]


def reference(robot: RobotOnArrays, given: Mapping[str, Array]) -> Arrays:
    return _on_arrays(given, lambda q, qd: robot.accelerations(q, qd, given["tau"]))


def pinocchio(robot: Reference, given: Mapping[str, Array]) -> Arrays:
    return _on_arrays(given, lambda q, qd: robot.forward_dynamics(q, qd, given["tau"]))


def _on_arrays(given: Mapping[str, Array], rates: Callable[[Array, Array], Array]) -> Arrays:
    """The same step on vectors of joints, (k, n), in place of lists of numbers."""
    dt = step_on_arrays(given)
    q, qd = given["q"], given["qd"]
    first = rates(q, qd)
    second = rates(q + dt / 2 * qd, qd + dt / 2 * first)
    third = rates(q + dt / 2 * (qd + dt / 2 * first), qd + dt / 2 * second)
    fourth = rates(q + dt * (qd + dt / 2 * second), qd + dt * third)
    q_next = q + dt * qd + dt**2 / 6 * (first + second + third)
    return {"q_next": q_next, "qd_next": qd + dt / 6 * (first + 2 * second + 2 * third + fourth)}


RECIPE = Recipe(
    Signature(
        "rk4_step",
        210,
        "the state after dt seconds at constant tau by the classical Runge-Kutta method of fourth order",
        (Q, QD, TAU, DT),
        (Q_NEXT, QD_NEXT),
        theta=True,
        positive=STAGE_PIVOTS,
    ),
    "step of fourth-order Runge-Kutta",
    trace,
    reference,
    "aba",
    pinocchio,
    shares="inverse_dynamics",
    of_axes=True,
)
