"""Tells which functions the user asks for, and which of them psdmc can generate for a model.

Some need a positive definite mass matrix, or links whose parameters are all known. Code that contains theta_b as constants
needs a known theta_b.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

from psdmc.errors import InputError
from psdmc.functions import BY_ROWS, DEFAULT, OF_TREES, RECIPES, default_of, near_names, recipe_of
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.model.parameter_checks import check_mass_matrix, is_surely_positive, lack_of_standard_parameters
from psdmc.recipes.recipe import Needs
from psdmc.robot.limits import shown
from psdmc.robot.mechanism import Mechanism
from psdmc.robot.urdf.missing_inertia import idle_joints, massless_words, unknown_option

REMEDY = {
    Needs.POSITIVE_MASS: "correct the inertias, or calibrate with physical consistency; use --unknown for a massless link",
    Needs.STANDARD: "derive the model from a file with the inertias of all links",
    Needs.LOOPS: "declare loops with --loops",
    Needs.PASSIVE: 'name the joints without motor in tables [[loop]] of --loops, such as passive = ["rod"]',
}


def wanted(functions: Sequence[str] | str | None, robot: Mechanism | None = None) -> tuple[str, ...]:
    """Return the names of the functions that the user asked for, in the order of psdmc.functions. Variants
    NAME_theta_rows (one theta_b per state) come last.

    None and the word 'default' mean the default functions, of this robot if one is given. 'all' means all functions
    except NAME_theta_rows. A text is one name. The functions that these functions call are added. Raises InputError for
    an unknown name.
    """
    default = DEFAULT if robot is None else default_of(robot)
    if functions is None:
        return default
    if isinstance(functions, str):
        functions = (functions,)
    own = (name for name, recipe in RECIPES.items() if robot and recipe.lack_of_loops(robot) is None)
    groups = {"default": default, "all": tuple(own) or OF_TREES}
    names = [name for word in functions for name in groups.get(word, (word,))]
    known = {name: recipe.signature for name, recipe in RECIPES.items()} | BY_ROWS
    unknown = [name for name in names if name not in known]
    if unknown:
        some = f"the default functions are {', '.join(default)}; the page Functions of the documentation lists all"
        hint = near_names(unknown[0], (*RECIPES, *groups), some)
        raise InputError(f"function {unknown[0]!r} is not known", hint)
    if not names:
        raise InputError("no function is named", f"give default, all, or names such as {', '.join(default)}")
    calling = [name for name in names if robot is None or robot.nv > recipe_of(name).straight]
    called = {other for name in calling for other in known[name].calls}
    return tuple(name for name in known if name in names or name in called)


def require(model: DynamicsModel, names: Sequence[str]) -> None:
    """Raise InputError if one of the functions needs something that the model lacks. `names` is what `wanted`
    returns."""
    lacking = _lacking(model, names)
    for name, reason in lacking.items():
        need = recipe_of(name).needs
        others = ",".join(other for other in names if other not in lacking)
        leave = f"without {name}: --functions {others}" if others else ""
        chain, remedy = model.mechanism, REMEDY[need] if need else ""
        if recipe_of(name).lack_of_loops(chain):
            remedy = (
                remedy
                if need in (Needs.LOOPS, Needs.PASSIVE)
                else "derive the model without loops for the open tree"
            )
        if need is Needs.POSITIVE_MASS and chain.massless and idle_joints(chain):
            remedy = f"add <inertial>, or derive again with {unknown_option(chain)}"
        raise InputError(
            f"model {shown(chain.name)}: no {name}: {reason}", f"{'; '.join(filter(None, (remedy, leave)))}"
        )


def admitted(model: DynamicsModel) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return the names of all default functions that psdmc can generate for the model, and one sentence for each
    function left out or restricted."""
    default = default_of(model.mechanism)
    lacking = _lacking(model, default)
    names = tuple(name for name in default if name not in lacking)
    left_out = (f"{name} is left out: {reason}" for name, reason in lacking.items())
    return names, (*left_out, *run_time_only(model, names))


def run_time_only(model: DynamicsModel, functions: Sequence[str]) -> tuple[str, ...]:
    """Return a sentence that lists the functions whose code needs theta_b as an argument, because the model has no
    theta_b.

    The tuple is empty if theta_b is known, or if none of the functions depends on theta_b.
    """
    names = [name for name in functions if name in RECIPES and RECIPES[name].signature.theta]
    if model.theta_b is not None or not names:
        return ()
    forms = ", ".join(f"{name}_theta" for name in names)
    return (f"the base parameters are unknown, so functions take theta_b as an argument: {forms}",)


def _lacking(model: DynamicsModel, names: Sequence[str]) -> dict[str, str]:
    """Function -> why the model cannot have it."""
    reason = cache(lambda need: _REASONS[need](model))
    needs = {name: recipe_of(name).needs for name in names}
    found = {name: reason(need) for name, need in needs.items() if need in _REASONS}
    found |= {name: why for name in names if (why := recipe_of(name).lack_of_loops(model.mechanism))}
    return {name: why for name, why in found.items() if why is not None}


def _without_positive_mass(model: DynamicsModel) -> str | None:
    """Why there is no forward dynamics; None where there is, or while the parameters are unknown."""
    chain = model.mechanism
    idle = idle_joints(chain) if chain.massless else ()
    if idle:
        return f"joint {chain.joints[idle[0]].name!r} moves no inertia, because {massless_words(chain)}"
    if is_surely_positive(model):
        return None
    mass = check_mass_matrix(model)
    return None if mass is None or mass.passed else mass.reason


_REASONS = {Needs.POSITIVE_MASS: _without_positive_mass, Needs.STANDARD: lack_of_standard_parameters}
