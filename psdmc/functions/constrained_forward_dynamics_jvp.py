"""Forward dynamics with contacts and its derivative along a direction (forward mode)."""

from psdmc.functions.constrained_forward_dynamics_vjp import FUNCTION

RECIPE = FUNCTION.along(
    346,
    "qdd and forces of constrained_forward_dynamics, and their derivatives along (dq, dqd, dtau, derror)",
    "Compute the accelerations qdd and contact forces that torques cause. Also compute derivatives of both along "
    "a direction (dq, dqd, dtau, derror). If each input changes by e times its part of the direction, with a "
    "small number e, qdd changes by about e dqdd.",
)
