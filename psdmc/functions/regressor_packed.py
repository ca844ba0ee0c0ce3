"""The regressor of the torques in theta_b for recursive estimators, as a vector of the matrix entries that can differ
from zero."""

from __future__ import annotations

from psdmc.dynamics.structure import regressor_places
from psdmc.functions import regressor
from psdmc.recipes.recipe import Packing, packed

RECIPE = packed(
    regressor.RECIPE,
    71,
    "entries of the regressor Y that can differ from zero, row by row",
    "Compute the nonzero entries of the regressor Y as a vector, row by row. Entries that are zero at every state "
    "are left out. The torques of inverse dynamics are tau = Y theta_b, with the base parameters theta_b.",
    Packing(regressor.RECIPE.name, regressor_places),
)
