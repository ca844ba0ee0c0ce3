"""Impacts and their derivatives along a direction (forward mode)."""

from psdmc.functions.impulse_vjp import FUNCTION

RECIPE = FUNCTION.along(
    356,
    "qd_after and impulses of an impact, and their derivatives along (dq, dqd_before)",
    "Compute qd_after, the joint rates after an impact, and the contact impulses. Also compute derivatives of "
    "both along a direction (dq, dqd_before). Let the inputs change by e dq and e dqd_before, with a small number "
    "e. Then qd_after changes by about e dqd_after, and impulses change by about e dimpulses.",
)
