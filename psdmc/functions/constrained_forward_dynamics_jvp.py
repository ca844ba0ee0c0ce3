"""Forward dynamics with contacts and its derivative along a direction (forward mode)."""

from psdmc.functions.constrained_forward_dynamics_vjp import FUNCTION

RECIPE = FUNCTION.along(
    346,
    "qdd and forces of constrained_forward_dynamics, and their derivatives along (dq, dqd, dtau, derror)",
    "Compute the joint accelerations and the contact forces that torques cause. Also compute derivatives of qdd "
    "and forces along the direction (dq, dqd, dtau, derror). The inputs q, qd, tau and `error`, the displacement "
    "of the contacts, change together along this direction.",
)
