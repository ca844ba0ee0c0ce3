"""Constants that differ between equal limbs (such as legs), with one number per limb. Generated code computes the limbs
at once, each in one SIMD lane (slot of a vector)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import cos, sin
from operator import add, mul, sub, truediv
from typing import Any

Scalar = Any
"""A float or Lanes; NotImplemented beside anything else."""


@dataclass(frozen=True, slots=True)
class Lanes:
    """A constant that has one number for each limb of a group of equal limbs.

    Arithmetic with numbers and with other constants of the group is done at once, limb by limb. If all results are
    equal, the result is one number. Arithmetic with a symbol is recorded as an operation.

    group   number of the group of limbs
    values  limb by limb
    """

    group: int
    values: tuple[float, ...]

    def __neg__(self) -> Lanes:
        return Lanes(self.group, tuple(-x for x in self.values))

    def __abs__(self) -> float | Lanes:
        return lanes(self.group, [abs(x) for x in self.values])

    def __add__(self, other: float | Lanes) -> Scalar:
        return self._with(other, add)

    __radd__ = __add__

    def __sub__(self, other: float | Lanes) -> Scalar:
        return self._with(other, sub)

    def __rsub__(self, other: float | Lanes) -> Scalar:
        return self._with(other, lambda a, b: b - a)

    def __mul__(self, other: float | Lanes) -> Scalar:
        return 0.0 if other == 0.0 else self._with(other, mul)

    __rmul__ = __mul__

    def __truediv__(self, other: float | Lanes) -> Scalar:
        return self._with(other, truediv)

    def __rtruediv__(self, other: float | Lanes) -> Scalar:
        return self._with(other, lambda a, b: b / a)

    def sincos(self) -> tuple[float | Lanes, float | Lanes]:
        """Sine and cosine of angles in rad."""
        return lanes(self.group, list(map(sin, self.values))), lanes(self.group, list(map(cos, self.values)))

    def operated(self, operation: Callable[..., float], arguments: Sequence[Scalar]) -> Scalar:
        """Return an operation's value on the group's constants, limb by limb; NotImplemented for a symbol."""
        if not all(isinstance(each, Lanes | float | int) for each in arguments):
            return NotImplemented
        columns = [
            each.values if isinstance(each, Lanes) else [float(each)] * len(self.values) for each in arguments
        ]
        return lanes(self.group, [float(operation(*row)) for row in zip(*columns, strict=True)])

    def _with(self, other: float | Lanes, operation: Callable[[float, float], float]) -> float | Lanes:
        if isinstance(other, Lanes):
            if other.group != self.group:
                raise ValueError("constants of two groups of limbs")
            numbers: Sequence[float] = other.values
        elif isinstance(other, float | int):
            numbers = [float(other)] * len(self.values)
        else:
            return NotImplemented
        return lanes(self.group, [operation(a, b) for a, b in zip(self.values, numbers, strict=True)])


def lanes(group: int, values: Sequence[float]) -> float | Lanes:
    """Return a constant that has one value per limb (such as a leg). Generated code computes equal limbs side by side,
    one limb per SIMD lane (slot of a vector). If all values are equal, return one plain number.

    group   number of the group of equal limbs
    values  one value for each limb of the group
    """
    numbers = tuple(float(x) for x in values)
    return numbers[0] + 0.0 if len(set(numbers)) == 1 else Lanes(group, numbers)
