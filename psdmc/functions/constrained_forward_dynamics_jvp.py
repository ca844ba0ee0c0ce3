"""Forward dynamics with contacts and its derivative along a direction (forward mode)."""

from psdmc.functions.constrained_forward_dynamics_vjp import FUNCTION

RECIPE = FUNCTION.along(
    346,
    "qdd and forces of constrained_forward_dynamics, and their derivatives along (dq, dqd, dtau, derror)",
    "Compute the accelerations qdd and contact forces that torques cause. Also compute derivatives of both along "
    "a direction (dq, dqd, dtau, derror). Let each input change by e times its part of the direction, with a "
    "small number e. Then qdd changes by about e dqdd, and forces change by about e dforces. The input `error` is "
    "the displacement of the contacts.",
)
