"""Second derivatives of the weighted accelerations for sparse solvers: entries of the lower triangle."""

from __future__ import annotations

from psdmc.dynamics.structure import acceleration_hessian_places
from psdmc.functions import forward_dynamics_second_derivatives
from psdmc.recipes.recipe import Packing, packed

RECIPE = packed(
    forward_dynamics_second_derivatives.RECIPE,
    216,
    "entries of the lower triangle of cotangent . qdd's second derivatives that can differ from zero, row by row",
    "Compute the nonzero entries of a Hessian's lower triangle as a vector, row by row. The Hessian contains the "
    "second derivatives of a weighted sum of accelerations. `forward_dynamics_second_derivatives` returns the "
    "whole Hessian. Entries that are zero at every state are left out.",
    Packing(forward_dynamics_second_derivatives.RECIPE.name, acceleration_hessian_places, is_triangle=True),
)
