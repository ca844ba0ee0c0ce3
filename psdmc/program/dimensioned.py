"""A tracer (recorder of operations on symbols) whose values have physical dimensions. It raises an error at the first
operation with unlike arguments, such as the sum of a mass and a length."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from psdmc.program.dimensions import NUMBER, Known, Unlike, raised
from psdmc.program.program import Op, Slot
from psdmc.program.trace import Constant, Step, Symbol, Tracer, arguments_of

_WORDS = {Op.ADD: "sum", Op.SUB: "difference", Op.MIN: "minimum", Op.MAX: "maximum", Op.SELECT: "choice"}

_append = list.append


class UnlikeArguments(Exception):
    """This error says that an operation has arguments of unlike dimensions. The message has the operation and the units
    of the arguments."""


class DimensionedTracer(Tracer):
    """A tracer (recorder of operations on symbols) that checks the physical dimensions of each operation. Symbols
    append each operation to the list `steps`, and this list makes the check."""

    __slots__ = ("_own",)

    def __init__(self) -> None:
        super().__init__()
        self.steps = self._own = _Steps(self.constants)

    def measured(self, slot: Slot, dimension: Known) -> Symbol:
        """One input of this dimension."""
        self._own.given[slot] = dimension
        return self.symbol(slot)

    def dimension(self, value: Symbol | Constant) -> Known:
        """The dimension of a value."""
        if isinstance(value, Symbol):
            return self._own.dimension(value.index)
        return None if value == 0 else NUMBER

    def stand_ins(self, vector: str, values: Sequence[Symbol | Constant]) -> list[Symbol]:
        return [self.measured(Slot(vector, i), self.dimension(value)) for i, value in enumerate(values)]


class _Steps(list[Step]):
    """Steps, and beside them the dimensions of their values.

    kinds    by step, the number of its dimension in
    seen     all dimensions that there are, and their numbers in
    number   the opposite way
    results  by an operation and the numbers of its two arguments that of its value: most steps are found here
    """

    __slots__ = ("constants", "given", "kinds", "number", "results", "seen")

    def __init__(self, constants: Mapping[int, Constant]) -> None:
        super().__init__()
        self.constants = constants
        self.given: dict[Slot, Known] = {}
        self.kinds: list[int] = []
        self.seen: list[Known] = []
        self.number: dict[Known, int] = {}
        self.results: dict[tuple[Op, int, int], int] = {}

    def dimension(self, index: int) -> Known:
        return self.seen[self.kinds[index]]

    def append(self, step: Step) -> None:
        op, a, b = step
        kinds = self.kinds
        kind = None if b is None else self.results.get((op, kinds[a], kinds[b]))
        kinds.append(self._kind(step) if kind is None else kind)
        _append(self, step)

    def _kind(self, step: Step) -> int:
        op, a, b = step
        dimension = self._dimension(step)
        kind = self.number.setdefault(dimension, len(self.seen))
        if kind == len(self.seen):
            self.seen.append(dimension)
        if b is not None and op is not Op.POW:
            self.results[op, self.kinds[a], self.kinds[b]] = kind
        return kind

    def _dimension(self, step: Step) -> Known:
        op, a, b = step
        if op is Op.LOAD:
            return self.given[a]
        if op is Op.CONST:
            return NUMBER if a else None
        own = [self.dimension(argument) for argument in arguments_of(step)]
        try:
            return raised(own[0], own[1], self._value(b)) if op is Op.POW else op.operation.dimension(*own)
        except Unlike as unlike:
            raise UnlikeArguments(f"{_WORDS.get(op, op.value)} of {unlike}") from None

    def _value(self, exponent: int) -> float | None:
        value = self.constants.get(exponent)
        return value if isinstance(value, float) else None
