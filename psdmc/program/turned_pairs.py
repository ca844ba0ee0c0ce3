"""Turned pairs among recorded values: y0 = c x0 + s x1 and y1 = c x1 - s x0. Each is the derivative of the other by the
angle, up to sign.

The derivative by the angle of a sum of two products with its sine and cosine is another such sum. Where that sum is
recorded already, as it is wherever a vector is turned, a derivative takes it instead of differentiating sine and
cosine: one product instead of two, and one sum.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import compress
from typing import NamedTuple

from psdmc.program.program import Op
from psdmc.program.trace import Symbol, Tracer

_SLOPE = {Op.SIN: (Op.COS, False), Op.COS: (Op.SIN, True)}
"""What the derivative of a sine and of a cosine is, and whether it is negative."""

_SUMS = (Op.ADD, Op.SUB)


class Part(NamedTuple):
    """A value that a turned one is linear in: its index, and the sine or cosine, with sign, that multiplies it."""

    value: int
    factor: Symbol


class Turned(NamedTuple):
    """One value of a turned pair, by the angle and by what is turned.

    angle  index of the angle
    slope  the recorded derivative by it
    parts  what is turned
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
    """Finds turned pairs among a tracer's values.

    needed  for each value whether it is used anyway; other values are not worth computing
    """

    def __init__(self, tracer: Tracer, needed: Sequence[bool]) -> None:
        self._tracer, self._needed = tracer, needed
        self._uses, self._is_product = _uses(tracer, needed)

    def of(self, index: int) -> Turned | None:
        """Value `index` as one of a turned pair; None where it is none, or its slope is not recorded."""
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
