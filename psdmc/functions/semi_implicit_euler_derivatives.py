"""One step of semi-implicit Euler and its Jacobians."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from psdmc.dynamics.manifold import integrated
from psdmc.dynamics.tangent_steps import step_slopes
from psdmc.functions import forward_dynamics_derivatives, semi_implicit_euler
from psdmc.program.signature import Signature
from psdmc.recipes.on_arrays import RobotOnArrays
from psdmc.recipes.recipe import Arrays, Ingredients, Outputs, Recipe
from psdmc.recipes.steps import (
    DT,
    A,
    B,
    semi_implicit,
    semi_implicit_on_arrays,
    slopes_on_arrays,
    step_on_arrays,
    stepped,
)
from psdmc.robot.mechanism import Array

if TYPE_CHECKING:
    from psdmc.robot.reference import Reference

STEP = semi_implicit_euler.RECIPE
ACCELERATIONS = forward_dynamics_derivatives.RECIPE


def trace(g: Ingredients) -> Outputs:
    (dt,) = g.inputs[DT.name]
    found = forward_dynamics_derivatives.multiplied(g)
    rates = stepped(g.inputs["qd"], found["qdd"], dt)
    blocks = (found["dqdd_dq"], found["dqdd_dqd"], found["dqdd_dtau"])
    by_state, by_torque = semi_implicit(*blocks, dt, step_slopes(g.frames, rates, dt))
    return {
        "q_next": integrated(g.frames, g.inputs["q"], [dt * rate for rate in rates]),
        "qd_next": rates,
        "A": by_state,
        "B": by_torque,
        "pivot": found["pivot"],
    }


def reference(robot: RobotOnArrays, given: Mapping[str, Array]) -> Arrays:
    found = STEP.reference(robot, given)
    slopes = slopes_on_arrays(robot.frames, step_on_arrays(given) * found["qd_next"])
    return found | _jacobians(ACCELERATIONS.reference(robot, given), given, slopes)


def pinocchio(robot: Reference, given: Mapping[str, Array]) -> Arrays:
    found = STEP.pinocchio(robot, given)
    slopes = robot.integrated_slopes(given["q"], step_on_arrays(given) * found["qd_next"])
    return found | _jacobians(ACCELERATIONS.pinocchio(robot, given), given, slopes)


def _jacobians(found: Arrays, given: Mapping[str, Array], slopes: tuple[Array, Array]) -> Arrays:
    by_q, by_qd, by_tau = (found[name] for name in ("dqdd_dq", "dqdd_dqd", "dqdd_dtau"))
    by_state, by_torque = semi_implicit_on_arrays(by_q, by_qd, by_tau, step_on_arrays(given), slopes)
    return {"A": by_state, "B": by_torque}


RECIPE = Recipe(
    Signature(
        "semi_implicit_euler_derivatives",
        202,
        "the state after dt seconds, and its derivatives A by (q, qd) and B by tau; rows: q_next, then qd_next",
        STEP.signature.inputs,
        (*STEP.signature.outputs, A, B),
        theta=True,
        summary="Compute the state after one step of semi-implicit Euler, and that state's derivatives by q, qd and tau.",
        factorises=STEP.signature.factorises,
        spoilt=STEP.signature.spoilt,
    ),
    "Jacobians of a step of semi-implicit Euler",
    trace,
    reference,
    "aba, computeABADerivatives, dIntegrate",
    pinocchio,
    shares="inverse_dynamics",
)
