"""Runs the passes that improve a PROGRAM (list of operations to generate). After each pass, a checker tests whether the
PROGRAM still follows the rules."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps

from psdmc.program.cost import cost
from psdmc.program.passes.absorb_negations import absorb_negations
from psdmc.program.passes.drop_unused import drop_unused
from psdmc.program.passes.factor_common import factor_common
from psdmc.program.passes.fold_constants import fold_constants
from psdmc.program.passes.fuse_sums import fuse_sums
from psdmc.program.passes.merge_duplicates import merge_duplicates
from psdmc.program.passes.schedule import beyond_registers, live_values, schedule
from psdmc.program.program import Op, Program, check
from psdmc.target.presets import COSTS
from psdmc.target.target import Costs

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

AT_ONCE: frozenset[Pass] = frozenset((drop_unused, fold_constants, merge_duplicates, absorb_negations))
"""Passes that keep every bit: a second run of one changes nothing."""

LAST: tuple[Pass, ...] = (merge_duplicates, drop_unused)
"""Passes of both forms before instructions are put in order."""


LAST_FOR_LANES: tuple[Pass, ...] = (schedule,)
"""For lanes: many states run side by side, so that dependent operations do not delay them; values that do not fit the
registers do."""


def last_for_one_state(costs: Costs) -> tuple[Pass, ...]:
    """Return the last passes of the code generator for code that computes one state. The time of such code depends on
    its longest chain of dependent operations. The passes shorten this chain, by the target's latencies."""

    @wraps(fuse_sums)
    def fuse(program: Program) -> Program:
        return fuse_sums(program, costs.latency)

    return fuse, schedule


LONGEST = 10
"""Largest number of rounds; two or three are usual."""

LONG, LONG_OF_LARGE, LITTLE = 25_000, 2_000, 0.01
"""Instructions from which on a round that saves less than this share of the operations is the last one: behind it, the next
one saves less than a thousandth of a humanoid's Coriolis matrix."""


def optimize(program: Program, costs: Costs = COSTS, *, lanes: bool = False) -> Program:
    """Return a PROGRAM (list of operations to generate) that computes equal outputs, up to rounding, with fewer
    operations. The order of operations suits the target: one state per call or, with `lanes`, one state per SIMD lane.

    Raises InternalError, naming the pass, if a pass breaks a rule for PROGRAMs.
    """
    return ordered(shortened(program), costs)[1 if lanes else 0]


def shortened(program: Program, of_large: bool = False) -> Program:
    """Return a PROGRAM (list of operations to generate) that computes equal outputs with fewer operations. The order of
    instructions is chosen later, by `ordered`.

    The passes are applied in rounds, until a round saves nothing. For a long PROGRAM, they end after a round that saves
    at most the share LITTLE of the operations. A PROGRAM is long from LONG operations on. With `of_large` (a robot of
    many joints), it is long from LONG_OF_LARGE operations on.
    """
    operations, long = _operations(program), LONG_OF_LARGE if of_large else LONG
    done: dict[Pass, Program] = {}
    for _ in range(LONGEST):
        shorter = _applied(ROUND, program, done)
        if shorter is program or (left := _operations(shorter)) >= operations:
            break
        is_last = len(program) >= long and left > (1.0 - LITTLE) * operations
        program, operations = shorter, left
        if is_last:
            break
    return program


def ordered(short: Program, costs: Costs = COSTS) -> tuple[Program, Program]:
    """Return a PROGRAM (list of operations to generate) in two orders. The first suits one state per call, the second
    one state per lane of a SIMD vector.

    Both orders are equal if the target has no lanes, or if one order serves both. Spilled values are values that do not
    fit in registers. If they delay the code for one state, this code takes the order with fewer spilled values.
    """
    last = _applied(LAST, short, {})
    for_lanes = _applied(LAST_FOR_LANES, last, {})
    for_one = _applied(last_for_one_state(costs), last, {})
    if costs.spills_wait:
        for_one = min(for_one, for_lanes, key=lambda each: beyond_registers(each, costs.registers))
    if not costs.has_vectors or live_values(for_one) <= costs.crowded * live_values(for_lanes):
        return for_one, for_one
    return for_one, for_lanes


FEWER = 0.95
"""Of the operations of short chains, the share to which chains of multiply-adds must reduce them. Of a quadruped's
functions, two stages reach it: those with up to a hundred sums of six products, which do not wait for each other."""


def ordered_for_limbs(short: Program, costs: Costs = COSTS) -> Program:
    """Return a PROGRAM (list of operations to generate) of equal limbs, such as legs, in an order for one state per call.

    The order is the first one of `ordered`, unless sums as they are written have fewer operations. A sum whose first
    parts are added side by side has more multiplications without an addition.
    """
    for_one = ordered(short, costs)[0]
    as_written = _applied(LAST_FOR_LANES, _applied(LAST, short, {}), {})
    return as_written if _fused(as_written) < FEWER * _fused(for_one) else for_one


def _fused(program: Program) -> int:
    found = cost(program)
    return found.mul + found.add - found.fused


def _applied(passes: tuple[Pass, ...], program: Program, done: dict[Pass, Program]) -> Program:
    """The PROGRAM behind some passes. `done` has for each pass the PROGRAM that it has nothing more to do for."""
    for apply in passes:
        if done.get(apply) is program:
            continue
        passed = apply(program)
        if passed is program or apply in AT_ONCE:
            done[apply] = passed
        program = program if passed is program else check(passed, after=apply.__name__)
    return program


def _operations(program: Program) -> int:
    """All but loads, constants, sines and cosines."""
    sine, cosine = Op.SIN, Op.COS
    return sum([op is not sine and op is not cosine for op, args, _, _ in program.body if args])
