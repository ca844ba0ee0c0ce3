"""The cost of a PROGRAM (list of operations): its operations, counted by kind. By the costs of a target processor, a
Scoring makes one number of them, by which a search compares PROGRAMs."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass

from psdmc.program.operations import Unit
from psdmc.program.program import Op, Program
from psdmc.target.presets import COSTS
from psdmc.target.target import Costs

_ADD, _SUB, _MUL, _SIN, _COS = Op.ADD, Op.SUB, Op.MUL, Op.SIN, Op.COS


@dataclass(frozen=True, slots=True)
class Cost:
    """Numbers of operations by kind. `add` includes subtractions. Negations are counted separately, because most cost
    nothing.

    div     divisions and square roots: both keep one unit of the processor busy for about as long
    fused   multiplications that the processor can do together with an addition or subtraction (fused multiply-add):
            those whose result only one addition or subtraction uses. Each addition or subtraction counts at most once
    sincos  distinct angles whose sine or cosine is computed
    choice  minima, maxima, magnitudes and selections
    call    elementary functions of the C library
    """

    mul: int
    add: int
    div: int
    neg: int
    sincos: int
    fused: int
    choice: int = 0
    call: int = 0

    @property
    def total(self) -> int:
        """Return mul + add, the number of multiplications and additions, which papers compare."""
        return self.mul + self.add

    def __str__(self) -> str:
        extra = f" + {self.div} div" if self.div else ""
        further = ((self.choice, "choice"), (self.call, "call"))
        more = "".join(f" + {count} {word}" for count, word in further if count)
        return f"{self.mul} mul + {self.add} add{extra} + {self.sincos} sincos{more}"


def cost(program: Program) -> Cost:
    """Count the operations of the PROGRAM (list of operations) by kind. `fused` counts the additions and subtractions
    of which one argument is a product that no other operation uses."""
    body, uses = program.body, program.uses()
    mul = add = fused = 0
    others: list[Op] = []
    angles: set[int] = set()
    for op, args, _, _ in body:
        if op is _MUL:
            mul += 1
        elif op is _ADD or op is _SUB:
            add += 1
            a, b = args
            fused += (uses[a] == 1 and body[a][0] is _MUL) or (uses[b] == 1 and body[b][0] is _MUL)
        elif op is _SIN or op is _COS:
            angles.add(args[0])
        elif args:
            others.append(op)
    return counted(others, mul, add, len(angles), fused)


def counted(others: Iterable[Op], mul: int, add: int, sincos: int, fused: int) -> Cost:
    """Return the Cost with the given numbers of products (`mul`), sums (`add`), angles (`sincos`) and fused operations.
    `others` lists all further operations."""
    units = Counter(op.unit for op in others)
    rest = (units[Unit.DIV], units[Unit.NEG], sincos, fused, units[Unit.CHOICE], units[Unit.CALL])
    return Cost(mul, add, *rest)


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
        # States of one vector, which the C library takes one by one.
        states = costs.angles_per_sincos // self.angles_per_sincos
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
