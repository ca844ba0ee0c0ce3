"""Impacts, and the gradient of weighted rates after the impact and impulses (reverse mode)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from psdmc.dynamics.constraints import Constraints
from psdmc.dynamics.scalar import ZERO, Scalar
from psdmc.dynamics.solve import inner_product
from psdmc.functions import impulse, impulse_derivatives
from psdmc.functions.impulse import BEFORE, RESTITUTION
from psdmc.program.signature import Q
from psdmc.recipes.contact_directions import ContactFunction
from psdmc.recipes.recipe import Ingredients
from psdmc.recipes.torques_and_accelerations import torques


def residuals(g: Ingredients, after: Sequence[Scalar], impulses: Sequence[Scalar]) -> list[Scalar]:
    """Return M times the change of the rates less J^T impulses, and J (after + restitution before), in the rows of loops
    J after."""
    q, before = g.inputs["q"], g.inputs[BEFORE.name]
    (restitution,) = g.inputs[RESTITUTION.name]
    of = Constraints(g.frames, g.named, g.loops, g.root)
    rows = of.jacobian(q)
    kicked = torques(
        replace(g, friction=None), g.still, [x - rate for x, rate in zip(after, before, strict=True)], ZERO
    )
    seen = [x + restitution * rate for x, rate in zip(after, before, strict=True)]
    return [
        *(x - inner_product(own, impulses) for x, own in zip(kicked, zip(*rows, strict=True), strict=True)),
        *(inner_product(row, seen) for row in rows[: of.contact_rows]),
        *(inner_product(row, after) for row in rows[of.contact_rows :]),
    ]


FUNCTION = ContactFunction(
    impulse.RECIPE, impulse_derivatives.RECIPE, (Q, BEFORE), impulse.solved_after, residuals
)

RECIPE = FUNCTION.gradient(
    354,
    "qd_after and impulses of an impact, and the gradient of cotangent_qd_after . qd_after + cotangent_impulses . impulses "
    "by q and qd_before",
    "Compute qd_after, the joint rates after an impact, and the contact impulses. Also compute gradients of a "
    "weighted sum by q and qd_before. The weighted sum adds all cotangent_qd_after[i] * qd_after[i] and all "
    "cotangent_impulses[i] * impulses[i].",
)
