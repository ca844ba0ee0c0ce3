"""Writes the table of docs/functions.md from the functions' declarations: python docs/function_table.py."""

from __future__ import annotations

from pathlib import Path

from psdmc.functions import RECIPES
from psdmc.program.signature import Quantity
from psdmc.recipes.recipe import Recipe

PAGE = Path(__file__).parent / "functions.md"

IN_0_1 = frozenset(
    [
        "inverse_dynamics",
        "forward_dynamics",
        "mass_matrix",
        "nonlinear_effects",
        "coriolis_matrix",
        "gravity",
        "regressor",
        "regressor_slotine_li",
        "jacobian",
    ]
)

COMPUTES = {
    "inverse_dynamics": "joint torques for a motion: tau = M(q) qdd + h(q, qd)",
    "inverse_dynamics_derivatives": "Jacobians of tau by q, qd and qdd",
    "forward_dynamics": "joint accelerations for torques: qdd = M(q)^-1 (tau - h(q, qd))",
    "forward_dynamics_derivatives": "qdd and its Jacobians by q, qd and tau",
    "mass_matrix": "joint-space inertia M(q), both triangles",
    "mass_matrix_packed": "entries of M's lower triangle that can differ from zero, row by row",
    "nonlinear_effects": "Coriolis, centrifugal and gravity torques: h = C(q, qd) qd + g(q)",
    "coriolis_matrix": "C(q, qd), for which dM/dt - 2 C is skew-symmetric",
    "gravity": "gravity torques g(q)",
    "regressor": "Y with tau = Y theta_b",
    "regressor_packed": "entries of Y that can differ from zero, row by row",
    "regressor_slotine_li": "Y with M(q) qdd_r + C(q, qd) qd_r + g(q) = Y theta_b",
    "jacobian": "linear (m/s), then angular (rad/s) velocity of the tip per unit joint rate, along the base's axes",
    "forward_kinematics": "origin (m) and rotation matrix of each named frame in the base frame",
    "frame_jacobian": "linear, then angular velocity of each named frame per unit joint rate, along the base's axes",
    "jacobian_dot_qd": "acceleration of each named frame at qdd = 0: linear (m/s^2), then angular (rad/s^2)",
    "kinetic_energy": "kinetic energy (J), drive inertias included",
    "potential_energy": "potential energy (J), zero at q = 0",
    "momentum": "linear momentum (kg m/s), then angular momentum about the base's origin (kg m^2/s)",
    "inverse_dynamics_with_wrenches": "torques for a motion while wrenches act on the named frames",
    "centre_of_mass": "centre of mass of all links (m) in the base frame",
    "com_jacobian": "velocity of the centre of mass (m/s) per unit joint rate",
    "centroidal_momentum_matrix": "A with A qd the momentum about the centre of mass, linear then angular",
    "inverse_dynamics_vjp": "tau, and the gradients of cotangent . tau by q, qd and qdd",
    "inverse_dynamics_vjp_parameters": "the same, and the gradient by theta_b",
    "forward_dynamics_vjp": "qdd, and the gradients of cotangent . qdd by q, qd and tau",
    "forward_dynamics_vjp_parameters": "the same, and the gradient by theta_b",
    "inverse_dynamics_jvp": "tau, and its derivative along (dq, dqd, dqdd)",
    "forward_dynamics_jvp": "qdd, and its derivative along (dq, dqd, dtau)",
    "mass_matrix_inverse": "M(q)^-1, both triangles",
    "gravity_derivatives": "g(q) and its Jacobian by q",
    "frame_velocity_derivatives": "Jacobian of each named frame's velocity J qd by q",
    "semi_implicit_euler": "state after dt (s): qd_next = qd + dt qdd, q_next = q + dt qd_next",
    "semi_implicit_euler_derivatives": "the same state, and its Jacobians A by (q, qd) and B by tau",
    "rk4_step": "state after dt (s) by the classical Runge-Kutta method, tau constant",
    "rk4_step_derivatives": "the same state, and its Jacobians A by (q, qd) and B by tau",
    "neutral": "the configuration in which no joint has moved",
    "integrate": "q after the displacement v = rate times seconds",
    "difference": "displacement v with integrate(q0, v) = q1",
}
"""What each function computes, for a reader who looks for it; the header of a package says it in full."""

HEAD = "| function | computes | inputs | outputs | `_theta` | default | since | Pinocchio's function |"


def table() -> str:
    """The table's lines."""
    rows = [HEAD, "|---" * HEAD.count(" |") + "|"]
    return "\n".join([*rows, *(_row(recipe) for recipe in RECIPES.values())]) + "\n"


def _row(recipe: Recipe) -> str:
    function = recipe.signature
    default = "yes" if recipe.default else "floating base" if recipe.default_where_wide else ""
    cells = (
        f"`{recipe.name}`",
        COMPUTES[recipe.name],
        ", ".join(map(_shape, function.inputs)),
        ", ".join(map(_shape, function.outputs)),
        "yes" if function.theta else "",
        default,
        "0.1" if recipe.name in IN_0_1 else "0.2",
        f"`{recipe.against}`",
    )
    return f"| {' | '.join(cells)} |"


def _shape(quantity: Quantity) -> str:
    words = {"nq": "n", "nv": "n"}
    axes = " x ".join(words.get(axis, axis) for axis in quantity.axes) or "1"
    return f"{quantity.name} ({axes})"


def with_table(text: str) -> str:
    """The page with this table in the place of its own."""
    before, _, rest = text.partition("| function |")
    lines = rest.splitlines(keepends=True)
    behind = next(i for i, line in enumerate(lines) if i and not line.startswith("|"))
    return before + table() + "".join(lines[behind:])


if __name__ == "__main__":
    PAGE.write_text(with_table(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
