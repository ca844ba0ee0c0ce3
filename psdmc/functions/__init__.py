"""The functions that psdmc can generate. Each file of this folder describes one function by an object RECIPE: inputs,
outputs and the computation."""

from __future__ import annotations

from importlib import import_module
from pkgutil import iter_modules

from psdmc.errors import InternalError
from psdmc.program.signature import in_order
from psdmc.program.theta_rows import THETA_ROWS, by_rows
from psdmc.recipes.recipe import Needs, Recipe
from psdmc.robot.mechanism import Mechanism


def _recipe(file: str) -> Recipe:
    recipe: Recipe = import_module(f"{__name__}.{file}").RECIPE
    if recipe.name != file:
        raise InternalError(f"psdmc/functions/{file}.py is the file of {recipe.name}")
    return recipe


_FOUND = {name: _recipe(name) for name in sorted(module.name for module in iter_modules(__path__))}

SIGNATURES = {signature.name: signature for signature in in_order([r.signature for r in _FOUND.values()])}
"""By name, in the order of headers and documents."""

RECIPES = {name: _FOUND[name] for name in SIGNATURES}

OF_TREES = tuple(name for name, recipe in RECIPES.items() if recipe.needs not in (Needs.LOOPS, Needs.PASSIVE))
"""Names of the functions of robots without closed loops."""

OF_FILE_MASSES = frozenset(name for name, recipe in RECIPES.items() if recipe.needs is Needs.STANDARD)
"""Names of the functions that use the masses and inertias of the robot file. Base parameters do not suffice for them."""

BY_ROWS = {f"{each.name}{THETA_ROWS}": by_rows(each) for each in SIGNATURES.values() if each.theta}
"""By name, the variants that read one theta_b per state, in the same order."""

DEFAULT = tuple(name for name, recipe in RECIPES.items() if recipe.default)
"""Names of the functions that are generated where none are named."""

DEFAULT_WHERE_WIDE = tuple(
    name for name, recipe in RECIPES.items() if recipe.default or recipe.default_where_wide
)
"""Likewise, of robots some of whose joints have several coordinates."""


def recipe_of(name: str) -> Recipe:
    """Return the recipe (specification) of a function that psdmc can generate. The name may be that of a variant, such
    as NAME_theta_rows, which takes one theta_b per state."""
    return RECIPES[name.removesuffix(THETA_ROWS)]


def default_of(robot: Mechanism) -> tuple[str, ...]:
    """Return the names of the functions that psdmc generates for a robot if the user names none."""
    return DEFAULT if all(joint.type.about_z for joint in robot.joints) else DEFAULT_WHERE_WIDE
