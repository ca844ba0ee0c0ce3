"""Second derivatives of the weighted torques for sparse solvers: the lower triangle's entries that can differ from zero."""

from __future__ import annotations

from psdmc.dynamics.structure import torque_hessian_places
from psdmc.functions import inverse_dynamics_second_derivatives
from psdmc.recipes.packed import packed
from psdmc.recipes.recipe import Packing

RECIPE = packed(
    inverse_dynamics_second_derivatives.RECIPE,
    199,
    "entries of the lower triangle of cotangent . tau's second derivatives that can differ from zero, row by row",
    "Compute the entries that can differ from zero in the lower triangle of the matrix that "
    "`inverse_dynamics_second_derivatives` returns, row by row.",
    Packing(inverse_dynamics_second_derivatives.RECIPE.name, torque_hessian_places, is_triangle=True),
)
