"""Lowering of a model to kernels. A kernel is the list of operations of one function, from which C code is printed.
Each function gets its cheapest form."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Literal

from psdmc.dynamics.solve import SingularMatrix
from psdmc.errors import InputError
from psdmc.friction.joints import FrictionInDynamics
from psdmc.functions import BY_ROWS, RECIPES, recipe_of
from psdmc.garbage import collecting_rarely
from psdmc.lower.accuracy import LIMIT
from psdmc.lower.admitted import wanted
from psdmc.lower.dimension_check import check_dimensions
from psdmc.lower.expanded.lowering import lower_expanded
from psdmc.lower.expanded.terms import COEFFICIENT_NOISE
from psdmc.lower.factored import Arrangement, trace_dynamics, trace_geometry
from psdmc.lower.limb_search import LimbArrangement, LimbSearch
from psdmc.lower.limbs import have_contacts_alike
from psdmc.lower.reframe import Reframed
from psdmc.lower.search import Geometry, Search
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.model.parameter_checks import for_every_gravity
from psdmc.program.cost import for_lanes, for_one_state
from psdmc.program.kernel import Kernel, kernel_by_rows, packed
from psdmc.program.pipeline import ordered, shortened
from psdmc.program.products import in_loops, written_out
from psdmc.program.program import Program
from psdmc.program.signature import Signature
from psdmc.progress import Step
from psdmc.recipes.load_momentum import LOADS, load_recipe
from psdmc.recipes.recipe import Packing, Recipe
from psdmc.recipes.torques_and_accelerations import with_friction, with_gravity_input
from psdmc.robot.mechanism import require_derivable
from psdmc.target.presets import COSTS
from psdmc.target.target import Costs

Lowering = Literal["auto", "expanded", "factored"]

COEFFICIENT_NOISES = (COEFFICIENT_NOISE, 1e-15)
"""Uncertainties of coefficients: the usual one, and next to none for robots of many scales, where what is left out of a
large parameter's effect may be as large as a small one's."""

TRACED = 40
"""Rates up to which a function that calls another one has a straight line as well, whose zeros and operations are known. A
step's Jacobians for 50 rates have a million operations, which C leaves to loops."""

NOTHING = Program((), ())

EXPANDED_LIMIT = 600
"""Largest p for which `auto` tries the expanded lowering; beyond it, the factored one has always been cheaper."""


@collecting_rarely()
def lower(
    model: DynamicsModel,
    lowering: Lowering = "auto",
    functions: Sequence[str] | None = None,
    progress: Callable[[str], None] = lambda message: None,
    theta_variants: bool = True,
    costs: Costs = COSTS,
    friction: FrictionInDynamics | None = None,
    gravity_input: bool = False,
) -> dict[str, Kernel]:
    """Return the kernel (operations) of each function by name, in the order of psdmc.functions.

    functions       names of functions, also NAME_theta_rows (one theta_b per state); None: the default ones. If theta_b
                    is unknown, only functions and variants that do not need its value are made
    theta_variants  whether to make also the variants NAME_theta, with theta_b as an argument
    costs           costs of operations on the target processor
    friction        joint friction that motor torques contain; None: they have none
    gravity_input   whether gravity is an input of the functions that depend on it

    Raises InputError for an unknown function, and for forward dynamics if the mass matrix is singular for every q. Raises
    InputError also if gravity is an input and the base parameters do not determine the torques under every gravity.
    """
    lowered = _Lowered(model, lowering, costs, friction, gravity_input)
    kernels: dict[str, Kernel] = {}
    try:
        names = wanted(functions, model.mechanism)
        for number, name in enumerate(names):
            recipe, is_by_rows = recipe_of(name), name in BY_ROWS
            takes_theta = recipe.signature.theta
            lowered.check(recipe)
            recipe = lowered.recipe(recipe)
            variants = (False, True) if takes_theta and theta_variants else (False,)
            for theta in (True,) if is_by_rows else variants:
                if not theta and model.theta_b is None and takes_theta:
                    continue
                share = (number + 0.5 * theta) / len(names)
                progress(Step(f"lowering {recipe.name}{'_theta' if theta else ''}", share))
                try:
                    kernel = lowered.kernel(recipe, theta)
                except SingularMatrix as singular:
                    raise _refusal(model, recipe.signature, singular) from singular
                kernel = kernel_by_rows(kernel) if is_by_rows else kernel
                kernels[kernel.name] = kernel
    finally:
        _last[:] = [lowered.searched]
    return kernels


def lower_estimator(model: DynamicsModel, kind: str, costs: Costs = COSTS) -> Kernel:
    """Return the kernel (operations) of the momenta that a load estimator calls, with the model's theta_b compiled in.

    kind  "mass" or "inertia": which parameters of a load the estimator finds

    Raises InputError for another kind, unknown base parameters, closed loops, and joints of several coordinates.
    """
    robot = model.mechanism
    if kind not in LOADS:
        raise InputError(f"estimator {kind!r} is not known", f"choose one of {', '.join(LOADS)}")
    if model.theta_b is None:
        raise InputError(
            f"{robot.name}: no estimator: the base parameters are unknown", "calibrate the model first"
        )
    if robot.loops:
        raise InputError(
            f"{robot.name}: no estimator: it knows no forces of closed loops", "leave the loops out"
        )
    if robot.nq > robot.nv or not all(kind.about_z for kind in robot.types):
        raise InputError(
            f"{robot.name}: no estimator: a joint of the robot has several coordinates",
            "derive the model without --floating, or lock the joint with --lock",
        )
    # Its searches are not kept: the recipes of both kinds have one name, by which searches are found again.
    lowered, recipe = _Lowered(model, "factored", costs), load_recipe(kind)
    lowered.check(recipe)
    return lowered.kernel(recipe, False)


def _refusal(model: DynamicsModel, function: Signature, singular: SingularMatrix) -> InputError:
    """The error of a function whose first matrix, that of the joints, is singular."""
    matrix, name = function.factorises[0], function.name
    joint = model.joint_names[model.mechanism.rate_joints[singular.row]]
    return InputError(
        f"{model.mechanism.name}: {name}: joint {joint!r} moves no inertia, {matrix.name} is singular for every q",
        f"give its link an inertia, add --drive-inertia, or leave {name} out of --functions",
    )


@dataclass(frozen=True, slots=True, eq=False)
class _Searched:
    """Frames, searches and arrangements of one model and one target, which later lowerings go on with."""

    key: tuple[object, ...]
    geometry: Geometry
    searches: dict[bool, Search]
    arrangements: dict[tuple[str, bool], Arrangement]


_last: list[_Searched] = []
"""At most one: that of the last lowering, while no other one has taken it. Programs often ask for one function of a robot
after another, and searching takes most of the time."""


class _Lowered:
    """One model's programs. Functions that run the same recursion share one search."""

    def __init__(
        self,
        model: DynamicsModel,
        lowering: Lowering,
        costs: Costs,
        friction: FrictionInDynamics | None = None,
        gravity_input: bool = False,
    ) -> None:
        require_derivable(model.mechanism)
        self.model = for_every_gravity(model) if gravity_input else model
        self.lowering, self.costs = lowering, costs
        self.friction, self.gravity_input = friction, gravity_input
        self.single, self.batch = for_one_state(costs), for_lanes(costs)
        self.searched = self._continued(model)
        self.geometry = self.searched.geometry
        self._searches, self._arrangements = self.searched.searches, self.searched.arrangements
        self._limbs: dict[str, LimbArrangement | None] = {}
        self._kernels: dict[tuple[str, bool], Kernel] = {}
        self._short: list[tuple[Program, Program]] = []

    def _continued(self, given: DynamicsModel) -> _Searched:
        """The last lowering's searches, if they are of this model, else new ones. No two lowerings share them at a time."""
        key = (self.model.content_hash, self.costs, self.friction, self.gravity_input)
        with suppress(IndexError):
            last = _last.pop()
            if last.key == key:
                return last
        geometry = Geometry(self.model.mechanism, given.representative, not self.gravity_input)
        return _Searched(key, geometry, {}, {})

    def check(self, recipe: Recipe) -> None:
        """Raise InputError if the recipe's function adds unlike quantities, such as a mass and a length."""
        traced = self._given_gravity(RECIPES[recipe.packs.function] if recipe.packs else recipe)
        if traced.regions is None or self.model.nv <= TRACED:
            check_dimensions(
                traced,
                self.geometry.reframed(self.geometry.feet[0]),
                self._search(self.model.theta_b is None).robot,
            )

    def recipe(self, recipe: Recipe) -> Recipe:
        """Return the recipe of a function with the joint friction and the gravity of this lowering. Raises InputError for a
        function whose list of entries has no place for friction."""
        whole = RECIPES[recipe.packs.function] if recipe.packs else recipe
        if self.friction is not None and recipe.packs and whole.signature.has_motor_torques:
            raise InputError(
                f"{recipe.name}: the entries that it stores are those of rigid bodies, without friction",
                f"emit {whole.name}, or leave friction out of the dynamics",
            )
        calls = any(RECIPES[name].signature.has_motor_torques for name in recipe.signature.calls)
        if self.friction is not None and calls and not recipe.signature.has_motor_torques:
            recipe = replace(recipe, regions=None)  # its loops would call a function with friction
        return self._given_gravity(with_friction(recipe, self.friction))

    def _given_gravity(self, recipe: Recipe) -> Recipe:
        return with_gravity_input(recipe, RECIPES) if self.gravity_input else recipe

    def _known(self, name: str) -> Recipe:
        """The recipe whose search results others use."""
        return self._given_gravity(RECIPES[name])

    def kernel(self, recipe: Recipe, theta: bool) -> Kernel:
        """Return the kernel (operations) of one function. The kernel is stored at the first call, because the kernel of
        another function may be made from it.

        theta  True: the function takes the base parameters theta_b as an input
        """
        key = recipe.name, theta
        if key not in self._kernels:
            self._kernels[key] = (
                self._packed(recipe, recipe.packs, theta) if recipe.packs else self._made(recipe, theta)
            )
        return self._kernels[key]

    def _packed(self, recipe: Recipe, packing: Packing, theta: bool) -> Kernel:
        """Pack a matrix function's kernel from the function of the whole matrix."""
        dense, sizes = self._known(packing.function), self._search(theta).robot.sizes
        _, columns = sizes.shape(dense.signature.outputs[0].axes)
        places = packing.places(self.model.mechanism, self.model.representative)
        return packed(self.kernel(dense, theta), recipe.signature, columns, places)

    def _made(self, recipe: Recipe, theta: bool) -> Kernel:
        if recipe.regions and self.model.nv > recipe.straight:
            unmoved = self.geometry.unmoved
            of_loops = {"loops": unmoved.loops} if recipe.closes else {}
            regions = recipe.regions(unmoved.frames, unmoved.named, **of_loops)
            program = NOTHING
            if self.model.nv <= TRACED:
                arranged = self._arrangement(self._known(recipe.shares or recipe.name), theta)
                traced = trace_dynamics(recipe, arranged, self._search(theta).robot)
                program = written_out(traced, recipe.signature.products)
            kernel = Kernel(recipe.signature, theta, program, program, "factored", regions=regions)
            return (
                kernel
                if theta or not recipe.in_limbs or not program.outputs
                else self._in_limbs(recipe, kernel)
            )
        candidates: list[Kernel] = []
        expanded = self._expanded(recipe, theta) if self._may_expand(recipe) else None
        if expanded is not None:
            candidates.append(self._kernel(recipe, theta, expanded, expanded, "expanded"))
        if self.lowering != "expanded" or not candidates:
            traces = tuple(self._traces(recipe, theta))
            single, batch = (min(traces, key=each.score) for each in (self.single, self.batch))
            if batch != single and self._serves_both(single, batch):
                single = batch
            candidates.append(self._kernel(recipe, theta, single, batch, "factored"))
        kernel = min(candidates, key=lambda kernel: self.single.score(kernel.single))
        return kernel if theta or not recipe.in_limbs else self._in_limbs(recipe, kernel)

    def _kernel(self, recipe: Recipe, theta: bool, single: Program, batch: Program, lowering: str) -> Kernel:
        function, score, costs = recipe.signature, self.batch.score, self.costs
        if in_loops(single, function.products, self.model.nv, costs):
            before = ordered(self._shortened(single), costs)[0]
            whole = written_out(before, function.products)
            return Kernel(function, theta, whole, whole, lowering, before)
        is_same = batch == single
        one, shared = ordered(self._shortened(written_out(single, function.products)), costs)
        if is_same:
            return Kernel(function, theta, one, shared, lowering)
        lanes = ordered(self._shortened(written_out(batch, function.products)), costs)[1]
        if shared == one:
            own = score(lanes)
            is_long = theta and own > costs.longest_of_two
            if is_long or score(one) <= costs.worth_two_bodies * own:
                lanes = shared  # a body of its own is not worth it
        return Kernel(function, theta, one, lanes, lowering)

    def _shortened(self, program: Program) -> Program:
        """Run the passes, once for a PROGRAM that is scored first and used then."""
        found = next((short for known, short in self._short if known is program), None)
        if found is None:
            found = shortened(program, self._search(False).has_many_joints)
            self._short = [*self._short[-1:], (program, found)]
        return found

    def _in_limbs(self, recipe: Recipe, kernel: Kernel) -> Kernel:
        """Put limbs of equal structure into lanes, if that is cheaper."""
        if self.model.mechanism.is_serial or self.lowering == "expanded":
            return kernel
        shared = self._known(recipe.shares) if recipe.shares else recipe
        found = self._limb_arrangement(shared)
        if found is None or not have_contacts_alike(recipe, found.arrangement.reframed, found.groups):
            return kernel
        search = self._limb_search(recipe)
        limbs = search.lowered(found if shared is recipe else search.within(found), kernel.single)
        return kernel if limbs is None else replace(kernel, limbs=limbs)

    def _limb_arrangement(self, recipe: Recipe) -> LimbArrangement | None:
        if recipe.name not in self._limbs:
            search = self._limb_search(recipe)
            self._limbs[recipe.name] = (
                search.best(self._arrangement(recipe, False))
                if recipe.signature.theta
                else search.among(
                    self._with_digits([self.geometry.reframed(feet) for feet in self.geometry.feet])
                )
            )
        return self._limbs[recipe.name]

    def _limb_search(self, recipe: Recipe) -> LimbSearch:
        return LimbSearch(self._search(False), recipe, self.costs)

    def _expanded(self, recipe: Recipe, theta: bool) -> Program | None:
        """Lower in expanded form, with fewer coefficients left out or made one if that loses digits; None if they are
        lost anyway."""
        accuracy = self._search(theta).accuracy
        for noise in COEFFICIENT_NOISES:
            program = lower_expanded(self.model, recipe, theta, self.costs, noise)
            if accuracy is None or accuracy.error_of(recipe, program) <= LIMIT:
                return program
        return None

    def _may_expand(self, recipe: Recipe) -> bool:
        if self.lowering == "factored" or recipe.polynomials is None or self.model.p is None:
            return False
        return self.lowering == "expanded" or self.model.p <= EXPANDED_LIMIT

    def _serves_both(self, single: Program, batch: Program) -> bool:
        """Check if code for one state can use the arithmetic of the lanes. Sums of angles by the addition theorems save
        lanes a sincos each and cost one state of a long function next to nothing."""
        own, costs = self.single.score(single), self.costs
        if not costs.has_vectors or own < costs.shared_from:
            return False
        one, lanes = (self.single.score(self._shortened(each)) for each in (single, batch))
        return lanes <= costs.worth_sharing * one

    def _traces(self, recipe: Recipe, theta: bool) -> Iterator[Program]:
        """Yield the PROGRAMs that code for one state and code for lanes choose from, traced once for both."""
        search, geometry = self._search(theta), self.geometry
        if recipe.signature.theta:
            arranged = self._known(recipe.shares) if recipe.shares else recipe
            yield from search.rearrangements(recipe, self._arrangement(arranged, theta))
            return
        frames = [geometry.reframed(feet) for feet in geometry.feet]
        traced = [trace_geometry(recipe, each, search.robot) for each in frames]
        if recipe.times_theta and not all(search.keeps_digits(frames[k]) for k in self._cheapest(traced)):
            traced = [trace_geometry(recipe, each, search.robot) for each in self._with_digits(frames, theta)]
        yield from traced

    def _with_digits(self, frames: Sequence[Reframed], theta: bool = False) -> Sequence[Reframed]:
        """Return the frames in which a regressor keeps its digits."""
        search = self._search(theta)
        return [each for each in frames if search.keeps_digits(each)] or [self.geometry.unmoved]

    def _cheapest(self, programs: Sequence[Program]) -> set[int]:
        """Choose the cheapest programs, for one state and for lanes."""
        scores = [[scoring.score(each) for each in programs] for scoring in (self.single, self.batch)]
        return {each.index(min(each)) for each in scores}

    def _arrangement(self, recipe: Recipe, theta: bool) -> Arrangement:
        key = recipe.name, theta
        if key not in self._arrangements:
            start = self._arrangement(self._known(recipe.starts), theta) if recipe.starts else None
            self._arrangements[key] = self._search(theta).best(recipe, self.single, start)
        return self._arrangements[key]

    def _search(self, theta: bool) -> Search:
        if theta not in self._searches:
            baked = None if theta else self.model.theta_b
            self._searches[theta] = Search(
                self.model.mechanism,
                self.model.representative,
                baked,
                geometry=self.geometry,
                costs=self.costs,
                known=self.model.theta_b,
            )
        return self._searches[theta]
