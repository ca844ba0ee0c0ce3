"""A pass of the code generator: it changes the order of additions in sums so that results are ready early. The term
that is ready last is added last, and products are added by fused multiply-add."""

from __future__ import annotations

import math
from operator import attrgetter
from typing import NamedTuple

from psdmc.program.operations import Unit
from psdmc.program.program import Instr, Op, Program, operation
from psdmc.target.presets import COSTS
from psdmc.target.target import Latency

SUMS = frozenset((Op.ADD, Op.SUB))
_VALUE = attrgetter("value")

Term = tuple[bool, int]
"""A term of a sum: whether it is subtracted, and the value."""


def cycles(latency: Latency) -> dict[Op, int]:
    """Return for each operation (sum, product, sine ...) the processor cycles until its result is ready."""
    return {op: 0 if op.unit is Unit.NONE else getattr(latency, op.unit) for op in Op}


def fuse_sums(program: Program, latency: Latency = COSTS.latency) -> Program:
    """Return the PROGRAM (list of operations to generate) with the additions of every sum in a new order. The two parts
    of a sum that are ready soonest are always added first, by the latencies of the target processor.

    Needs:  every argument precedes its use.
    Keeps:  operation counts; output values up to rounding (sums are reordered).
    Gives:  short chains of operations that wait for each other, counted with fused multiply-adds.
    """
    return _Fusion(program, latency).run()


class _Part(NamedTuple):
    """A term or partial sum under construction.

    is_product  whether it is one that the next addition swallows
    begins      cycle from which on that addition can go ahead
    ready       cycle at which its value is there
    """

    negative: bool
    is_product: bool
    value: int
    begins: int
    ready: int


class _Fusion:
    """Rebuilds the program. Sums whose value is used once, by another sum, are taken apart first."""

    def __init__(self, program: Program, latency: Latency) -> None:
        self.program, self.uses = program, program.uses()
        self.cycles, self.fused = cycles(latency), latency.fused
        self.inner = self._inner_sums()
        self.body: list[Instr] = []
        self.ready: list[int] = []
        self.new_index: dict[int, int] = {}

    def run(self) -> Program:
        for i, instr in enumerate(self.program.body):
            if i in self.inner:
                continue
            if instr[0] in SUMS:
                self.new_index[i] = self._chain(self._terms(i))
            else:
                self.new_index[i] = self._append(instr.renumbered(self.new_index))
        outputs = tuple((slot, self.new_index[i]) for slot, i in self.program.outputs)
        return Program(tuple(self.body), outputs)

    def _inner_sums(self) -> set[int]:
        """Sums used once, by a sum."""
        body = self.program.body
        return {
            a
            for op, args, _, _ in body
            if op in SUMS
            for a in args
            if self.uses[a] == 1 and body[a][0] in SUMS
        }

    def _terms(self, root: int) -> list[Term]:
        """The flattened sum; its first term is never subtracted."""
        out: list[Term] = []
        pending: list[Term] = [(False, root)]
        while pending:
            negative, index = pending.pop()
            if index == root or index in self.inner:
                op, (left, right), _, _ = self.program.body[index]
                pending.append((negative != (op is Op.SUB), right))
                pending.append((negative, left))
            else:
                out.append((negative, index))
        return out

    def _chain(self, terms: list[Term]) -> int:
        """Add the two terms that are ready soonest until one is left; its index."""
        parts = sorted([self._part(*term) for term in terms], key=_VALUE)
        while len(parts) > 2:
            begins = [part.begins for part in parts]
            first = begins.index(min(begins))
            sums: list[float] = [self._sum_ready(parts[first], part) for part in parts]
            sums[first] = math.inf
            low, high = sorted((first, sums.index(min(sums))))
            parts[low] = self._add(parts[low], parts[high])
            del parts[high]
        return self._add(*parts).value

    def _part(self, negative: bool, index: int) -> _Part:
        value = self.new_index[index]
        op, args, _, _ = self.program.body[index]
        ready = self.ready[value]
        if op is not Op.MUL or self.uses[index] != 1:
            return _Part(negative, False, value, ready, ready)
        first, second = args
        begins = max(self.ready[self.new_index[first]], self.ready[self.new_index[second]])
        return _Part(negative, True, value, begins, ready)

    def _sum_ready(self, a: _Part, b: _Part) -> int:
        """The cycle at which the sum of two parts is there."""
        if not a.is_product and not b.is_product:
            return max(a.ready, b.ready) + self.cycles[Op.ADD]
        if a.is_product and b.is_product:
            return min(max(a.ready, b.begins), max(b.ready, a.begins)) + self.fused
        return max(a.begins, b.begins) + self.fused

    def _add(self, a: _Part, b: _Part) -> _Part:
        """The sum of two parts; their difference where one is negative. Negative where both are."""
        ready = self._sum_ready(a, b)
        if a.negative == b.negative:
            first, second = a.value, b.value
            instr = operation(Op.ADD, (first, second) if first < second else (second, first))
        else:
            plus, minus = (b, a) if a.negative else (a, b)
            instr = operation(Op.SUB, (plus.value, minus.value))
        self.body.append(instr)
        self.ready.append(ready)
        return _Part(a.negative and b.negative, False, len(self.body) - 1, ready, ready)

    def _append(self, instr: Instr) -> int:
        op, args, _, _ = instr
        start = max([self.ready[a] for a in args]) if args else 0
        self.body.append(instr)
        self.ready.append(start + self.cycles[op])
        return len(self.body) - 1
