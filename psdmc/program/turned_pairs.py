"""Finds rotated pairs among recorded values: y0 = c x0 + s x1 and y1 = c x1 - s x0. Here c and s are the cosine and the
sine of an angle. The derivative of y0 by the angle is y1, and that of y1 is -y0.

If a vector is rotated, both values of such a pair are recorded. The derivative by the angle then uses the other value
and needs no derivatives of sine and cosine. This takes one product instead of two products and one sum.
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
    """Finds pairs y0 = c x0 + s x1 and y1 = c x1 - s x0 among the values that a tracer has recorded.

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
