"""Second derivatives of the weighted torques for sparse solvers: the lower triangle's entries that can differ from zero."""

from __future__ import annotations

from psdmc.dynamics.structure import torque_hessian_places
from psdmc.functions import inverse_dynamics_second_derivatives
from psdmc.recipes.recipe import Packing, packed

RECIPE = packed(
    inverse_dynamics_second_derivatives.RECIPE,
    199,
    "entries of the lower triangle of cotangent . tau's second derivatives that can differ from zero, row by row",
    "Compute the nonzero entries of a Hessian's lower triangle as a vector, row by row. The Hessian contains the "
    "second derivatives of a weighted sum of torques. `inverse_dynamics_second_derivatives` returns the whole "
    "Hessian. Entries that are zero at every state are left out.",
    Packing(inverse_dynamics_second_derivatives.RECIPE.name, torque_hessian_places, is_triangle=True),
)
