"""Nest sums so that their results are ready early: the term that is ready last is added last, and products are added by
multiply-add."""

from __future__ import annotations

from typing import NamedTuple

from psdmc.program.program import Instr, Op, Program
from psdmc.target.costs import Latency
from psdmc.target.native import COSTS

Term = tuple[bool, int]
"""A term of a sum: whether it is subtracted, and the value."""


def cycles(latency: Latency) -> dict[Op, int]:
    """Cycles until the result of each operation is ready."""
    return {
        Op.LOAD: latency.load,
        Op.CONST: 0,
        Op.ADD: latency.add,
        Op.SUB: latency.add,
        Op.MUL: latency.mul,
        Op.DIV: latency.div,
        Op.NEG: latency.neg,
        Op.SIN: latency.sincos,
        Op.COS: latency.sincos,
    }


def fuse_sums(program: Program, latency: Latency = COSTS.latency) -> Program:
    """Re-nest every sum, always adding the two parts that are ready soonest on the target.

    Needs:  every argument precedes its use.
    Keeps:  operation counts; output values up to rounding (sums are reordered).
    Gives:  short dependency chains, counted with fused multiply-adds.
    """
    return _Fusion(program, latency).run()


class _Part(NamedTuple):
    """A term or partial sum under construction: `factors` of a product that the next addition swallows, else none."""

    negative: bool
    factors: tuple[int, ...]
    value: int


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
            if instr.op in (Op.ADD, Op.SUB):
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
            for instr in body
            if instr.op in (Op.ADD, Op.SUB)
            for a in instr.args
            if body[a].op in (Op.ADD, Op.SUB) and self.uses[a] == 1
        }

    def _terms(self, root: int) -> list[Term]:
        """The flattened sum; its first term is never subtracted."""
        out: list[Term] = []
        pending: list[Term] = [(False, root)]
        while pending:
            negative, index = pending.pop()
            instr = self.program.body[index]
            if index == root or index in self.inner:
                left, right = instr.args
                pending.append((negative != (instr.op is Op.SUB), right))
                pending.append((negative, left))
            else:
                out.append((negative, index))
        return out

    def _chain(self, terms: list[Term]) -> int:
        """Add the two terms that are ready soonest until one is left; its index."""
        parts = [_Part(negative, self._operands(index), self.new_index[index]) for negative, index in terms]
        parts.sort(key=lambda part: part.value)
        while len(parts) > 2:
            first = min(range(len(parts)), key=lambda k: (self._done(parts[k]), k))
            second = min(
                (k for k in range(len(parts)) if k != first),
                key=lambda k: (self._sum_done(parts[first], parts[k]), k),
            )
            low, high = sorted((first, second))
            total = self._add(parts[low], parts[high])
            parts[low] = total
            del parts[high]
        return self._add(*parts).value

    def _operands(self, index: int) -> tuple[int, ...]:
        """The factors of a product that an addition may absorb; empty where it may not."""
        instr = self.program.body[index]
        if instr.op is Op.MUL and self.uses[index] == 1:
            return tuple(self.new_index[a] for a in instr.args)
        return ()

    def _done(self, part: _Part) -> int:
        return max(self.ready[a] for a in part.factors) if part.factors else self.ready[part.value]

    def _sum_done(self, a: _Part, b: _Part) -> int:
        if not a.factors and not b.factors:
            return max(self.ready[a.value], self.ready[b.value]) + self.cycles[Op.ADD]
        if a.factors and b.factors:
            return min(max(self.ready[x.value], self._done(y)) + self.fused for x, y in ((a, b), (b, a)))
        return max(self._done(a), self._done(b)) + self.fused

    def _add(self, a: _Part, b: _Part) -> _Part:
        """The sum of two parts; their difference where one is negative. Negative where both are."""
        when = self._sum_done(a, b)
        if a.negative == b.negative:
            instr = Instr(Op.ADD, (a.value, b.value)).canonical()
        else:
            plus, minus = (b, a) if a.negative else (a, b)
            instr = Instr(Op.SUB, (plus.value, minus.value))
        self.body.append(instr)
        self.ready.append(when)
        return _Part(a.negative and b.negative, (), len(self.body) - 1)

    def _append(self, instr: Instr) -> int:
        start = max((self.ready[a] for a in instr.args), default=0)
        self.body.append(instr)
        self.ready.append(start + self.cycles[instr.op])
        return len(self.body) - 1
