"""Random robots with limbs of equal structure: joints of the same types, every number another one on each limb."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

from lowered import lowered
from random_trees import RandomTree

from psdmc.backends.c.package import PackageView, package_view
from psdmc.backends.info import EmitOptions, package_info
from psdmc.derivation.derive import derive_model
from psdmc.functions import RECIPES
from psdmc.lower.factored import trace_dynamics
from psdmc.lower.limb_search import usable_groups
from psdmc.lower.limbs import trace_limbs
from psdmc.lower.search import Search
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.program.kernel import Kernel
from psdmc.program.limb_program import LimbProgram
from psdmc.program.limb_stages import staged
from psdmc.program.pipeline import shortened
from psdmc.robot.mechanism import BASE

FUNCTIONS = ("inverse_dynamics", "nonlinear_effects", "mass_matrix", "forward_dynamics", "regressor")
DERIVATIVES = (
    "gravity_derivatives",
    "inverse_dynamics_derivatives",
    "inverse_dynamics_vjp",
    "inverse_dynamics_jvp",
    "inverse_dynamics_second_derivatives",
    "forward_dynamics_derivatives",
    "forward_dynamics_vjp",
    "forward_dynamics_jvp",
    "mass_matrix_inverse",
)
"""Functions whose limbs run in lanes."""


def limbed(seed: int, trunk: str, limbs: Sequence[tuple[int, str, int]], parallel: float = 0.5) -> RandomTree:
    """A serial trunk of these joint types (random_trees.TYPES), then limbs: the trunk's body that they hang on (BASE: the
    base), joint types from there on, and how many of them there are. Axes are parallel to their parents' or at right angles
    with this probability."""
    parents, kinds = list(range(BASE, len(trunk) - 1)), trunk
    for body, chain, count in limbs:
        for _ in range(count):
            parents += [body, *range(len(parents), len(parents) + len(chain) - 1)]
            kinds += chain
    return RandomTree(seed, tuple(parents), kinds, parallel)


SHAPES = {
    "two arms on the base": ("", [(BASE, "RRR", 2)]),
    "three fingers on a wrist": ("RR", [(1, "RR", 3)]),
    "four legs of a floating body": ("F", [(0, "RRR", 4)]),
    "five legs of a floating body": ("F", [(0, "RRR", 5)]),
    "arms on a trunk, legs on its root": ("FR", [(1, "RRR", 2), (0, "RR", 3)]),
}

EIGHT_LIMBS = {
    "eight arms on the base": ("", [(BASE, "RRR", 8)]),
    "eight fingers of two joints": ("R", [(0, "RR", 8)]),
}
"""As many as the widest vectors have lanes: lowering takes seconds."""


@cache
def shape(name: str, seed: int = 1) -> tuple[RandomTree, DynamicsModel]:
    tree = limbed(seed, *(SHAPES | EIGHT_LIMBS)[name])
    return tree, derive_model(tree.mechanism(), expand=False)


@cache
def kernels(name: str, seed: int = 1) -> dict[str, Kernel]:
    return lowered(shape(name, seed)[1], "factored", FUNCTIONS, theta_variants=False)


def package_of(name: str, options: EmitOptions, functions: Sequence[str] = FUNCTIONS) -> PackageView:
    own = {function: kernels(name)[function] for function in functions}
    return package_view(package_info(shape(name)[1]), own, options)


@cache
def forced(name: str, function: str, seed: int = 1) -> Kernel:
    """Limbs in lanes at every width, whether it pays or not, as the first arrangement has them."""
    model, recipe = shape(name, seed)[1], RECIPES[function]
    search = Search(model.mechanism, model.representative, model.theta_b)
    start = next(search.starts(search.geometry.feet[0]))
    straight = trace_dynamics(recipe, start, search.robot)
    traced = trace_limbs(recipe, start, search.robot, usable_groups(recipe, start, search.robot)[0])
    limbs = LimbProgram(
        traced.groups, staged(shortened(traced.program), traced.groups), products=traced.products
    )
    return Kernel(recipe.signature, False, straight, straight, "factored", limbs=limbs)
