"""The passes in their order, with the checker between them."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps

from psdmc.program.check import check
from psdmc.program.cost import cost
from psdmc.program.passes.absorb_negations import absorb_negations
from psdmc.program.passes.drop_unused import drop_unused
from psdmc.program.passes.factor_common import factor_common
from psdmc.program.passes.fold_constants import fold_constants
from psdmc.program.passes.fuse_sums import fuse_sums
from psdmc.program.passes.merge_duplicates import merge_duplicates
from psdmc.program.passes.schedule import beyond_registers, live_values, schedule
from psdmc.program.program import Program
from psdmc.target.costs import Costs
from psdmc.target.native import COSTS

Pass = Callable[[Program], Program]

ROUND: tuple[Pass, ...] = (
    drop_unused,
    fold_constants,
    merge_duplicates,
    factor_common,
    merge_duplicates,
    absorb_negations,
)
"""Repeated while it saves operations: a bracket taken out of one sum may equal another, or be a factor."""

LAST: tuple[Pass, ...] = (merge_duplicates, drop_unused)
"""Before instructions are put in order, for both."""


LAST_FOR_LANES: tuple[Pass, ...] = (schedule,)
"""Many states hide each other's waiting; what costs them is values that do not fit the registers."""


def last_for_one_state(costs: Costs) -> tuple[Pass, ...]:
    """One state waits for its chain of dependent operations: make it short, with the target's latencies."""

    @wraps(fuse_sums)
    def fuse(program: Program) -> Program:
        return fuse_sums(program, costs.latency)

    return fuse, schedule


LONGEST = 10
"""Rounds at most; two or three are usual."""


def optimize(program: Program, costs: Costs = COSTS, *, lanes: bool = False) -> Program:
    """The same function of its inputs in fewer operations, up to rounding, in the order that suits the target; `lanes`
    for one state per SIMD lane.

    InternalError, naming the pass, where one breaks a PROGRAM's rules.
    """
    return ordered(shortened(program), costs)[1 if lanes else 0]


def shortened(program: Program) -> Program:
    """The same function in fewer operations, before its instructions are put in order."""
    for _ in range(LONGEST):
        shorter = _applied(ROUND, program)
        if _operations(shorter) >= _operations(program):
            break
        program = shorter
    return program


def ordered(short: Program, costs: Costs = COSTS) -> tuple[Program, Program]:
    """A shortened PROGRAM in the order for one state a call, and in that for one state per SIMD lane: the first again
    where it serves both, or where the target has no lanes. Where spilled values delay one state's code, too, it takes
    the order that spills less."""
    last = _applied(LAST, short)
    for_lanes = _applied(LAST_FOR_LANES, last)
    for_one = _applied(last_for_one_state(costs), last)
    if costs.spills_wait:
        for_one = min(for_one, for_lanes, key=lambda each: beyond_registers(each, costs.registers))
    if not costs.has_vectors or live_values(for_one) <= costs.crowded * live_values(for_lanes):
        return for_one, for_one
    return for_one, for_lanes


def _applied(passes: tuple[Pass, ...], program: Program) -> Program:
    for apply in passes:
        passed = apply(program)
        program = program if passed is program else check(passed, after=apply.__name__)
    return program


def _operations(program: Program) -> int:
    counted = cost(program)
    return counted.total + counted.div + counted.neg
