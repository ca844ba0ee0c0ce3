"""Symbols that record the arithmetic done to them as a PROGRAM, simplifying as they go.

Recorded once however often it is written: values are hash-consed, commutative arguments sorted, and a sign is kept
beside a value rather than computed, so that a - b and b - a, x * y and x * -y are one instruction each. Exact zeros and
ones disappear; constants fold and merge along products (which reorders floating point).
"""

from __future__ import annotations

from collections.abc import Sequence

from psdmc.program.program import Instr, Op, Program, Slot

Number = float | int


class Tracer:
    """Collects instructions; `symbols` makes inputs, `finish` makes the PROGRAM."""

    def __init__(self) -> None:
        self.body: list[Instr] = []
        self._index: dict[Instr, int] = {}

    def symbols(self, vector: str, count: int) -> list[Symbol]:
        """Inputs vector[0] ... vector[count - 1]."""
        return [Symbol(self, self.record(Instr(Op.LOAD, slot=Slot(vector, i)))) for i in range(count)]

    def record(self, instr: Instr) -> int:
        known = self._index.get(instr)
        if known is None:
            known = self._index[instr] = len(self.body)
            self.body.append(instr)
        return known

    def constant(self, value: float) -> Symbol:
        """A constant; its sign is kept beside it."""
        magnitude = self.record(Instr(Op.CONST, value=abs(float(value))))
        return Symbol(self, magnitude, value < 0)

    def finish(self, outputs: Sequence[tuple[Slot, Symbol | Number]]) -> Program:
        """The PROGRAM that stores the given values; a negative one costs a negation."""
        stored: list[tuple[Slot, int]] = []
        for slot, value in outputs:
            symbol = value if isinstance(value, Symbol) else None
            if symbol is None:
                index = self.record(Instr(Op.CONST, value=float(value) + 0.0))  # type: ignore[arg-type]
            elif symbol.negative:
                index = self.record(Instr(Op.NEG, (symbol.index,)))
            else:
                index = symbol.index
            stored.append((slot, index))
        return Program(tuple(self.body), tuple(stored))


class Symbol:
    """A signed reference to a recorded value."""

    __slots__ = ("index", "negative", "tracer")
    __array_ufunc__ = None

    def __init__(self, tracer: Tracer, index: int, negative: bool = False) -> None:
        self.tracer, self.index, self.negative = tracer, index, negative

    def __neg__(self) -> Symbol:
        return Symbol(self.tracer, self.index, not self.negative)

    def __pos__(self) -> Symbol:
        return self

    def __add__(self, other: Symbol | Number) -> Symbol | float:
        return _sum(self.tracer, self, other)

    __radd__ = __add__

    def __sub__(self, other: Symbol | Number) -> Symbol | float:
        return _sum(self.tracer, self, -other)

    def __rsub__(self, other: Number) -> Symbol | float:
        return _sum(self.tracer, -self, other)

    def __mul__(self, other: Symbol | Number) -> Symbol | float:
        return _product(self.tracer, self, other)

    __rmul__ = __mul__

    def __truediv__(self, other: Symbol | Number) -> Symbol | float:
        if not isinstance(other, Symbol):
            return _product(self.tracer, self, 1.0 / other)
        divisor = other.constant_value()
        return _quotient(self.tracer, self, other) if divisor is None else self / divisor

    def __rtruediv__(self, other: Number) -> Symbol | float:
        return 0.0 if other == 0 else _quotient(self.tracer, self.tracer.constant(float(other)), self)

    def sincos(self) -> tuple[Symbol, Symbol]:
        sine = self.tracer.record(Instr(Op.SIN, (self.index,)))
        cosine = self.tracer.record(Instr(Op.COS, (self.index,)))
        return Symbol(self.tracer, sine, self.negative), Symbol(self.tracer, cosine)

    def constant_value(self) -> float | None:
        value = self.tracer.body[self.index].value
        return None if value is None else (-value if self.negative else value)


def _as_symbol(tracer: Tracer, value: Symbol | Number) -> Symbol:
    return value if isinstance(value, Symbol) else tracer.constant(float(value))


def _sum(tracer: Tracer, a: Symbol, other: Symbol | Number) -> Symbol | float:
    if not isinstance(other, Symbol) and other == 0:
        return a
    b = _as_symbol(tracer, other)
    if a.index == b.index and a.negative != b.negative:
        return 0.0
    if a.negative == b.negative:
        low, high = sorted((a.index, b.index))
        return Symbol(tracer, tracer.record(Instr(Op.ADD, (low, high))), a.negative)
    plus, minus = (b, a) if a.negative else (a, b)
    if plus.index < minus.index:
        return Symbol(tracer, tracer.record(Instr(Op.SUB, (plus.index, minus.index))))
    return Symbol(tracer, tracer.record(Instr(Op.SUB, (minus.index, plus.index))), True)


def _product(tracer: Tracer, a: Symbol, other: Symbol | Number) -> Symbol | float:
    if not isinstance(other, Symbol):
        if other == 0:
            return 0.0
        if abs(other) == 1:
            return a if other > 0 else -a
        return _scaled(tracer, a, float(other))
    value = other.constant_value()
    if value is not None:
        return _scaled(tracer, a, value)
    low, high = sorted((a.index, other.index))
    return Symbol(tracer, tracer.record(Instr(Op.MUL, (low, high))), a.negative != other.negative)


def _scaled(tracer: Tracer, a: Symbol, factor: float) -> Symbol | float:
    """A constant times a value; constants along a product become one."""
    own = a.constant_value()
    if own is not None:
        return own * factor
    instr = tracer.body[a.index]
    if instr.op is Op.MUL:
        for this, rest in (instr.args, instr.args[::-1]):
            inner = tracer.body[this].value
            if inner is not None:
                return _product(tracer, Symbol(tracer, rest, a.negative), inner * factor)
    constant = tracer.constant(factor)
    low, high = sorted((a.index, constant.index))
    return Symbol(tracer, tracer.record(Instr(Op.MUL, (low, high))), a.negative != constant.negative)


def _quotient(tracer: Tracer, a: Symbol, b: Symbol) -> Symbol:
    index = tracer.record(Instr(Op.DIV, (a.index, b.index)))
    return Symbol(tracer, index, a.negative != b.negative)
