"""PROGRAM: a list of scalar operations without branches or loops, in which each value is assigned once. C code is
printed from PROGRAMs.

`check` tests the rules that every PROGRAM obeys, after each pass, that is, after each change of a whole PROGRAM.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from itertools import chain
from operator import itemgetter
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from psdmc.errors import InternalError
from psdmc.program.operations import Op as Op

_COMMUTATIVE = frozenset(op for op in Op if op.operation.commutative)


class Slot(NamedTuple):
    """The place of one number in a named array of a function: the array's name, and the index of the entry. An input is
    loaded from a slot, an output is stored into a slot."""

    vector: str
    index: int  # type: ignore[assignment]  # a tuple's method, which nothing here calls

    def __str__(self) -> str:
        return f"{self.vector}[{self.index}]"


@lru_cache(maxsize=128)
def slots_of(vector: str, count: int) -> tuple[Slot, ...]:
    """Return the names of all entries of a vector. They are cached, as each trace of a search needs them again."""
    return tuple(Slot(vector, index) for index in range(count))


class Instr(NamedTuple):
    """One instruction of a PROGRAM (list of operations to generate): the operation and what it works on.

    `args` are the indices of the earlier instructions whose results it takes. `slot` is the input that a load reads,
    `value` the number of a constant.
    """

    op: Op
    args: tuple[int, ...] = ()
    slot: Slot | None = None
    value: float | None = None

    def renumbered(self, new_index: Sequence[int] | Mapping[int, int]) -> Instr:
        """Return the instruction with the indices of its arguments replaced by those in `new_index`. If no index
        changes, return the unchanged instruction."""
        op, args, _, _ = self
        if len(args) == 2:
            moved: tuple[int, ...] = (new_index[args[0]], new_index[args[1]])
        elif not args:
            return self
        else:
            moved = tuple([new_index[a] for a in args])
        return self if moved == args else tuple.__new__(Instr, (op, moved, None, None))

    def canonical(self, new_index: Sequence[int] | Mapping[int, int]) -> Instr:
        """Return the instruction with the indices of its arguments replaced by those in `new_index`. The two indices of
        a commutative operation, such as a sum, are put in ascending order."""
        op, args, _, _ = self
        if len(args) != 2:
            return self.renumbered(new_index)
        first, second = new_index[args[0]], new_index[args[1]]
        if first > second and op in _COMMUTATIVE:
            first, second = second, first
        moved = (first, second)
        return self if moved == args else operation(op, moved)


def operation(op: Op, args: tuple[int, ...]) -> Instr:
    """Return an instruction with this operation and these arguments, three times as fast as Instr(op, args). Speed
    matters because passes make some hundred thousand instructions."""
    return tuple.__new__(Instr, (op, args, None, None))


@dataclass(frozen=True, slots=True)
class Program:
    """PROGRAM: a list of instructions, in which every argument precedes its use, and the places where results are
    stored.

    body     the instructions; the result of instruction i is called value i
    outputs  (slot, index of the value stored there), in order of storing
    """

    body: tuple[Instr, ...]
    outputs: tuple[tuple[Slot, int], ...]
    _arguments: list[tuple[NDArray[np.intp], NDArray[np.intp]]] = field(
        default_factory=list, init=False, repr=False, compare=False
    )
    _uses: list[list[int]] = field(default_factory=list, init=False, repr=False, compare=False)

    def arguments(self) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Return two arrays (k,) for the k arguments of all instructions. The first has the index of each argument's
        value, the second that of the instruction that takes it. They are computed at the first call."""
        if not self._arguments:
            given = list(map(itemgetter(1), self.body))
            counts = np.fromiter(map(len, given), np.intp, len(given))
            flat = np.fromiter(chain.from_iterable(given), np.intp, int(counts.sum()))
            self._arguments.append((flat, np.repeat(np.arange(len(given)), counts)))
        return self._arguments[0]

    def inputs(self) -> tuple[Slot, ...]:
        """Return the inputs that the PROGRAM reads, once each, sorted by vector name and index."""
        return tuple(sorted({i.slot for i in self.body if i.slot is not None}))

    def uses(self) -> Sequence[int]:
        """Return for each instruction how often its result is an argument of another instruction or an output. The numbers
        are counted at the first call."""
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


_WITH_TWO = frozenset(op for op in Op if op.arity == 2)


def check(program: Program, after: str = "tracing") -> Program:
    """Return the given PROGRAM (list of operations) unchanged. Raises InternalError if the PROGRAM breaks a rule; the
    message names `after`, the step that changed it last."""
    for i, instr in enumerate(program.body):
        op, args, slot, value = instr
        if len(args) == 2 and op in _WITH_TWO and slot is None and value is None:
            a, b = args
            if 0 <= a < i and 0 <= b < i:
                continue  # as nearly all: the same as _is_sound says
        if not _is_sound(i, instr):
            raise InternalError(f"after {after}: {_fault(i, instr)}")
    slots = [slot for slot, _ in program.outputs]
    if len(set(slots)) != len(slots):
        raise InternalError(f"after {after}: an output is stored twice")
    if any(not 0 <= index < len(program.body) for _, index in program.outputs):
        raise InternalError(f"after {after}: an output is not defined")
    return program


def _is_sound(i: int, instr: Instr) -> bool:
    """Whether instruction i obeys the rules. Fast, as it is called for every instruction after every pass."""
    op, args, slot, value = instr
    if op is Op.LOAD:
        return slot is not None and value is None and not args
    if op is Op.CONST:
        return value is not None and math.isfinite(value) and slot is None and not args
    if slot is not None or value is not None:
        return False
    return len(args) == op.arity and all(0 <= a < i for a in args)


def _fault(i: int, instr: Instr) -> str:
    """The rule that instruction i breaks, as text."""
    op, args, slot, value = instr
    if len(args) != op.arity:
        return f"t{i} = {op.value} has {len(args)} arguments"
    if args and (min(args) < 0 or max(args) >= i):
        return f"t{i} uses a value that is not defined before it"
    if (op is Op.LOAD) != (slot is not None):
        return f"t{i}: loads, and only loads, have a slot"
    if (op is Op.CONST) != (value is not None):
        return f"t{i}: constants, and only constants, have a value"
    return f"t{i} is the constant {value}"
