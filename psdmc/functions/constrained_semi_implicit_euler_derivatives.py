"""One step of semi-implicit Euler of a robot with contacts, and its Jacobians."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from psdmc.dynamics.constraints import Constraints
from psdmc.dynamics.frames import Frame
from psdmc.dynamics.manifold import integrated, step_slopes
from psdmc.functions import constrained_forward_dynamics_derivatives, constrained_semi_implicit_euler
from psdmc.functions.constrained_forward_dynamics import ERROR
from psdmc.functions.semi_implicit_euler_derivatives import state_and_jacobians
from psdmc.program.regions import Call, Regions
from psdmc.program.signature import PIVOTS, Quantity, Signature
from psdmc.recipes.contact_derivatives import Counts
from psdmc.recipes.loops import Block, copied
from psdmc.recipes.recipe import Arrays, Given, Ingredients, Outputs, Recipe, Reference, RobotOnArrays
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
from psdmc.robot.mechanism import Array, Loop, NamedFrame

STEP = constrained_semi_implicit_euler.RECIPE
ACCELERATIONS = constrained_forward_dynamics_derivatives.RECIPE
_, FORCES, *BLOCKS = ACCELERATIONS.signature.outputs
OF_RATES, OF_FORCES = BLOCKS[:4], BLOCKS[4:]
"""Derivatives of the accelerations and of the contact forces by q, qd, tau and error."""

B_ERROR = Quantity(
    "B_error",
    ("nx", *ERROR.axes),
    means="derivatives of the new state (q_next, qd_next) by error, with the rows of A",
    unit="1",
    powers=(1, *(-power for power in ERROR.powers)),
)


def trace(g: Ingredients) -> Outputs:
    (dt,) = g.inputs[DT.name]
    found = ACCELERATIONS.trace(g)
    rates = stepped(g.inputs["qd"], found["qdd"], dt)
    slopes = step_slopes(g.frames, rates, dt)
    by_q, by_qd, by_tau, by_error = (found[block.name] for block in OF_RATES)
    by_state, by_torque = semi_implicit(by_q, by_qd, by_tau, dt, slopes)
    return {
        "q_next": integrated(g.frames, g.inputs["q"], [dt * rate for rate in rates]),
        "qd_next": rates,
        FORCES.name: found[FORCES.name],
        A.name: by_state,
        B.name: by_torque,
        B_ERROR.name: semi_implicit(by_q, by_qd, by_error, dt, slopes)[1],
        **{block.name: found[block.name] for block in OF_FORCES},
        PIVOTS: found[PIVOTS],
    }


def regions(frames: Sequence[Frame], named: Sequence[NamedFrame], loops: Sequence[Loop] = ()) -> Regions:
    """Return the function's body: a call of the derivatives of forward dynamics with contacts, and loops. Results of the
    call are internal arrays; those that are copied to outputs are named `of_` and the output's name."""
    counts = Counts.of(Constraints(frames, named, loops))
    nv, rows, errors = counts.nv, counts.rows, counts.contact_rows
    widths = dict(zip((block.name for block in BLOCKS), 2 * (nv, nv, nv, errors), strict=True))
    by = [block.name for block in OF_RATES]
    kept = {FORCES.name: 1} | {block.name: widths[block.name] for block in OF_FORCES}
    results = {"qdd": nv, f"of_{FORCES.name}": rows} | {name: nv * widths[name] for name in by}
    results |= {f"of_{block.name}": rows * widths[block.name] for block in OF_FORCES}
    given = tuple((each.name, 0) for each in ACCELERATIONS.signature.inputs)
    call = Call(ACCELERATIONS.name, given, tuple((name, 0) for name in results), nv + counts.constraints)
    arrays, body = state_and_jacobians(frames, by, ((B.name, nv), (B_ERROR.name, errors)))
    copies = (
        copied(rows, width, Block(f"of_{name}", width), Block(name, width)) for name, width in kept.items()
    )
    return Regions({**results, "step": 1, **arrays}, (call, *body, *copies))


def reference(robot: RobotOnArrays, given: Given) -> Arrays:
    found = STEP.reference(robot, given)
    slopes = slopes_on_arrays(robot.frames, step_on_arrays(given) * found["qd_next"])
    return found | _jacobians(ACCELERATIONS.reference(robot, given), given, slopes)


def pinocchio(robot: Reference, given: Given) -> Arrays:
    found = STEP.pinocchio(robot, given)
    slopes = robot.integrated_slopes(given["q"], step_on_arrays(given) * found["qd_next"])
    return found | _jacobians(ACCELERATIONS.pinocchio(robot, given), given, slopes)


def _jacobians(found: Arrays, given: Given, slopes: tuple[Array, Array]) -> Arrays:
    by_q, by_qd, by_tau, by_error = (found[block.name] for block in OF_RATES)
    nv, both = by_tau.shape[-1], np.concatenate([by_tau, by_error], axis=-1)
    by_state, by_input = semi_implicit_on_arrays(by_q, by_qd, both, step_on_arrays(given), slopes)
    jacobians = {A.name: by_state, B.name: by_input[..., :nv], B_ERROR.name: by_input[..., nv:]}
    return jacobians | {block.name: found[block.name] for block in OF_FORCES}


RECIPE = Recipe(
    Signature(
        "constrained_semi_implicit_euler_derivatives",
        502,
        "the state after dt seconds and the forces of constrained_semi_implicit_euler, and their derivatives: of the state "
        "A by (q, qd), B by tau, B_error by error (rows: q_next, then qd_next); those by q hold error constant",
        STEP.signature.inputs,
        (*STEP.signature.outputs, A, B, B_ERROR, *OF_FORCES),
        theta=True,
        summary="Compute the state after a semi-implicit Euler step with contacts, and the contact forces. Also "
        "compute their derivatives by q, qd, tau and error. The input `error` is the displacement of the contacts. "
        "The derivatives by q hold `error` constant.",
        factorises=STEP.signature.factorises,
        calls=(ACCELERATIONS.name, *ACCELERATIONS.signature.calls),
    ),
    "Jacobians of a step of semi-implicit Euler with contacts",
    trace,
    reference,
    f"{ACCELERATIONS.against}, dIntegrate",
    pinocchio,
    shares="inverse_dynamics",
    regions=regions,
    closes=True,
)
