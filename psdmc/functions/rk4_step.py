"""One step of the classical Runge-Kutta method of fourth order."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from psdmc.dynamics.manifold import coordinate_rates, restored
from psdmc.dynamics.scalar import Scalar
from psdmc.program.signature import QD, TAU, Q, Signature
from psdmc.recipes.on_arrays import RobotOnArrays, columns
from psdmc.recipes.recipe import Arrays, Given, Ingredients, Outputs, Recipe, Reference
from psdmc.recipes.steps import DT, Q_NEXT, QD_NEXT, step_on_arrays, stepped
from psdmc.recipes.torques_and_accelerations import MASS_MATRIX, accelerations_and_pivots
from psdmc.robot.mechanism import Array

MASS_MATRICES = MASS_MATRIX.in_blocks(
    "4",
    number=f"{MASS_MATRIX.number}, + n times the stage of the step",
    failure=f"{MASS_MATRIX.failure} or at an intermediate point of its step",
)

State = tuple[Sequence[Scalar], Sequence[Scalar]]
"""q and qd, or their rates."""


def trace(g: Ingredients) -> Outputs:
    (dt,), pivots = g.inputs[DT.name], []

    def rates(q: Sequence[Scalar], qd: Sequence[Scalar]) -> State:
        there = replace(g, inputs={"q": list(q), "qd": list(qd)})
        qdd, found = accelerations_and_pivots(there, g.inputs["tau"])
        pivots.append(found)
        return coordinate_rates(g.frames, q, qd), qdd

    q_next, qd_next = runge_kutta_step(
        (g.inputs["q"], g.inputs["qd"]), rates, lambda q: restored(g.frames, q), dt
    )
    return {"q_next": q_next, "qd_next": qd_next, "pivot": pivots}


def runge_kutta_step(
    start: State,
    rates: Callable[[Sequence[Scalar], Sequence[Scalar]], State],
    unit: Callable[[Sequence[Scalar]], Sequence[Scalar]],
    dt: Scalar,
) -> State:
    """Return the state after a step of dt: the start plus dt times a weighted mean of four slopes. The slopes are those
    at the start, twice in the middle and at the end of the step, with the weights 1/6, 2/6, 2/6 and 1/6.

    `rates` returns the rates of the entries of q and of qd, and `unit` scales quaternions to length one. Between stages,
    the length of a quaternion changes by the second order of dt. Scaling it at each stage keeps the method's order.
    """
    q, qd = start
    half = 0.5 * dt
    slopes = [rates(q, qd)]
    for part in (half, half, dt):
        moved, pushed = slopes[-1]
        slopes.append(rates(unit(stepped(q, moved, part)), stepped(qd, pushed, part)))
    sixth = (1.0 / 6.0) * dt
    ways, kicks = zip(*slopes, strict=True)
    return unit(stepped(q, total_of(ways), sixth)), stepped(qd, total_of(kicks), sixth)


def total_of(slopes: Sequence[Sequence[Scalar]]) -> list[Scalar]:
    """Return six times the mean of the slopes at the four stages of a step, entry by entry."""
    return [(a + d) + 2.0 * (b + c) for a, b, c, d in zip(*slopes, strict=True)]


def reference(robot: RobotOnArrays, given: Given) -> Arrays:
    def rates(q: Array, qd: Array) -> tuple[Array, Array]:
        moved = coordinate_rates(robot.frames, list(q.T), list(qd.T))
        return columns(moved, len(q)), robot.accelerations(q, qd, given["tau"])

    return step_of_arrays(given, rates, lambda q: columns(restored(robot.frames, list(q.T)), len(q)))


def pinocchio(robot: Reference, given: Given) -> Arrays:
    def rates(q: Array, qd: Array) -> tuple[Array, Array]:
        return robot.coordinate_rates(q, qd), robot.forward_dynamics(q, qd, given["tau"])

    return step_of_arrays(given, rates, robot.restored)


def step_of_arrays(
    given: Given,
    rates: Callable[[Array, Array], tuple[Array, Array]],
    unit: Callable[[Array], Array],
) -> Arrays:
    """Compute the state after a step of dt in NumPy, from arrays q (k, nq) and qd (k, nv) of k states. `rates` returns the
    rates of the entries of q and of qd, and `unit` scales quaternions to length one."""
    dt = step_on_arrays(given)
    q, qd = given["q"], given["qd"]
    first = rates(q, qd)
    second = rates(unit(q + dt / 2 * first[0]), qd + dt / 2 * first[1])
    third = rates(unit(q + dt / 2 * second[0]), qd + dt / 2 * second[1])
    fourth = rates(unit(q + dt * third[0]), qd + dt * third[1])
    way, kick = (a + 2 * b + 2 * c + d for a, b, c, d in zip(first, second, third, fourth, strict=True))
    return {"q_next": unit(q + dt / 6 * way), "qd_next": qd + dt / 6 * kick}


RECIPE = Recipe(
    Signature(
        "rk4_step",
        210,
        "the state after dt seconds at constant tau by the classical Runge-Kutta method of fourth order",
        (Q, QD, TAU, DT),
        (Q_NEXT, QD_NEXT),
        theta=True,
        summary="Compute the state after one step of the classical fourth-order Runge-Kutta method, with constant torques.",
        factorises=(MASS_MATRICES,),
        spoilt="states",
    ),
    "step of fourth-order Runge-Kutta",
    trace,
    reference,
    "aba",
    pinocchio,
    shares="inverse_dynamics",
    accelerates=True,
)
