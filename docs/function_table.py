"""Writes the table of docs/functions.md from the functions' declarations: python docs/function_table.py."""

from __future__ import annotations

from collections.abc import Sequence
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

IN_0_2 = frozenset(
    [
        "centre_of_mass",
        "centroidal_momentum_matrix",
        "com_jacobian",
        "difference",
        "forward_dynamics_derivatives",
        "forward_dynamics_jvp",
        "forward_dynamics_vjp",
        "forward_dynamics_vjp_parameters",
        "forward_kinematics",
        "frame_jacobian",
        "frame_velocity_derivatives",
        "gravity_derivatives",
        "integrate",
        "inverse_dynamics_derivatives",
        "inverse_dynamics_jvp",
        "inverse_dynamics_vjp",
        "inverse_dynamics_vjp_parameters",
        "inverse_dynamics_with_wrenches",
        "jacobian_dot_qd",
        "kinetic_energy",
        "mass_matrix_inverse",
        "mass_matrix_packed",
        "momentum",
        "neutral",
        "potential_energy",
        "regressor_packed",
        "rk4_step",
        "rk4_step_derivatives",
        "semi_implicit_euler",
        "semi_implicit_euler_derivatives",
    ]
)
"""Other functions, which a next release brings, are in neither list."""

HEAD = "| function | what it does | inputs | outputs | `_theta` | default | since | Pinocchio's function |"


def table() -> str:
    """The table's lines."""
    rows = [HEAD, "|---" * HEAD.count(" |") + "|"]
    return "\n".join([*rows, *(_row(recipe) for recipe in RECIPES.values())]) + "\n"


def _row(recipe: Recipe) -> str:
    function = recipe.signature
    default = "yes" if recipe.default else "floating base" if recipe.default_where_wide else ""
    first, *further = function.summary.removesuffix(".").split(". ")
    cells = (
        f"`{recipe.name}`",
        ". ".join([first, *(each for each in further if each.startswith("Also "))]) + ".",
        ", ".join(map(_shape, function.inputs)),
        _outputs(function.outputs),
        "yes" if function.theta else "",
        default,
        "0.1" if recipe.name in IN_0_1 else "0.2" if recipe.name in IN_0_2 else "next",
        f"`{recipe.against}`",
    )
    return f"| {' | '.join(cells)} |"


def _outputs(outputs: Sequence[Quantity]) -> str:
    """Outputs with their shapes. Derivatives of several outputs by several inputs are named in few words."""
    values = [each for each in outputs if "_d" not in each.name]
    pairs = [each.name[1:].split("_d", 1) for each in outputs if "_d" in each.name and each.name[0] == "d"]
    above, below = (list(dict.fromkeys(names)) for names in zip(*pairs, strict=True)) if pairs else ([], [])
    is_short = len(above) < 2 and len(outputs) < 8
    if is_short or len(pairs) < len(above) * len(below):
        return ", ".join(map(_shape, outputs))
    shown = ", ".join(map(_shape, values) if len(values) < 6 else (each.name for each in values))
    return f"{shown}, d`X`_d`Y` with `X` = {', '.join(above)} and `Y` = {', '.join(below)}"


def _shape(quantity: Quantity) -> str:
    words = {"nq": "n", "nv": "n"}
    axes = " x ".join(words.get(axis, axis) for axis in quantity.axes) or "1"
    return f"{quantity.name} ({axes})"


def with_table(text: str) -> str:
    """The page with this table in the place of its own."""
    return with_rows(text, "| function |", table())


def with_rows(text: str, head: str, rows: str) -> str:
    """The page with these lines in the place of its table that begins with `head`."""
    before, _, rest = text.partition(head)
    lines = rest.splitlines(keepends=True)
    behind = next(i for i, line in enumerate(lines) if i and not line.startswith("|"))
    return before + rows + "".join(lines[behind:])


if __name__ == "__main__":
    PAGE.write_text(with_table(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
