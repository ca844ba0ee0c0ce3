"""The functions that psdmc generates: which vectors they read and write. Lowering fills them in, emission prints them."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Function:
    """One generated function for a robot of n joints and l base parameters.

    inputs    vectors read, each of length n
    output    vector written, of length `rows` x `columns` (each 'n', 'l', '1' or '6'), row-major
    theta     whether a variant exists that takes theta_b (length l) at run time
    pivots    whether the PROGRAM also puts out pivot[n], which must all be positive (forward dynamics)
    meaning   what a user reads in the header
    """

    name: str
    inputs: tuple[str, ...]
    output: str
    rows: str
    columns: str
    theta: bool
    meaning: str
    pivots: bool = False

    def size(self, n: int, l: int) -> int:
        lengths = {"n": n, "l": l, "1": 1, "6": 6}
        return lengths[self.rows] * lengths[self.columns]


FUNCTIONS = (
    Function("inverse_dynamics", ("q", "qd", "qdd"), "tau", "n", "1", True, "tau = M(q) qdd + h(q, qd)"),
    Function(
        "forward_dynamics", ("q", "qd", "tau"), "qdd", "n", "1", True, "qdd = M(q)^-1 (tau - h(q, qd))", True
    ),
    Function("mass_matrix", ("q",), "M", "n", "n", True, "M(q), both triangles"),
    Function("nonlinear_effects", ("q", "qd"), "h", "n", "1", True, "h(q, qd) = C(q, qd) qd + g(q)"),
    Function("coriolis_matrix", ("q", "qd"), "C", "n", "n", True, "C(q, qd) with dM/dt - 2 C skew-symmetric"),
    Function("gravity", ("q",), "g", "n", "1", True, "g(q)"),
    Function("regressor", ("q", "qd", "qdd"), "Y", "n", "l", False, "Y with tau = Y theta_b"),
    Function(
        "regressor_slotine_li",
        ("q", "qd", "qd_r", "qdd_r"),
        "Y",
        "n",
        "l",
        False,
        "Y with M(q) qdd_r + C(q, qd) qd_r + g(q) = Y theta_b",
    ),
    Function(
        "jacobian",
        ("q",),
        "J",
        "6",
        "n",
        False,
        "linear then angular velocity of the tip per unit joint rate, base frame",
    ),
)

BY_NAME = {function.name: function for function in FUNCTIONS}
