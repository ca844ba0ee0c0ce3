"""Forward dynamics with contacts and its derivative along a direction (forward mode)."""

from psdmc.functions.constrained_forward_dynamics_vjp import FUNCTION

RECIPE = FUNCTION.along(
    346,
    "qdd and forces of constrained_forward_dynamics, and their derivatives along (dq, dqd, dtau, derror)",
    "Compute the accelerations qdd and contact forces that torques cause. Also compute their derivatives by a "
    "number e. The inputs q, qd, tau and error change by e dq, e dqd, e dtau and e derror.",
)
