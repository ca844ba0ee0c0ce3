"""The search for the cheapest code of a model's functions. It chooses link frames, nonzero parameters and options of
the recursion; these choices together are an arrangement.

The search changes one choice at a time: origins of frames on the axes, options of the recursion, unit of length, and
nonzero parameters. The result is deterministic. Candidates come in a fixed order, and only a strictly lower cost is
taken. The budget is a number of traced PROGRAMs, not a time. All searches of a model share its Geometry: the frames and
the carriers that are possible.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import astuple, replace
from functools import cached_property, partial
from itertools import islice, product
from operator import ne

import numpy as np

from psdmc.dynamics.choices import ByChoices, Choices
from psdmc.dynamics.coordinates import has_mimic_joints
from psdmc.dynamics.solve import SingularMatrix
from psdmc.errors import InternalError
from psdmc.lower.accuracy import LIMIT, WRONG, Accuracy
from psdmc.lower.branches import LARGE, Branches
from psdmc.lower.carriers import CarrierSpace
from psdmc.lower.factored import Arrangement, Recording, RobotConstants, cost_of_dynamics
from psdmc.lower.link_parameters import PSEUDO_NAMES, WEIGHTS, carrier_space, every_parameter
from psdmc.lower.reframe import Foot, Reframed, reframe, unmoved
from psdmc.program.cost import Cost, Scoring, for_lanes, for_one_state
from psdmc.program.program import Program
from psdmc.program.signature import Sizes
from psdmc.recipes.recipe import Recipe
from psdmc.robot.mechanism import PARAMETERS_PER_LINK, Array, Mechanism
from psdmc.target.presets import COSTS
from psdmc.target.target import Costs


class Geometry:
    """The new joint frames of one model and the possible carriers (nonzero parameters). They depend neither on the
    generated function, nor on whether theta_b is constant in the code.

    turns_base  whether the base may be turned about the first axis, to align it with gravity
    """

    def __init__(self, chain: Mechanism, representative: Array, turns_base: bool = True) -> None:
        self.chain, self.representative, self.turns_base = chain, representative, turns_base
        self._reframed: dict[tuple[Foot, ...], Reframed] = {}
        self._spaces: dict[Reframed, CarrierSpace] = {}

    @cached_property
    def feet(self) -> tuple[tuple[Foot, ...], ...]:
        """Return the choices of `all_feet` that give different frames. For parallel or crossing axes, both positions on
        an axis give the same frame."""
        seen: dict[tuple[Foot, ...], Reframed] = {}
        for feet in all_feet(self.chain):
            reframed = self.reframed(feet)
            if not any(reframed.is_same(other) for other in seen.values()):
                seen[feet] = reframed
        return tuple(seen)

    def reframed(self, feet: tuple[Foot, ...]) -> Reframed:
        """Return the robot's new joint frames, with each origin where a common normal meets the joint's axis.

        feet  for each joint, whether this is the normal to the previous or to the next axis
        """
        if feet not in self._reframed:
            self._reframed[feet] = reframe(self.chain, feet, self.turns_base)
        return self._reframed[feet]

    @cached_property
    def unmoved(self) -> Reframed:
        """The robot's own frames."""
        return unmoved(self.chain)

    def space(self, reframed: Reframed) -> CarrierSpace:
        """Return the possible carriers in these frames: sets of link parameters that can represent all others."""
        if reframed not in self._spaces:
            self._spaces[reframed] = carrier_space(reframed, self.representative)
        return self._spaces[reframed]


def all_feet(chain: Mechanism) -> Iterator[tuple[Foot, ...]]:
    """Yield choices of the frames' origins on the joint axes. First, all frames are on the normal to the previous axis.
    Then each single frame is on the normal to the next axis, and then all frames. Joints without children have no next
    axis.

    For large robots, only the first choice and the last one are yielded.
    """
    n, leaves = len(chain), chain.leaves
    singly = [(i,) for i in range(n) if i not in leaves] if n <= LARGE else []
    for moved in [(), *singly, tuple(range(n))]:
        yield tuple("next" if i in moved else "previous" for i in range(n))


# The search of one model's functions


BUDGET = 600
"""Programs traced per function, at 1 to 10 ms each."""

OPERATIONS, OPERATIONS_OF_LARGE = 800_000, 250_000
"""Of all PROGRAMs on which one function compares the choices of an arrangement that another function found: for robots of up
to MANY_JOINTS joints, and of more. The Coriolis matrix of a humanoid with two hands has 45,000: it compares the found
choices and those that differ in one. A longer function compares fewer."""

MANY_JOINTS = 40
"""Joints up to which a search tries all that it knows; what it leaves out of larger robots saves 1 % at most."""

LARGEST_TRANSFER = 1e4
"""Carriers whose values would be larger multiples of theta_b (lengths in the chain's unit) are not considered: torques
would be small differences of large numbers."""

CHOICES = tuple(
    Choices(compound, fold, double) for compound, fold, double in product((False, True), repeat=3)
)
ALL_CHOICES = (*CHOICES, *(replace(choices, add_sines=True) for choices in CHOICES if choices.compound))
"""All that `rearranged` tries. The descent leaves `add_sines` out: it pays only where each angle has a sincos of its
own."""


def distinct(recipe: Recipe, choices: Sequence[Choices]) -> tuple[Choices, ...]:
    """Return the options of the recursion that make a difference to a function: of equivalent ones, only the first."""
    kinds = {tuple(getattr(each, field) for field in recipe.matters): each for each in reversed(choices)}
    return tuple(each for each in choices if each in kinds.values())


class Search:
    """The search for the arrangements of one model's functions, that is, for frames, nonzero parameters and recursion.
    `geometry` (the possible frames) is shared between functions and searches."""

    def __init__(
        self,
        chain: Mechanism,
        representative: Array,
        theta_b: Array | None,
        budget: int = BUDGET,
        geometry: Geometry | None = None,
        costs: Costs = COSTS,
        known: Array | None = None,
    ) -> None:
        sizes = Sizes.of(chain, representative.shape[1])
        self.robot = RobotConstants(chain, representative, theta_b, sizes)
        self.geometry = Geometry(chain, representative) if geometry is None else geometry
        self.is_large = len(chain) > LARGE
        self.branches = Branches(self.robot)
        self._is_arm = chain.is_serial and not self.is_large and all(kind.about_z for kind in chain.types)
        self.budget = budget * LARGE**2 // max(LARGE, len(chain)) ** 2
        self._costs: ByChoices[Cost] = ByChoices()
        self.single, self.batch = for_one_state(costs), for_lanes(costs)
        known = theta_b if known is None else known
        self.accuracy = None if known is None else Accuracy(self.robot, known)

    @property
    def has_many_joints(self) -> bool:
        """Return whether the robot has so many joints that the search tries fewer candidates."""
        return len(self.robot.chain) > MANY_JOINTS

    def best(self, recipe: Recipe, scoring: Scoring, start: Arrangement | None = None) -> Arrangement:
        """Return the cheapest arrangement (frames, nonzero parameters, recursion) found for one function. If `start` is
        given, its frames are kept.

        If the torques of the cheapest arrangement are not accurate enough, the search is repeated among accurate
        arrangements. Raises InternalError if all errors are larger than rounding explains.
        """
        found = self._descended(recipe, scoring, start)
        accuracy = self.accuracy
        if accuracy is None or accuracy.error(found, recipe) <= LIMIT:
            return found
        firsts = [start] if start else [next(self.starts(feet)) for feet in self.geometry.feet]
        accurate = self._accurate(firsts, partial(accuracy.error, recipe=recipe))
        found = self._descended(recipe, scoring, start, accurate)
        error = accuracy.error(found)
        if error > WRONG:
            raise InternalError(f"{recipe.name}: the torques of its arrangement are off by {error:.1e}")
        return found

    def _descended(
        self,
        recipe: Recipe,
        scoring: Scoring,
        start: Arrangement | None,
        accurate: Arrangement | None = None,
    ) -> Arrangement:
        """The end of the descent; from `accurate` on, if given, by candidates as accurate as LIMIT or as this one."""
        descent = Descent(
            lambda a: scoring.weight(self.cost(recipe, a)),
            self.budget,
            self._admits(accurate, recipe),
        )
        if accurate is not None:
            descent.consider(iter([accurate]))
        if start is not None:
            start = self._by_the_cheaper_way(recipe, start, scoring)
            descent.consider(with_choices(start, distinct(recipe, CHOICES)))
            if self.is_large:
                descent.consider(self._anew(descent.arrangement.choices))
        else:
            for feet in self.geometry.feet:
                descent.consider(self.starts(feet))
            descent.consider(self._units(descent.arrangement))
        while descent.consider(
            self._exchanges(descent.arrangement), self._expected(recipe, scoring, descent.arrangement)
        ):
            pass
        return descent.arrangement

    def _expected(
        self, recipe: Recipe, scoring: Scoring, found: Arrangement
    ) -> Callable[[Arrangement], float]:
        """The score of an exchange, told from the branches that it changes; -inf where it is not told."""

        def expected(candidate: Arrangement) -> float:
            kept = self.branches.changed(recipe, found, candidate)
            if kept is None:
                return -math.inf
            try:
                costs = [self._branch_cost(recipe, each, kept) for each in (found, candidate)]
            except SingularMatrix:  # what the branches hang on has its inertia from others
                return -math.inf
            before, behind = map(scoring.weight, costs)
            return scoring.weight(self.cost(recipe, found)) - before + behind

        return expected

    def _branch_cost(self, recipe: Recipe, a: Arrangement, kept: tuple[int, ...]) -> Cost:
        part, robot = self.branches.part(a, kept)
        return self._costs.made(
            self._key(recipe, part),
            part.choices,
            lambda choices: cost_of_dynamics(recipe, replace(part, choices=choices), robot),
        )

    def _accurate(
        self, firsts: Sequence[Arrangement], error_of: Callable[[Arrangement], float]
    ) -> Arrangement:
        """The most accurate of several arrangements; one within LIMIT where exchanges of its carriers lead to it, else where
        nothing is carried by other parameters than its own, on their frames or on the robot's. Of a large robot as many
        exchanges are measured as the search traces: a finger that moves next to no inertia is helped by none."""
        best = min(firsts, key=error_of)
        error = error_of(best)
        left = self.budget if self.is_large else None
        while error > LIMIT:
            tried = list(islice(self._exchanges(best), left))
            left = None if left is None else left - len(tried)
            others = {error_of(each): each for each in tried}
            least = min(others, default=error)
            if least >= error:
                frames = [*(each.reframed for each in firsts), self.geometry.unmoved]
                return min([best, *map(self.uncarried, frames)], key=error_of)
            best, error = others[least], least
        return best

    def uncarried(self, reframed: Reframed) -> Arrangement:
        """Return a form of the code (an arrangement) with the given link frames and with all link parameters that
        theta_b contains.

        Other arrangements set as many link parameters as possible to zero. The parameters left, called carriers, take
        over the effects of the others on the torques. psdmc chooses carriers from the matrix A in tau = A x, where x has
        all link parameters. A column of A has entries for all joints. The entry of a joint with tiny torques can be so
        small beside the others that rounding spoils its digits. The returned arrangement keeps these digits.
        """
        carriers, transfer = every_parameter(reframed, self.robot.representative)
        return Arrangement(reframed, 1.0, carriers, transfer, CHOICES[0], is_basis=False)

    def keeps_digits(self, reframed: Reframed) -> bool:
        """Return whether torques computed in these joint frames are accurate enough; True if no base parameters are
        known."""
        return self.accuracy is None or self.accuracy.error(self.uncarried(reframed)) <= LIMIT

    def _admits(self, accurate: Arrangement | None, recipe: Recipe) -> Callable[[Arrangement], bool]:
        accuracy = self.accuracy
        if accuracy is None or accurate is None:
            return lambda arrangement: True
        limit = max(LIMIT, accuracy.error(accurate, recipe))
        return lambda arrangement: accuracy.error(arrangement, recipe) <= limit

    def cost(self, recipe: Recipe, a: Arrangement) -> Cost:
        """Return the numbers of operations of a function in an arrangement (frames, nonzero parameters, recursion). The
        result is computed once and cached."""
        return self._recorded(recipe, a, [])

    def _recorded(self, recipe: Recipe, a: Arrangement, new: list[Recording]) -> Cost:
        """Return the numbers of operations of a function in an arrangement. If the function is recorded for this, its
        recording is added to `new`."""

        def make(choices: Choices) -> Cost:
            new.append(Recording.of(recipe, replace(a, choices=choices), self.robot))
            return new[0].cost()

        return self._costs.made(self._key(recipe, a), a.choices, make)

    @staticmethod
    def _key(recipe: Recipe, a: Arrangement) -> tuple[str, Reframed, float, tuple[int, ...]]:
        return recipe.name, a.reframed, a.unit, a.carriers

    def _anew(self, choices: Choices) -> Iterator[Arrangement]:
        """Start the search again from its first choices, in this arrangement. Of what was chosen for another function,
        a large robot's budget takes little back."""
        for feet in self.geometry.feet:
            first = next(self.starts(feet))
            yield replace(first, choices=choices)

    def _by_the_cheaper_way(self, recipe: Recipe, start: Arrangement, scoring: Scoring) -> Arrangement:
        """Choose articulated bodies if they cost less from the start. Serial arms keep the factorized mass matrix: what
        the two differ by there is less than what the search goes on to find."""
        if not recipe.accelerates or self._is_arm or has_mimic_joints(start.reframed.frames):
            return start
        other = replace(start, choices=replace(start.choices, articulated=True))
        costs = [scoring.weight(self.cost(recipe, each)) for each in (start, other)]
        return other if costs[1] < costs[0] else start

    def rearranged(self, recipe: Recipe, found: Arrangement, scoring: Scoring) -> Program:
        """Return the PROGRAM (list of operations) of a function. Frames and nonzero parameters are those that were
        found for another function or target processor; only the options of the recursion are chosen again."""
        return min(self.rearrangements(recipe, found), key=scoring.score)

    def rearrangements(self, recipe: Recipe, found: Arrangement) -> Iterator[Program]:
        """Yield the PROGRAMs (lists of operations) from which `rearranged` chooses. They are the cheapest one for one
        state per call, and the cheapest one for one state per SIMD lane.

        For a robot with more than MANY_JOINTS joints, only the second is yielded. All candidates are counted, and only
        the best become PROGRAMs. The candidates most similar to the given arrangement (frames, parameters, options)
        come first. Counting ends when the counted candidates have OPERATIONS operations together.
        """
        choices = list(with_choices(found, _felt(found, distinct(recipe, ALL_CHOICES))))
        costs: dict[int, Cost] = {}
        recorded: dict[int, Recording] = {}
        best: set[int] = set()
        is_usual = not self.has_many_joints
        left = OPERATIONS if is_usual else OPERATIONS_OF_LARGE
        targets = (self.single, self.batch) if is_usual else (self.batch,)
        for k in sorted(range(len(choices)), key=lambda k: _changes(choices[k].choices, found.choices)):
            new: list[Recording] = []
            costs[k] = self._recorded(recipe, choices[k], new)
            new += [
                recorded[j] for j in recorded if costs[j] is costs[k]
            ]  # of choices that are not told apart
            if new:
                recorded[k] = new[0]
            best = {min(sorted(costs), key=lambda k: target.weight(costs[k])) for target in targets}
            recorded = {k: recorded[k] for k in best if k in recorded}
            left -= costs[k].total
            if left < costs[k].total:
                break
        for k in sorted(best):
            kept = recorded.pop(k, None) or Recording.of(recipe, choices[k], self.robot)
            yield kept.program()

    def starts(self, feet: tuple[Foot, ...]) -> Iterator[Arrangement]:
        reframed = self.geometry.reframed(feet)
        space = self.geometry.space(reframed)
        weights = [WEIGHTS[PSEUDO_NAMES[j % PARAMETERS_PER_LINK]] for j in range(space.count)]
        carriers = space.lightest(weights)
        transfer = space.transfer(carriers)
        plain = Arrangement(reframed, 1.0, carriers, transfer, CHOICES[0])
        for choices in _felt(plain, CHOICES):
            yield replace(plain, choices=choices)

    def _units(self, found: Arrangement) -> Iterator[Arrangement]:
        """Yield the arrangement with each length of the robot as the unit. With sliding joints there is none: variables
        would need scaling, and the pitch of a screw is in m."""
        frames = found.reframed.frames
        if any(frame.joint.length_order or frame.joint.has_length for frame in frames):
            return
        lengths = {abs(x): None for frame in frames for x in frame.translation if x}
        for unit in lengths:
            yield replace(found, unit=unit)

    def _exchanges(self, found: Arrangement) -> Iterator[Arrangement]:
        if not found.is_basis:
            return
        space = self.geometry.space(found.reframed)
        for leaving, entering in space.exchanges(found.carriers):
            carriers = tuple(sorted({*found.carriers, entering} - {leaving}))
            transfer = space.transfer(carriers)
            if np.max(np.abs(transfer)) < LARGEST_TRANSFER:
                yield replace(found, carriers=carriers, transfer=transfer)


def _changes(one: Choices, other: Choices) -> int:
    """How many choices two arrangements of a recursion differ in."""
    return sum(map(ne, astuple(one), astuple(other)))


def with_choices(found: Arrangement, choices: Iterable[Choices]) -> Iterator[Arrangement]:
    """Return the arrangement with each of these options of the recursion, but the same algorithm for accelerations."""
    way = found.choices.articulated
    return (replace(found, choices=replace(each, articulated=way)) for each in choices)


def _felt(arrangement: Arrangement, choices: Iterable[Choices]) -> Iterator[Choices]:
    """The choices that make a difference in an arrangement: without parallel neighbours there are no compound turns."""
    parallel = any(frame.is_parallel for frame in arrangement.reframed.frames[1:])
    return (each for each in choices if parallel or not each.compound)


ROUNDING = 1e-6
"""Differences of scores below this are rounding: weights have few decimals."""


class Descent:
    """The state of a search: the cheapest form of the code so far, and how many candidates may still be tried. The form
    is a choice of link frames, nonzero link parameters and options of the recursion (an arrangement)."""

    arrangement: Arrangement

    def __init__(
        self,
        score: Callable[[Arrangement], float],
        budget: int,
        is_admitted: Callable[[Arrangement], bool],
    ) -> None:
        self._score_of, self._left, self._score = score, budget, math.inf
        self._is_admitted = is_admitted

    def consider(
        self, candidates: Iterator[Arrangement], expected: Callable[[Arrangement], float] | None = None
    ) -> bool:
        """Try candidates in order, and take each one with a lower score. Return whether any candidate was taken.

        expected  a rough estimate of the score that takes less time; candidates whose estimate is not lower are not
                  tried
        """
        improved = False
        for candidate in candidates:
            if self._left == 0:
                return False
            self._left -= 1
            if expected is not None and expected(candidate) > self._score + ROUNDING:
                continue
            score = self._score_of(candidate)
            if score < self._score and self._is_admitted(candidate):
                self.arrangement, self._score, improved = candidate, score, True
        return improved
