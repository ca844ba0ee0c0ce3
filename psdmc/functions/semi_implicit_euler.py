"""One step of semi-implicit Euler."""

from __future__ import annotations

from collections.abc import Callable

from psdmc.dynamics.manifold import integrated
from psdmc.program.signature import QD, TAU, Q, Signature
from psdmc.recipes.recipe import Arrays, Given, Ingredients, Outputs, Recipe, Reference, RobotOnArrays
from psdmc.recipes.steps import DT, Q_NEXT, QD_NEXT, step_on_arrays, stepped, turned
from psdmc.recipes.torques_and_accelerations import MASS_MATRIX, accelerations_and_pivots
from psdmc.robot.mechanism import Array


def trace(g: Ingredients) -> Outputs:
    (dt,) = g.inputs[DT.name]
    qdd, pivots = accelerations_and_pivots(g, g.inputs["tau"])
    rates = stepped(g.inputs["qd"], qdd, dt)
    q_next = integrated(g.frames, g.inputs["q"], [dt * rate for rate in rates])
    return {"q_next": q_next, "qd_next": rates, "pivot": pivots}


def reference(robot: RobotOnArrays, given: Given) -> Arrays:
    return _next(given, given["qdd"], lambda q, way: turned(robot.frames, q, way))


def pinocchio(robot: Reference, given: Given) -> Arrays:
    return _next(given, robot.forward_dynamics(given["q"], given["qd"], given["tau"]), robot.integrated)


def _next(given: Given, qdd: Array, moved: Callable[[Array, Array], Array]) -> Arrays:
    dt = step_on_arrays(given)
    rates = given["qd"] + dt * qdd
    return {"q_next": moved(given["q"], dt * rates), "qd_next": rates}


RECIPE = Recipe(
    Signature(
        "semi_implicit_euler",
        200,
        "the state after dt seconds: qd_next = qd + dt qdd, q_next = q + dt qd_next",
        (Q, QD, TAU, DT),
        (Q_NEXT, QD_NEXT),
        theta=True,
        summary="Compute the state after one step of semi-implicit Euler: qd_next = qd + dt qdd, q_next = q + dt "
        "qd_next. With a ball joint or a floating base, q_next = integrate(q, dt qd_next). qdd are the accelerations of "
        "forward dynamics.",
        factorises=(MASS_MATRIX,),
        spoilt="states",
    ),
    "step of semi-implicit Euler",
    trace,
    reference,
    "aba",
    pinocchio,
    starts="inverse_dynamics",
    accelerates=True,
)
