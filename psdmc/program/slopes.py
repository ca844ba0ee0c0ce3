"""Derivatives of recorded values, along a direction (forward mode) or as gradients (reverse mode). Their operations are
recorded, too. So a PROGRAM (list of operations) has derivatives as new PROGRAMs: `jvp`, `vjp` and `jacobians`.

Source: Griewank, Walther 2008, chapters 3 (modes) and 4 (costs). Derivatives can be by inputs (`Tracer.symbols`) and by
inputs times a constant, but not by other computed values. The tracer merges constants along a product, so a recorded
product may no longer contain the value with which it was written.

To differentiate by computed values, trace with inputs in their place, and substitute the values afterwards (interpret.py).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import compress
from typing import Literal, NamedTuple

from psdmc.errors import InternalError
from psdmc.program.interpret import replayed
from psdmc.program.limb_program import THE_CORE
from psdmc.program.operations import Op
from psdmc.program.program import Program, Slot
from psdmc.program.trace import Constant, Symbol, Tracer

_SLOPE = {Op.SIN: (Op.COS, False), Op.COS: (Op.SIN, True)}
"""What the derivative of a sine and of a cosine is, and whether it is negative."""

_SUMS = (Op.ADD, Op.SUB)


class Part(NamedTuple):
    """One term of a rotated value y = c x0 + s x1: the index of x0 or x1, and its factor, a signed sine or cosine."""

    value: int
    factor: Symbol


class Turned(NamedTuple):
    """One value y = c x0 + s x1 of a rotated pair, with the cosine c and the sine s of an angle.

    angle  index of the angle
    slope  symbol of the derivative of y by the angle, which is the other value of the pair
    parts  the terms c x0 and s x1
    """

    angle: int
    slope: Symbol
    parts: tuple[Part, ...]


class _Product(NamedTuple):
    """A sine or cosine times a value: their indices, and the angle's."""

    angle: int
    trigonometric: int
    value: int


class TurnedPairs:
    """Finds rotated pairs y0 = c x0 + s x1 and y1 = c x1 - s x0 among the values that a tracer has recorded. Here c and s
    are the cosine and the sine of an angle.

    The derivative of y0 by the angle is y1, and that of y1 is -y0. It needs no derivatives of sine and cosine, and takes
    one product instead of two products and one sum.

    needed  for each recorded value, whether the code computes it anyway; a pair is used only if both values are
    """

    def __init__(self, tracer: Tracer, needed: Sequence[bool]) -> None:
        self._tracer, self._needed = tracer, needed
        self._uses, self._is_product = _uses(tracer, needed)

    def of(self, index: int) -> Turned | None:
        """Return the rotated value (see Turned) with this index. Return None if the value is not of the form c x0 + s
        x1, or if its derivative by the angle is not recorded."""
        op, a, b = self._tracer.steps[index]
        if op is Op.MUL:
            if not self._is_product[index]:
                return None
            for product in self._products(index):
                slope = self._slope_of_product(product)
                if slope is not None and self._needed[slope.index]:
                    return Turned(product.angle, slope, (self._part(product),))
            return None
        if op not in _SUMS or not (self._is_product[a] and self._is_product[b]):
            return None
        if self._uses[a] != 1 or self._uses[b] != 1:
            return None
        for first in self._products(a):
            for second in self._products(b):
                if first.angle == second.angle:
                    slope = self._slope_of_sum(first, second, op is Op.SUB)
                    if slope is not None:
                        parts = (self._part(first), self._part(second, op is Op.SUB))
                        return Turned(first.angle, slope, parts)
        return None

    def _products(self, index: int) -> Iterator[_Product]:
        """The ways to read a value as a sine or cosine times another."""
        steps = self._tracer.steps
        op, a, b = steps[index]
        if op is Op.MUL:
            for factor, value in ((a, b), (b, a)):
                if steps[factor][0] in _SLOPE:
                    yield _Product(steps[factor][1], factor, value)

    def _part(self, product: _Product, negative: bool = False) -> Part:
        return Part(product.value, Symbol(self._tracer, product.trigonometric, negative))

    def _slope_of_product(self, product: _Product) -> Symbol | None:
        """The recorded derivative of a product by its angle, whether used or not; None where there is none."""
        op, negative = _SLOPE[self._tracer.steps[product.trigonometric][0]]
        factor = self._tracer.known.get((op, product.angle, None))
        if factor is None:
            return None
        low, high = sorted((factor, product.value))
        index = self._tracer.known.get((Op.MUL, low, high))
        return None if index is None or index >= len(self._needed) else Symbol(self._tracer, index, negative)

    def _slope_of_sum(self, first: _Product, second: _Product, minus: bool) -> Symbol | None:
        one, other = self._slope_of_product(first), self._slope_of_product(second)
        if one is None or other is None or one.index == other.index:
            return None
        signs = {one.index: one.negative, other.index: other.negative is not minus}
        low, high = sorted(signs)
        op = Op.ADD if signs[low] is signs[high] else Op.SUB
        index = self._tracer.known.get((op, low, high))
        if index is None or index >= len(self._needed) or not self._needed[index]:
            return None
        return Symbol(self._tracer, index, signs[low])


def _uses(tracer: Tracer, needed: Sequence[bool]) -> tuple[list[int], list[bool]]:
    """How often each value is an argument of a needed one, and whether it is needed and a product with a sine or cosine."""
    uses, is_product = [0] * len(needed), [False] * len(needed)
    product, steps = Op.MUL, tracer.steps
    for index in compress(range(len(needed)), needed):
        op, a, b = steps[index]
        if b is None:
            for argument in tracer.arguments(index):
                uses[argument] += 1
            continue
        uses[a] += 1
        uses[b] += 1
        is_product[index] = op is product and (steps[a][0] in _SLOPE or steps[b][0] in _SLOPE)
    return uses, is_product


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
        if group == THE_CORE or group == self.sources.group_of(index):
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
        belongs. Return THE_CORE if the value belongs to the trunk."""
        sums = self.tracer.limb_sums
        return THE_CORE if sums is None else sums.group_of(index)

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


# Derivatives of PROGRAMs
#
# Some functions have derivatives by a recursion of their own; tests compare these with the results here. A new PROGRAM
# also has the outputs of the given PROGRAM.


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
