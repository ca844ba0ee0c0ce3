"""Derivatives of a PROGRAM as PROGRAMs: forward mode (tangents), reverse mode (adjoints), and Jacobians by either.

The road for anything that can be traced, and the oracle for what has recursions of its own. Griewank, Walther 2008,
chapters 3 (modes) and 4 (what each costs). Every result keeps the outputs of the PROGRAM that it differentiates.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

from psdmc.program.passes.drop_unused import drop_unused
from psdmc.program.program import Instr, Op, Program, Slot
from psdmc.program.trace import Number, Symbol, Tracer

Value = Symbol | Number
Mode = Literal["forward", "reverse"]


@dataclass(frozen=True, slots=True)
class Block:
    """One matrix of derivatives: entry [i, j] = d of[i] / d by[j], stored row-major as vector `name`."""

    name: str
    of: str
    by: str
    rows: int
    columns: int


def jvp(program: Program, tangents: Mapping[str, str], derivatives: Mapping[str, str]) -> Program:
    """The outputs and their derivatives along given tangents of the inputs (forward mode).

    tangents     input vector -> name of a new input of the same length; inputs that are not named are held fixed
    derivatives  output vector -> name of the new output that is its derivative along the tangents
    """
    replay = _Replay(program)
    seeds: dict[Slot, Value] = {}
    for slot in program.inputs():
        if slot.vector in tangents:
            seeds[slot] = replay.load(Slot(tangents[slot.vector], slot.index))
    moved = replay.tangents(seeds)
    along = [
        (Slot(derivatives[slot.vector], slot.index), moved[index])
        for slot, index in program.outputs
        if slot.vector in derivatives
    ]
    return replay.finish(along)


def vjp(
    program: Program,
    cotangents: Mapping[str, str],
    gradients: Mapping[str, str],
    sizes: Mapping[str, int],
) -> Program:
    """The outputs and the gradient of (sum of cotangent . output) by inputs (reverse mode).

    cotangents  output vector -> name of a new input of the same length; outputs that are not named do not count
    gradients   input vector -> name of the new output that is the gradient by it
    sizes       length of each input vector in `gradients`; entries that the PROGRAM does not read get zero
    """
    replay = _Replay(program)
    seeds: list[tuple[int, Value]] = [
        (index, replay.load(Slot(cotangents[slot.vector], slot.index)))
        for slot, index in program.outputs
        if slot.vector in cotangents
    ]
    adjoints = replay.adjoints(seeds)
    found = [
        (Slot(name, i), adjoints.get(Slot(vector, i), 0.0))
        for vector, name in gradients.items()
        for i in range(sizes[vector])
    ]
    return replay.finish(found)


def jacobians(program: Program, blocks: Sequence[Block], mode: Mode) -> Program:
    """The outputs and whole matrices of their derivatives, column by column (forward) or row by row (reverse).

    Both modes give the same numbers up to rounding and differ in what they cost: forward mode a sweep per input,
    reverse mode a sweep per output.
    """
    replay = _Replay(program)
    columns = _columns if mode == "forward" else _rows
    entries: dict[tuple[str, int, int], Value] = {}
    for block in blocks:
        for i, j, value in columns(replay, block):
            entries[block.name, i, j] = value
    stored = [
        (Slot(block.name, i * block.columns + j), entries.get((block.name, i, j), 0.0))
        for block in blocks
        for i in range(block.rows)
        for j in range(block.columns)
    ]
    return replay.finish(stored)


def _columns(replay: _Replay, block: Block) -> Iterator[tuple[int, int, Value]]:
    for j in range(block.columns):
        moved = replay.tangents({Slot(block.by, j): 1.0})
        for slot, index in replay.program.outputs:
            if slot.vector == block.of:
                yield slot.index, j, moved[index]


def _rows(replay: _Replay, block: Block) -> Iterator[tuple[int, int, Value]]:
    for slot, index in replay.program.outputs:
        if slot.vector == block.of:
            adjoints = replay.adjoints([(index, 1.0)])
            for j in range(block.columns):
                yield slot.index, j, adjoints.get(Slot(block.by, j), 0.0)


class _Replay:
    """A PROGRAM recorded again on symbols, so that derivatives can be written in terms of its values."""

    def __init__(self, program: Program) -> None:
        self.program = program
        self.tracer = Tracer()
        self.values: list[Value] = []
        for instr in program.body:
            self.values.append(self._value(instr))

    def load(self, slot: Slot) -> Symbol:
        return self.tracer.symbol(slot)

    def finish(self, derivatives: Sequence[tuple[Slot, Value]]) -> Program:
        kept = [(slot, self.values[index]) for slot, index in self.program.outputs]
        return drop_unused(self.tracer.finish([*kept, *derivatives]))

    def tangents(self, seeds: Mapping[Slot, Value]) -> list[Value]:
        """The derivative of every value along the seeds (zero for slots that are not named)."""
        moved: list[Value] = []
        for index, instr in enumerate(self.program.body):
            if instr.slot is not None:
                moved.append(seeds.get(instr.slot, 0.0))
                continue
            total: Value = 0.0
            for argument, partial in self._partials(index, instr):
                if not _is_zero(moved[argument]):
                    total = total + partial * moved[argument]
            moved.append(total)
        return moved

    def adjoints(self, seeds: Sequence[tuple[int, Value]]) -> dict[Slot, Value]:
        """The derivative of sum(seed . value) by every input that is read."""
        bars: list[Value] = [0.0] * len(self.program.body)
        for index, seed in seeds:
            bars[index] = bars[index] + seed
        found: dict[Slot, Value] = {}
        for index in reversed(range(len(bars))):
            instr, bar = self.program.body[index], bars[index]
            if _is_zero(bar):
                continue
            if instr.slot is not None:
                found[instr.slot] = found.get(instr.slot, 0.0) + bar
            for argument, partial in self._partials(index, instr):
                bars[argument] = bars[argument] + partial * bar
        return found

    def _value(self, instr: Instr) -> Value:
        if instr.slot is not None:
            return self.load(instr.slot)
        if instr.value is not None:
            return instr.value
        a = self.values[instr.args[0]]
        if instr.op in (Op.SIN, Op.COS):
            return _sincos(a)[0 if instr.op is Op.SIN else 1]
        if instr.op is Op.NEG:
            return -a
        b = self.values[instr.args[1]]
        if instr.op is Op.ADD:
            return a + b
        if instr.op is Op.SUB:
            return a - b
        return a * b if instr.op is Op.MUL else a / b

    def _partials(self, index: int, instr: Instr) -> Iterator[tuple[int, Value]]:
        """(argument, derivative of value `index` by it) for each argument; the same argument may come twice."""
        args = instr.args
        if instr.op is Op.ADD:
            yield from ((args[0], 1.0), (args[1], 1.0))
        elif instr.op is Op.SUB:
            yield from ((args[0], 1.0), (args[1], -1.0))
        elif instr.op is Op.MUL:
            yield from ((args[0], self.values[args[1]]), (args[1], self.values[args[0]]))
        elif instr.op is Op.DIV:
            reciprocal = 1.0 / self.values[args[1]]
            yield from ((args[0], reciprocal), (args[1], -(self.values[index] * reciprocal)))
        elif instr.op is Op.NEG:
            yield args[0], -1.0
        elif instr.op is Op.SIN:
            yield args[0], _sincos(self.values[args[0]])[1]
        elif instr.op is Op.COS:
            yield args[0], -_sincos(self.values[args[0]])[0]


def _sincos(angle: Value) -> tuple[Value, Value]:
    return angle.sincos() if isinstance(angle, Symbol) else (math.sin(angle), math.cos(angle))


def _is_zero(value: Value) -> bool:
    return not isinstance(value, Symbol) and value == 0
