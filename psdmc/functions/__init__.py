"""The functions that psdmc can generate. Each file of this folder describes one function by an object RECIPE: inputs,
outputs and the computation."""

from __future__ import annotations

from collections.abc import Sequence
from difflib import get_close_matches
from importlib import import_module
from pkgutil import iter_modules

from psdmc.errors import InternalError
from psdmc.program.kernel import THETA_ROWS, by_rows
from psdmc.program.signature import in_order
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


def near_names(word: str, names: Sequence[str], otherwise: str) -> str:
    """Return the hint for a word that is none of the names: similar names, or else `otherwise`."""
    alike = get_close_matches(word.lower().replace("-", "_"), names, n=3)
    return f"do you mean {' or '.join(alike)}?" if alike else otherwise


def no_function(robot: object, name: str) -> AttributeError:
    """Return the error for an attribute that a robot object does not have. It says which public names are similar."""
    if name.startswith("_"):
        return AttributeError(f"{type(robot).__name__} has no attribute {name!r}")
    public = [each for each in dir(robot) if not each.startswith("_")]
    hint = near_names(name, public, "dir(robot) lists all")
    return AttributeError(f"{type(robot).__name__} has no function {name!r}; {hint}", name=name)
