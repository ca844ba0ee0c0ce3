"""Impacts and their derivatives along a direction (forward mode)."""

from psdmc.functions.impulse_vjp import FUNCTION

RECIPE = FUNCTION.along(
    356,
    "qd_after and impulses of an impact, and their derivatives along (dq, dqd_before)",
    "Compute the joint rates after an impact and its impulses, and their derivatives along the direction "
    "(dq, dqd_before).",
)
