"""Impacts and their derivatives along a direction (forward mode)."""

from psdmc.functions.impulse_vjp import FUNCTION

RECIPE = FUNCTION.along(
    356,
    "qd_after and impulses of an impact, and their derivatives along (dq, dqd_before)",
    "Compute qd_after, the rates after an impact, and the impulses. Also compute derivatives of qd_after and "
    "impulses along the direction (dq, dqd_before). The inputs q and qd_before change together along this "
    "direction.",
)
