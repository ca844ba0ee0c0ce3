"""Derivatives of a PROGRAM (list of operations) as new PROGRAMs: forward mode (tangents), reverse mode (adjoints), and
Jacobians by either mode.

The methods work for every PROGRAM. Some functions have derivatives by a recursion of their own; tests compare these
with the results here. A new PROGRAM also has the outputs of the given PROGRAM.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

from psdmc.program.interpret import replayed
from psdmc.program.program import Program, Slot
from psdmc.program.slopes import Value, gradients, slopes
from psdmc.program.trace import Symbol, Tracer

Mode = Literal["forward", "reverse"]


@dataclass(frozen=True, slots=True)
class Block:
    """A matrix of derivatives: entry [i, j] is the derivative of output entry of[i] by input entry by[j].

    name  name of the output vector that contains the matrix, row by row
    of    name of an output vector, with `rows` entries
    by    name of an input vector, with `columns` entries
    """

    name: str
    of: str
    by: str
    rows: int
    columns: int


def jvp(program: Program, tangents: Mapping[str, str], derivatives: Mapping[str, str]) -> Program:
    """Return a PROGRAM with the outputs of the given PROGRAM and their derivatives along given directions of the inputs
    (forward mode).

    tangents     input vector -> name of a new input of equal length, the direction; all other inputs are constant
    derivatives  output vector -> name of the new output that is the derivative along the directions
    """
    replay = _Replay(program)
    moving = [slot for slot in program.inputs() if slot.vector in tangents]
    along = [replay.load(Slot(tangents[slot.vector], slot.index)) for slot in moving]
    of = [(slot, value) for slot, value in replay.outputs if slot.vector in derivatives]
    moved = slopes([value for _, value in of], [replay.load(slot) for slot in moving], along)
    return replay.finish(
        [
            (Slot(derivatives[slot.vector], slot.index), slope)
            for (slot, _), slope in zip(of, moved, strict=True)
        ]
    )


def vjp(
    program: Program,
    cotangents: Mapping[str, str],
    gradients_of: Mapping[str, str],
    sizes: Mapping[str, int],
) -> Program:
    """Return a PROGRAM with the outputs of the given PROGRAM, and the gradients of the sum of cotangent . output by
    inputs (reverse mode).

    cotangents    output vector -> name of a new input of equal length, the weights; other outputs have no part in the
                  sum
    gradients_of  input vector -> name of the new output that is the gradient by this input
    sizes         length of each of these input vectors; the gradient by entries that the PROGRAM does not read is zero
    """
    replay = _Replay(program)
    of = [(slot, value) for slot, value in replay.outputs if slot.vector in cotangents]
    weights = [replay.load(Slot(cotangents[slot.vector], slot.index)) for slot, _ in of]
    by = [replay.vector(vector, sizes[vector]) for vector in gradients_of]
    found = gradients([value for _, value in of], weights, by)
    return replay.finish(
        [
            (Slot(name, i), value)
            for name, vector in zip(gradients_of.values(), found, strict=True)
            for i, value in enumerate(vector)
        ]
    )


def jacobians(program: Program, blocks: Sequence[Block], mode: Mode) -> Program:
    """Return a PROGRAM with the outputs of the given PROGRAM and Jacobian matrices, computed column by column (forward
    mode) or row by row (reverse mode).

    Both modes give equal numbers up to rounding, but cost differently. Forward mode repeats the derivatives of all
    operations for each column, reverse mode for each row.
    """
    replay = _Replay(program)
    entries: dict[tuple[str, int, int], Value] = {}
    for block in blocks:
        of = [(slot.index, value) for slot, value in replay.outputs if slot.vector == block.of]
        by = replay.vector(block.by, block.columns)
        if mode == "forward":
            for j, symbol in enumerate(by):
                moved = slopes([value for _, value in of], [symbol], [1.0])
                entries |= {(block.name, i, j): slope for (i, _), slope in zip(of, moved, strict=True)}
        else:
            for i, value in of:
                (row,) = gradients([value], [1.0], [by])
                entries |= {(block.name, i, j): slope for j, slope in enumerate(row)}
    stored = [
        (Slot(block.name, i * block.columns + j), entries.get((block.name, i, j), 0.0))
        for block in blocks
        for i in range(block.rows)
        for j in range(block.columns)
    ]
    return replay.finish(stored)


class _Replay:
    """A PROGRAM recorded on symbols, so that derivatives can be written in terms of its values."""

    def __init__(self, program: Program) -> None:
        self.tracer = Tracer()
        values = replayed(program, self.tracer, {})
        self.outputs = [(slot, value) for (slot, _), value in zip(program.outputs, values, strict=True)]

    def load(self, slot: Slot) -> Symbol:
        return self.tracer.symbol(slot)

    def vector(self, name: str, size: int) -> list[Symbol]:
        return self.tracer.symbols(name, size)

    def finish(self, derivatives: Sequence[tuple[Slot, Value]]) -> Program:
        return self.tracer.finish([*self.outputs, *derivatives])
