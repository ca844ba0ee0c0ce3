"""Forward dynamics with contacts, and the gradient of weighted accelerations and contact forces (reverse mode)."""

from __future__ import annotations

from collections.abc import Sequence

from psdmc.dynamics.closed_loops import loop_drift, loop_error
from psdmc.dynamics.constraints import Constraints, contact_accelerations
from psdmc.dynamics.scalar import Scalar
from psdmc.dynamics.solve import inner_product
from psdmc.functions import constrained_forward_dynamics, constrained_forward_dynamics_derivatives
from psdmc.functions.constrained_forward_dynamics import ERROR, KD, KP
from psdmc.program.signature import QD, TAU, Q
from psdmc.recipes.contact_directions import ContactFunction
from psdmc.recipes.recipe import Ingredients
from psdmc.recipes.torques_and_accelerations import torques


def residuals(g: Ingredients, qdd: Sequence[Scalar], forces: Sequence[Scalar]) -> list[Scalar]:
    """Return the torques of inverse dynamics less tau and J^T forces, and by how much accelerations are too large.

    The accelerations are those of contacts and loops, without the part of the forces."""
    q, qd, tau = (g.inputs[name] for name in ("q", "qd", "tau"))
    (kp,), (kd,) = (g.inputs[each.name] for each in (KP, KD))
    of = Constraints(g.frames, g.named, g.loops, g.root)
    rows, errors = of.jacobian(q), list(g.inputs[ERROR.name])
    pushed = zip(*rows, strict=True)
    own = torques(g, qd, qdd, g.base_acceleration)
    damped = [x + kd * rate for x, rate in zip(qdd, qd, strict=True)]
    moved = contact_accelerations(g.frames, g.named, q, qd, damped, g.root)
    if g.loops:
        drifts = loop_drift(g.frames, g.loops, q, qd, g.root)
        held = rows[of.contact_rows :]
        moved += [own + inner_product(row, damped) for own, row in zip(drifts, held, strict=True)]
        errors += loop_error(g.frames, g.loops, q, g.root)
    return [
        *(x - given - inner_product(row, forces) for x, given, row in zip(own, tau, pushed, strict=True)),
        *(x + kp * error for x, error in zip(moved, errors, strict=True)),
    ]


FUNCTION = ContactFunction(
    constrained_forward_dynamics.RECIPE,
    constrained_forward_dynamics_derivatives.RECIPE,
    (Q, QD, TAU, ERROR),
    constrained_forward_dynamics.solved,
    residuals,
)

RECIPE = FUNCTION.gradient(
    344,
    "qdd and forces of constrained_forward_dynamics, and the gradient of cotangent_qdd . qdd + cotangent_forces . forces "
    "by q, qd, tau and error",
    "Compute the accelerations qdd and contact forces that torques cause. Also compute gradients of a weighted "
    "sum by q, qd, tau and error. The weighted sum adds all cotangent_qdd[i] * qdd[i] and all "
    "cotangent_forces[i] * forces[i]. The input `error` is the displacement of the contacts.",
)
