"""Derivatives of recorded values, recorded beside them: along tangents (forward mode) and as gradients (reverse mode).

Griewank, Walther 2008, chapters 3 (modes) and 4 (what each costs). Derivatives are taken by inputs (`Tracer.symbols`) and by
inputs times a constant, not by other computed values: constants along a product are merged into one, so that a recorded
product may no longer contain the value that it was written with. To differentiate at computed values, trace with inputs and
put the values in their place afterwards (replay.py).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from psdmc.errors import InternalError
from psdmc.program.operations import Op
from psdmc.program.trace import Number, Symbol, Tracer
from psdmc.program.turned_pairs import TurnedPairs

Value = Symbol | Number


def slopes(of: Sequence[Value], by: Sequence[Symbol], along: Sequence[Value]) -> list[Value]:
    """The derivative of each value along a tangent: sum over j of (d of[i] / d by[j]) along[j]."""
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
            total: Value = 0.0
            for argument, partial in sources.partials(index):
                tangent = moved.get(argument, 0.0)
                if not _is_zero(tangent):
                    total = total + partial * tangent
            moved[index] = total
    return [_signed(value, moved[value.index]) if isinstance(value, Symbol) else 0.0 for value in of]


def gradients(
    of: Sequence[Value], weights: Sequence[Value], by: Sequence[Sequence[Symbol]]
) -> list[list[Value]]:
    """The derivative of sum(weights[i] of[i]) by every value, vector by vector."""
    known = [_inputs(vector) for vector in by]
    sources = _Sources.of(of, [symbol for inputs, _ in known for symbol in inputs])
    if sources is None:
        return [[0.0] * len(vector) for vector in by]
    bars: list[Value] = [0.0] * len(sources.needed)
    for value, weight in zip(of, weights, strict=True):
        if isinstance(value, Symbol):
            bars[value.index] = bars[value.index] + _signed(value, weight)
    for index in reversed(range(len(bars))):
        if index not in sources.held and not _is_zero(bars[index]):
            for argument, partial in sources.partials(index):
                bars[argument] = bars[argument] + partial * bars[index]
    return [
        [_divided(_at(bars, symbol.index), factor) for symbol, factor in zip(*each, strict=True)]
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


class _Sources:
    """The values that some values are computed from, down to the inputs.

    needed  for each of the tracer's values, up to the last one of interest, whether it is used
    """

    def __init__(self, tracer: Tracer, roots: Sequence[int], held: Mapping[int, None]) -> None:
        self.tracer, self.held = tracer, held
        self.needed = [False] * (max(roots) + 1)
        for root in roots:
            self.needed[root] = True
        for index in reversed(range(len(self.needed))):
            if self.needed[index] and index not in held:
                for argument in tracer.arguments(index):
                    self.needed[argument] = True
        self._pairs = TurnedPairs(tracer, self.needed)

    @staticmethod
    def of(values: Sequence[Value], by: Sequence[Symbol]) -> _Sources | None:
        """None where all values are numbers."""
        symbols = [value for value in values if isinstance(value, Symbol)]
        if not symbols:
            return None
        held = dict.fromkeys(symbol.index for symbol in by)
        return _Sources(symbols[0].tracer, [symbol.index for symbol in symbols], held)

    def partials(self, index: int) -> Iterator[tuple[int, Value]]:
        """(argument, derivative of value `index` by it) for each argument; the same argument may come twice."""
        turned = self._pairs.of(index)
        if turned is not None:
            yield turned.angle, turned.slope
            yield from turned.parts
            return
        arguments = self.tracer.arguments(index)
        if arguments:
            op, symbols = self.tracer.steps[index][0], map(self._value, arguments)
            yield from zip(arguments, op.operation.partials(self._value(index), *symbols), strict=True)

    def _value(self, index: int) -> Symbol:
        return Symbol(self.tracer, index)


def _signed(symbol: Symbol, value: Value) -> Value:
    return -value if symbol.negative else value


def _at(values: Sequence[Value], index: int) -> Value:
    return values[index] if index < len(values) else 0.0


def _is_zero(value: Value) -> bool:
    return not isinstance(value, Symbol) and value == 0
