"""Decides by cost whether equal limbs (such as legs) are computed at once in SIMD lanes, and with which frames and
parameters.

The search starts from the code without lanes. There, the carriers (nonzero parameters) of one leg may be other
parameters than those of another leg. In lanes, a parameter of one limb costs the same as the parameter of all limbs.
Therefore the carriers of each limb are tried for all limbs of its group. Then carriers are exchanged in all limbs at
once.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from psdmc.dynamics.choices import ByChoices, Choices
from psdmc.dynamics.coordinates import has_mimic_joints
from psdmc.dynamics.frames import BASE
from psdmc.dynamics.solve import SingularMatrix
from psdmc.lower.accuracy import LIMIT
from psdmc.lower.branches import limbs_in
from psdmc.lower.factored import Arrangement, RobotConstants
from psdmc.lower.limb_frames import possible_groups
from psdmc.lower.limbs import (
    TracedLimbs,
    cost_of_limbs,
    has_columns,
    has_contacts,
    have_columns_alike,
    trace_limbs,
)
from psdmc.lower.reframe import Reframed
from psdmc.lower.search import (
    CHOICES,
    LARGEST_TRANSFER,
    MANY_JOINTS,
    ROUNDING,
    Search,
    distinct,
    with_choices,
)
from psdmc.program.cost import for_lanes, for_one_state
from psdmc.program.limb_program import LimbGroup, LimbProgram, Stage
from psdmc.program.limb_stages import StageCost, stage_costs, staged
from psdmc.program.passes.free_registers import free_registers
from psdmc.program.pipeline import ordered, ordered_for_limbs, shortened
from psdmc.program.products import AT_ONCE
from psdmc.program.program import Program
from psdmc.recipes.recipe import Recipe
from psdmc.robot.limbs import Limbs
from psdmc.robot.mechanism import PARAMETERS_PER_LINK
from psdmc.target.target import Costs

WIDTHS = (2, 4, 8)
"""Lanes of the vectors that generated code may have for limbs."""

USUAL = 4
"""Lanes for which an arrangement is chosen: doubles of AVX2, and of one state's vectors on most machines with AVX-512."""

BUDGET, BUDGET_OF_LARGE = 80, 20
"""Exchanges tried per function and way to see limbs, at some 10 ms each, for robots of up to MANY_JOINTS joints and of
more, whose exchanges take longer."""

PRODUCT = 1.35
"""Weight of an operation of a matrix product behind the stages: its factors come from memory, and its results go there
(decision record 0215)."""

LIKELY = 1.1
"""Ways to see limbs that cost this much more than another one are left before exchanges, which save 3 % at most."""


def weight(limbs: LimbProgram, lanes: int, costs: Costs) -> float:
    """Return the cost of one call, in the units of straight-line code's cost, if equal limbs are computed in vectors.

    lanes  number of slots of a vector, each of which computes one limb
    """
    found = weight_of_stages(limbs.groups, stage_costs(limbs), lanes, costs)
    products = sum(for_lanes(costs).weight(each.cost) for each in limbs.products)
    return found + PRODUCT * products * max(1.0, AT_ONCE / lanes)


def weight_of_stages(
    groups: Sequence[LimbGroup], stages: Iterable[StageCost], lanes: int, costs: Costs
) -> float:
    """Return the cost of one call, from the groups of limbs and the costs of the function's stages. A stage is a part
    that one group, or the core outside the limbs, computes."""
    one, each = for_one_state(costs), for_lanes(costs)
    parts_of = {group.number: -(-group.count // lanes) for group in groups}
    total = 0.0
    for group in groups:
        reals = group.count * (len(group.inputs) + len(group.outputs))
        total += costs.limb_real * reals
    for stage in stages:
        if stage.group is None:
            total += one.weight(stage.cost)
            continue
        parts = parts_of[stage.group]
        total += parts * (each.weight(stage.cost) + costs.limb_shared * stage.shared)
        total += stage.sums * (costs.limb_sum + parts - 1)
    return total


def usable_groups(
    recipe: Recipe, arrangement: Arrangement, robot: RobotConstants
) -> tuple[tuple[Limbs, ...], ...]:
    """Return the possible divisions of the robot into groups of equal limbs for this function.

    If an output has a column per base parameter, all limbs of a group must have corresponding base parameters.
    """
    found = possible_groups(arrangement.reframed.frames)
    if not has_columns(recipe):
        return found
    return tuple(groups for groups in found if have_columns_alike(robot.representative, groups))


@dataclass(frozen=True, slots=True)
class LimbArrangement:
    """The frames and parameters of a function's code, the groups of limbs that run in SIMD lanes, and the cost of one
    call (`weight`)."""

    arrangement: Arrangement
    groups: tuple[Limbs, ...]
    weight: float


class LimbSearch:
    """The search for the cheapest code of one function with limbs in SIMD lanes, for a model with known base
    parameters."""

    def __init__(self, search: Search, recipe: Recipe, costs: Costs) -> None:
        self.search, self.recipe, self.costs = search, recipe, costs
        self.lanes = min(USUAL, costs.angles_per_sincos)
        self._weights: ByChoices[float] = ByChoices()

    def best(self, start: Arrangement) -> LimbArrangement | None:
        """Return the cheapest form of the code that computes limbs (such as legs) in SIMD lanes, one limb per lane. The
        search for link frames and nonzero link parameters begins at `start`. Return None if the function or the target
        processor does not allow any."""
        # Accelerations cannot go by articulated bodies where joints follow others.
        is_eliminated = self.recipe.accelerates and has_mimic_joints(start.reframed.frames)
        if not self.costs.has_vectors or is_eliminated:
            return None
        ways = [self._arranged(start, groups) for groups in possible_groups(start.reframed.frames)]
        limit = LIKELY * min((each.weight for each in ways), default=0.0)
        found = [self._descended(each) for each in ways if each.weight <= limit]
        return min(found, key=lambda each: each.weight) if found else None

    def among(self, geometries: Iterable[Reframed]) -> LimbArrangement | None:
        """Return the cheapest arrangement (frames and options of the code) with limbs in SIMD lanes and with one of
        these choices of joint frames. Return None if there is none. The function must not depend on masses and
        inertias."""
        if not self.costs.has_vectors:
            return None
        starts = [self.search.uncarried(each) for each in geometries]
        groups_of = [usable_groups(self.recipe, each, self.search.robot) for each in starts]
        ways = [
            self._weighed(start, groups)
            for start, found in zip(starts, groups_of, strict=True)
            for groups in found
        ]
        return min(ways, key=lambda each: each.weight, default=None)

    def within(self, shared: LimbArrangement) -> LimbArrangement:
        """Return the cheapest options of the recursion for this function. Frames, parameters and groups of limbs are
        those that were found for another function."""
        own = self._weighed(shared.arrangement, shared.groups)
        return self._cheapest(own, with_choices(shared.arrangement, distinct(self.recipe, CHOICES)))

    def lowered(self, found: LimbArrangement, straight: Program) -> LimbProgram | None:
        """Return this function with limbs in SIMD lanes, with the frames, parameters and groups of limbs that a search
        found. Return None if no number of lanes makes it cheaper than straight-line code."""
        limbs = self._ordered(trace_limbs(self.recipe, found.arrangement, self.search.robot, found.groups))
        if any(each.narrowest < AT_ONCE for each in limbs.products):
            return None
        limit = for_one_state(self.costs).score(straight) / self.costs.worth_limbs
        paying = [lanes for lanes in WIDTHS if weight(limbs, lanes, self.costs) < limit]
        return replace(limbs, least=paying[0]) if paying else None

    def _arranged(self, start: Arrangement, groups: tuple[Limbs, ...]) -> LimbArrangement:
        """The cheapest before exchanges."""
        best = self._weighed(self._admissible(start, groups), groups)
        best = self._cheapest(best, self._alike(best.arrangement, groups))
        return self._cheapest(best, with_choices(best.arrangement, distinct(self.recipe, CHOICES)))

    def _descended(self, best: LimbArrangement) -> LimbArrangement:
        """The cheapest that exchanges lead to."""
        budget = BUDGET if best.arrangement.n <= MANY_JOINTS else BUDGET_OF_LARGE
        while budget > 0:
            improved = best
            for candidate in self._exchanged(best.arrangement, best.groups):
                budget -= 1
                if self._expected(best, candidate) < improved.weight - ROUNDING:
                    improved = self._cheapest(improved, [candidate])
                if budget == 0:
                    break
            if improved is best:
                break
            best = improved
        return best

    def _cheapest(
        self, best: LimbArrangement, arrangements: Sequence[Arrangement] | Iterator[Arrangement]
    ) -> LimbArrangement:
        for arrangement in arrangements:
            candidate = self._weighed(arrangement, best.groups)
            if candidate.weight < best.weight and self._is_accurate(arrangement, best.arrangement):
                best = candidate
        return best

    def _weighed(self, arrangement: Arrangement, groups: tuple[Limbs, ...]) -> LimbArrangement:
        return LimbArrangement(arrangement, groups, self._weight(arrangement, self.search.robot, groups))

    def _weight(self, arrangement: Arrangement, robot: RobotConstants, groups: tuple[Limbs, ...]) -> float:
        """The weight of a robot's limbs, or of a part's, which is counted once."""

        def make(choices: Choices) -> float:
            found = cost_of_limbs(self.recipe, replace(arrangement, choices=choices), robot, groups)
            return weight_of_stages(*found, self.lanes, self.costs)

        key = arrangement.reframed, arrangement.unit, arrangement.carriers, groups
        return self._weights.made(key, arrangement.choices, make)

    def _expected(self, best: LimbArrangement, candidate: Arrangement) -> float:
        """The weight of an exchange, told from the branches that it changes; -inf where it is not told."""
        found, groups, branches = best.arrangement, best.groups, self.search.branches
        kept = branches.changed(self.recipe, found, candidate, groups)
        if kept is None:
            return -math.inf
        try:
            before, behind = (
                self._weight(*branches.part(each, kept), limbs_in(groups, kept))
                for each in (found, candidate)
            )
        except SingularMatrix:  # what the branches hang on has its inertia from others
            return -math.inf
        return best.weight - before + behind

    def _ordered(self, traced: TracedLimbs) -> LimbProgram:
        short = shortened(traced.program, self.search.has_many_joints)
        stages = staged(short, traced.groups)
        return LimbProgram(
            traced.groups,
            tuple(Stage(stage.group, self._in_order(stage)) for stage in stages),
            products=traced.products,
            checked=has_contacts(self.recipe.signature),
        )

    def _in_order(self, stage: Stage) -> Program:
        if stage.group is None:
            return free_registers(ordered(stage.program, self.costs)[0])
        return free_registers(ordered_for_limbs(stage.program, self.costs))

    def _admissible(self, start: Arrangement, groups: Sequence[Limbs]) -> Arrangement:
        """Choose articulated bodies if limbs hang on a body. Elimination in a mass matrix has not been compared (0154)."""
        hang = any(start.reframed.frames[limbs[0][0]].parent != BASE for limbs in groups)
        if not self.recipe.accelerates or not hang:
            return start
        return replace(start, choices=replace(start.choices, articulated=True))

    def _alike(self, found: Arrangement, groups: Sequence[Limbs]) -> Iterator[Arrangement]:
        """Each limb's carriers in all limbs of its group; of several groups, the limbs of one number."""
        for k in range(max(len(limbs) for limbs in groups)):
            carriers = set(found.carriers)
            for limbs in groups:
                model = limbs[k % len(limbs)]
                for limb in limbs:
                    carriers -= {c for c in found.carriers if c // PARAMETERS_PER_LINK in limb}
                    carriers |= {
                        PARAMETERS_PER_LINK * limb[model.index(c // PARAMETERS_PER_LINK)]
                        + c % PARAMETERS_PER_LINK
                        for c in found.carriers
                        if c // PARAMETERS_PER_LINK in model
                    }
            yield from self._carried_by(found, carriers)

    def _exchanged(self, found: Arrangement, groups: Sequence[Limbs]) -> Iterator[Arrangement]:
        """Exchanges among the core's parameters, or among a group's first limb's, the others' following."""
        if not found.is_basis:
            return
        limb_of = {joint: limbs for limbs in groups for limb in limbs for joint in limb}
        space = self.search.geometry.space(found.reframed)
        for leaving, entering in space.exchanges(found.carriers):
            here, there = leaving // PARAMETERS_PER_LINK, entering // PARAMETERS_PER_LINK
            limbs = limb_of.get(here)
            if limbs is not limb_of.get(there):
                continue
            if limbs is None:
                yield from self._carried_by(found, {*found.carriers, entering} - {leaving})
            elif here in limbs[0] and there in limbs[0]:
                out = {self._same(leaving, limbs[0], limb) for limb in limbs}
                enter = {self._same(entering, limbs[0], limb) for limb in limbs}
                yield from self._carried_by(found, (set(found.carriers) - out) | enter)

    @staticmethod
    def _same(carrier: int, limb: Sequence[int], other: Sequence[int]) -> int:
        """The parameter of another limb that is at the same place."""
        joint, name = divmod(carrier, PARAMETERS_PER_LINK)
        return PARAMETERS_PER_LINK * other[limb.index(joint)] + name

    def _carried_by(self, found: Arrangement, carriers: set[int]) -> Iterator[Arrangement]:
        """So carried, where these can be carriers."""
        if not found.is_basis or len(carriers) != len(found.carriers):
            return
        chosen = tuple(sorted(carriers))
        with np.errstate(all="ignore"):
            transfer = self.search.geometry.space(found.reframed).transfer(chosen)
        if np.all(np.isfinite(transfer)) and np.max(np.abs(transfer)) < LARGEST_TRANSFER:
            yield replace(found, carriers=chosen, transfer=transfer)

    def _is_accurate(self, arrangement: Arrangement, known: Arrangement) -> bool:
        """Whether it is as accurate as it has to be, or as the one before, which has the same choices."""
        if arrangement.carriers == known.carriers:
            return True
        accuracy = self.search.accuracy
        if accuracy is None:
            return True
        return accuracy.error(arrangement) <= max(LIMIT, accuracy.error(known))
