"""Second derivatives of the weighted accelerations for sparse solvers: entries of the lower triangle."""

from __future__ import annotations

from psdmc.dynamics.structure import acceleration_hessian_places
from psdmc.functions import forward_dynamics_second_derivatives
from psdmc.recipes.packed import packed
from psdmc.recipes.recipe import Packing

RECIPE = packed(
    forward_dynamics_second_derivatives.RECIPE,
    216,
    "entries of the lower triangle of cotangent . qdd's second derivatives that can differ from zero, row by row",
    "Compute the entries that can differ from zero in the lower triangle of the matrix that "
    "`forward_dynamics_second_derivatives` returns, row by row.",
    Packing(forward_dynamics_second_derivatives.RECIPE.name, acceleration_hessian_places, is_triangle=True),
)
