"""The cost of a PROGRAM (list of operations) on a target processor, as one number by which a search compares
PROGRAMs."""

from __future__ import annotations

import math
from dataclasses import dataclass

from psdmc.program.cost import Cost, cost
from psdmc.program.program import Program
from psdmc.target.costs import Costs
from psdmc.target.native import COSTS


@dataclass(frozen=True, slots=True)
class Scoring:
    """The rules by which a PROGRAM's cost on a target processor is computed. In code for one state, several angles
    share a vector call of sincos. In code with one state per SIMD lane, each angle has its own call."""

    costs: Costs
    angles_per_sincos: int

    def score(self, program: Program) -> float:
        """Weighted operations of the PROGRAM, see `weight`."""
        return self.weight(cost(program))

    def weight(self, c: Cost) -> float:
        """Operations with the target's weights, plus trigonometry."""
        calls, costs = math.ceil(c.sincos / self.angles_per_sincos), self.costs
        operations = c.total - costs.fused * c.fused + costs.neg * c.neg + costs.div * c.div
        states = (
            costs.angles_per_sincos // self.angles_per_sincos
        )  # of one vector, which the C library takes one by one
        chosen = costs.choice * c.choice + costs.call * states * c.call
        return operations + costs.sincos * calls + costs.angle * c.sincos + chosen


def for_one_state(costs: Costs) -> Scoring:
    """Return the rules for the cost of code that computes one state per call."""
    return Scoring(costs, costs.angles_per_sincos)


def for_lanes(costs: Costs) -> Scoring:
    """Return the rules for the cost of code that computes one state per SIMD lane (slot of a vector)."""
    return Scoring(costs, 1)


SINGLE, BATCH = for_one_state(COSTS), for_lanes(COSTS)
"""The default target's."""
