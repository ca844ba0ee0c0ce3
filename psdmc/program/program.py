"""PROGRAM: a list of scalar operations without branches or loops, in which each value is assigned once. All generated
code is made from PROGRAMs."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import chain
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from psdmc.program.operations import Op as Op

_COMMUTATIVE = frozenset(op for op in Op if op.operation.commutative)


class Slot(NamedTuple):
    """One entry of a named vector: an input to load or an output to store."""

    vector: str
    index: int  # type: ignore[assignment]  # a tuple's method, which nothing here calls

    def __str__(self) -> str:
        return f"{self.vector}[{self.index}]"


class Instr(NamedTuple):
    """One instruction of a PROGRAM. `args` are the indices of earlier instructions, `slot` is for loads, `value` for
    constants."""

    op: Op
    args: tuple[int, ...] = ()
    slot: Slot | None = None
    value: float | None = None

    def renumbered(self, new_index: Sequence[int] | Mapping[int, int]) -> Instr:
        """Return the same instruction with renumbered arguments; the instruction itself if no number changes."""
        op, args, _, _ = self
        if len(args) == 2:
            moved: tuple[int, ...] = (new_index[args[0]], new_index[args[1]])
        elif not args:
            return self
        else:
            moved = tuple([new_index[a] for a in args])
        return self if moved == args else tuple.__new__(Instr, (op, moved, None, None))

    def canonical(self, new_index: Sequence[int] | Mapping[int, int]) -> Instr:
        """Return the same instruction with renumbered arguments, commutative ones in ascending order; the instruction
        itself if nothing changes."""
        op, args, _, _ = self
        if len(args) != 2:
            return self.renumbered(new_index)
        first, second = new_index[args[0]], new_index[args[1]]
        if first > second and op in _COMMUTATIVE:
            first, second = second, first
        moved = (first, second)
        return self if moved == args else operation(op, moved)


def operation(op: Op, args: tuple[int, ...]) -> Instr:
    """Return Instr(op, args) in a third of the time. Speed matters because passes make some hundred thousand
    instructions."""
    return tuple.__new__(Instr, (op, args, None, None))


@dataclass(frozen=True, slots=True)
class Program:
    """A list of instructions, in which every argument precedes its use, with the values that are stored.

    body     instruction i defines value i
    outputs  (slot, index of the value stored there), in order of storing
    """

    body: tuple[Instr, ...]
    outputs: tuple[tuple[Slot, int], ...]
    _arguments: list[tuple[NDArray[np.intp], NDArray[np.intp]]] = field(
        default_factory=list, init=False, repr=False, compare=False
    )

    def arguments(self) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Two arrays (k,): the arguments of all instructions in their order, and the instruction to which each belongs.
        They are computed once."""
        if not self._arguments:
            given = [args for _, args, _, _ in self.body]
            counts = np.fromiter(map(len, given), np.intp, len(given))
            flat = np.fromiter(chain.from_iterable(given), np.intp, int(counts.sum()))
            self._arguments.append((flat, np.repeat(np.arange(len(given)), counts)))
        return self._arguments[0]

    def inputs(self) -> tuple[Slot, ...]:
        """Return the slots that are read, without duplicates, in order of vector name and index."""
        return tuple(sorted({i.slot for i in self.body if i.slot is not None}))

    def uses(self) -> list[int]:
        """How often each value is used as an argument or an output."""
        count: list[int] = np.bincount(self.arguments()[0], minlength=len(self.body)).tolist()
        for _, index in self.outputs:
            count[index] += 1
        return count

    def __iter__(self) -> Iterator[Instr]:
        return iter(self.body)

    def __len__(self) -> int:
        return len(self.body)
