"""PROGRAM: straight-line, single-assignment arithmetic on scalars: all that lowering hands to emission."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from itertools import chain
from operator import itemgetter
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


@lru_cache(maxsize=128)
def slots_of(vector: str, count: int) -> tuple[Slot, ...]:
    """The entries of a vector, which each trace of a search names again."""
    return tuple(Slot(vector, index) for index in range(count))


class Instr(NamedTuple):
    """One instruction; `args` point at earlier instructions, `slot` belongs to loads, `value` to constants."""

    op: Op
    args: tuple[int, ...] = ()
    slot: Slot | None = None
    value: float | None = None

    def renumbered(self, new_index: Sequence[int] | Mapping[int, int]) -> Instr:
        """The same operation on the values that its arguments have become; itself where none has moved."""
        op, args, _, _ = self
        if len(args) == 2:
            moved: tuple[int, ...] = (new_index[args[0]], new_index[args[1]])
        elif not args:
            return self
        else:
            moved = tuple([new_index[a] for a in args])
        return self if moved == args else tuple.__new__(Instr, (op, moved, None, None))

    def canonical(self, new_index: Sequence[int] | Mapping[int, int]) -> Instr:
        """The same on the values that its arguments have become, commutative ones in ascending order; itself where it is
        that already."""
        op, args, _, _ = self
        if len(args) != 2:
            return self.renumbered(new_index)
        first, second = new_index[args[0]], new_index[args[1]]
        if first > second and op in _COMMUTATIVE:
            first, second = second, first
        moved = (first, second)
        return self if moved == args else operation(op, moved)


def operation(op: Op, args: tuple[int, ...]) -> Instr:
    """Instr(op, args), made in a third of the time: passes make some hundred thousand."""
    return tuple.__new__(Instr, (op, args, None, None))


@dataclass(frozen=True, slots=True)
class Program:
    """Instructions in an order in which every argument precedes its use, and what they put out.

    body     instruction i defines value i
    outputs  (slot, index of the value stored there), in order of storing
    """

    body: tuple[Instr, ...]
    outputs: tuple[tuple[Slot, int], ...]
    _arguments: list[tuple[NDArray[np.intp], NDArray[np.intp]]] = field(
        default_factory=list, init=False, repr=False, compare=False
    )
    _uses: list[list[int]] = field(default_factory=list, init=False, repr=False, compare=False)

    def arguments(self) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """(k,) the arguments of all instructions in their order, and (k,) the instruction of each; found once."""
        if not self._arguments:
            given = list(map(itemgetter(1), self.body))
            counts = np.fromiter(map(len, given), np.intp, len(given))
            flat = np.fromiter(chain.from_iterable(given), np.intp, int(counts.sum()))
            self._arguments.append((flat, np.repeat(np.arange(len(given)), counts)))
        return self._arguments[0]

    def inputs(self) -> tuple[Slot, ...]:
        """Slots read, each once, in order of vector name and index."""
        return tuple(sorted({i.slot for i in self.body if i.slot is not None}))

    def uses(self) -> Sequence[int]:
        """How often each value is an argument or an output; counted once."""
        if not self._uses:
            count: list[int] = np.bincount(self.arguments()[0], minlength=len(self.body)).tolist()
            for _, index in self.outputs:
                count[index] += 1
            self._uses.append(count)
        return self._uses[0]

    def __iter__(self) -> Iterator[Instr]:
        return iter(self.body)

    def __len__(self) -> int:
        return len(self.body)
