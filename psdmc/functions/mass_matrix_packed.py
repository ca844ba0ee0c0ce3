"""The mass matrix for sparse solvers: the entries of its lower triangle that can differ from zero."""

from __future__ import annotations

from psdmc.dynamics.structure import mass_matrix_places
from psdmc.functions import mass_matrix
from psdmc.recipes.recipe import Packing, packed

RECIPE = packed(
    mass_matrix.RECIPE,
    31,
    "entries of the mass matrix's lower triangle that can differ from zero, row by row",
    "Compute the nonzero entries of the mass matrix's lower triangle as a vector, row by row. Entries that are "
    "zero at every state are left out.",
    Packing(mass_matrix.RECIPE.name, mass_matrix_places, is_triangle=True),
)
