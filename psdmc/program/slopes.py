"""Derivatives of recorded values, along a direction (forward mode) or as gradients (reverse mode). Their operations are
recorded, too.

Source: Griewank, Walther 2008, chapters 3 (modes) and 4 (costs). Derivatives can be by inputs (`Tracer.symbols`) and by
inputs times a constant, but not by other computed values. The tracer merges constants along a product, so a recorded
product may no longer contain the value with which it was written.

To differentiate by computed values, trace with inputs in their place, and substitute the values afterwards (replay.py).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from psdmc.errors import InternalError
from psdmc.program.limb_sums import CORE
from psdmc.program.operations import Op
from psdmc.program.trace import Constant, Symbol, Tracer
from psdmc.program.turned_pairs import TurnedPairs

Value = Symbol | Constant


def slopes(of: Sequence[Value], by: Sequence[Symbol], along: Sequence[Value]) -> list[Value]:
    """Return the derivative of each value in `of` along a direction: sum over j of (d of[i] / d by[j]) along[j]. `by`
    are inputs, and `along` is the change of each input."""
    inputs, factors = _inputs(by)
    sources = _Sources.of(of, inputs)
    if sources is None:
        return [0.0] * len(of)
    moved = {
        symbol.index: _divided(tangent, factor)
        for symbol, tangent, factor in zip(inputs, along, factors, strict=True)
    }
    for index in range(len(sources.needed)):
        if sources.needed[index] and index not in sources.held:
            moved[index] = sources.slope(index, moved)
    return [_signed(value, moved[value.index]) if isinstance(value, Symbol) else 0.0 for value in of]


def gradients(
    of: Sequence[Value], weights: Sequence[Value], by: Sequence[Sequence[Symbol]]
) -> list[list[Value]]:
    """Return the gradient of the weighted sum of values, sum over i of weights[i] of[i]. `by` lists vectors of inputs;
    the result has a vector of derivatives for each of them."""
    known = [_inputs(vector) for vector in by]
    sources = _Sources.of(of, [symbol for inputs, _ in known for symbol in inputs])
    if sources is None:
        return [[0.0] * len(vector) for vector in by]
    bars = _Bars(sources)
    for value, weight in zip(of, weights, strict=True):
        if isinstance(value, Symbol):
            group = max(sources.group_of(each.index) for each in (value, weight) if isinstance(each, Symbol))
            bars.add(value.index, _signed(value, weight), group)
    for index in reversed(range(len(sources.needed))):
        bar = bars.of(index)
        if not _is_zero(bar) and index not in sources.held:
            group = sources.group_of(index)
            for argument, partial in sources.partials(index):
                bars.add(argument, partial * bar, group)
    return [
        [_divided(bars.of(symbol.index), factor) for symbol, factor in zip(*each, strict=True)]
        for each in known
    ]


def _inputs(by: Sequence[Symbol]) -> tuple[list[Symbol], list[float]]:
    """The inputs that values are, or are products of with constants, and these; InternalError where one is neither."""
    found, factors = [], []
    for symbol in by:
        tracer, factor = symbol.tracer, 1.0
        op, a, b = tracer.steps[symbol.index]
        if op is Op.MUL:
            a, b = (a, b) if b in tracer.constants else (b, a)
            constant = tracer.constants.get(b)
            if isinstance(constant, float):
                symbol, factor = Symbol(tracer, a), -constant if symbol.negative else constant
        if symbol.slot is None:
            raise InternalError("derivatives are by inputs")
        found.append(symbol)
        factors.append(factor)
    return found, factors


def _divided(value: Value, factor: float) -> Value:
    return value if factor == 1.0 else value / factor


class _Bars:
    """The derivative of the weighted sum by each value, while it is gathered.

    Limbs of a group are recorded as one: what they give to a value of the core is summed over all of them, once it is whole.
    """

    def __init__(self, sources: _Sources) -> None:
        self.sources = sources
        self.own: list[Value] = [0.0] * len(sources.needed)
        self.from_limbs: dict[int, dict[int, Value]] = {}

    def add(self, index: int, value: Value, group: int) -> None:
        """Add a term to the derivative by the value with this index. The term comes from a value of the limb group
        `group` (equal branches, such as legs)."""
        if group == CORE or group == self.sources.group_of(index):
            self.own[index] = self.own[index] + value
        else:
            given = self.from_limbs.setdefault(index, {})
            given[group] = given.get(group, 0.0) + value

    def of(self, index: int) -> Value:
        """Return the derivative of the weighted sum by the value with this index. All terms must have been added. The
        derivative is 0 if there are none."""
        if index >= len(self.own):
            return 0.0
        if index in self.from_limbs:
            for group, value in self.from_limbs.pop(index).items():
                self.own[index] = self.own[index] + self.sources.total(group, value)
        return self.own[index]


class _Sources:
    """The values that some values are computed from, down to the inputs.

    needed  for each of the tracer's values, up to the last one of interest, whether it is used
    """

    def __init__(self, tracer: Tracer, roots: Sequence[int], held: Mapping[int, None]) -> None:
        self.tracer, self.held = tracer, held
        self.needed = tracer.needed(roots, held)
        self._pairs = TurnedPairs(tracer, self.needed)

    @staticmethod
    def of(values: Sequence[Value], by: Sequence[Symbol]) -> _Sources | None:
        """None where all values are numbers."""
        symbols = [value for value in values if isinstance(value, Symbol)]
        if not symbols:
            return None
        held = dict.fromkeys(symbol.index for symbol in by)
        return _Sources(symbols[0].tracer, [symbol.index for symbol in symbols], held)

    def group_of(self, index: int) -> int:
        """Return the number of the limb group (equal branches, such as legs) to which the value with this index
        belongs. Return CORE if the value belongs to the trunk."""
        sums = self.tracer.limb_sums
        return CORE if sums is None else sums.group_of(index)

    def total(self, group: int, value: Value) -> Value:
        """Return the sum of a value over all limbs of a group. A group is a set of equal branches, such as legs, whose
        arithmetic is recorded once for all."""
        sums = self.tracer.limb_sums
        return value if sums is None else sums.total(group, value)

    def slope(self, index: int, moved: Mapping[int, Value]) -> Value:
        """Return the derivative of the value with this index; `moved` are those of earlier values."""
        total: Value = 0.0
        for argument, partial in self.partials(index):
            tangent = moved.get(argument, 0.0)
            if not _is_zero(tangent):
                if self._is_sum(index):
                    tangent = self.total(self.group_of(argument), tangent)
                total = total + partial * tangent
        return total

    def _is_sum(self, index: int) -> bool:
        return self.tracer.limb_sums is not None and index in self.tracer.limb_sums.summed

    def partials(self, index: int) -> Iterable[tuple[int, Value]]:
        """Return for each argument of the value with this index the argument's index, and the partial derivative by this
        argument. An argument can occur twice."""
        turned = self._pairs.of(index)
        if turned is not None:
            return (turned.angle, turned.slope), *turned.parts
        arguments = self.tracer.arguments(index)
        if self._is_sum(index):
            return ((arguments[0], 1.0),)
        op, symbols = self.tracer.steps[index][0], map(self._value, arguments)
        return zip(arguments, op.operation.partials(self._value(index), *symbols), strict=True)

    def _value(self, index: int) -> Symbol:
        return Symbol(self.tracer, index)


def _signed(symbol: Symbol, value: Value) -> Value:
    return -value if symbol.negative else value


def _is_zero(value: Value) -> bool:
    return not isinstance(value, Symbol) and value == 0
