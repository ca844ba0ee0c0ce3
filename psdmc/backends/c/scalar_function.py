"""Writes a PROGRAM (a list of scalar operations) with one output as a static C function. The arguments are numbers and
a vector p of parameters. The friction law of one joint is such a function."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from psdmc.backends.c.body import calls_of
from psdmc.backends.c.expressions import CALLS, CallView, Expr, Names, call_views, combine, is_call, literal
from psdmc.program.operations import Unit
from psdmc.program.program import Instr, Program, Slot

TYPE = "number"
"""C's name for the real type in these functions."""


@dataclass(frozen=True, slots=True)
class ScalarFunction:
    """A C function `name(const number *p, number x, ...)`. p are the parameters; the numbers are those of `arguments`
    that the PROGRAM (the list of operations) reads.

    suffix  of C library functions and constants: 'f' for float
    """

    name: str
    program: Program
    arguments: tuple[str, ...]
    suffix: str

    @property
    def taken(self) -> tuple[str, ...]:
        """Arguments beside p."""
        read = {slot.vector for slot in self.program.inputs()}
        return tuple(name for name in self.arguments if name in read)

    @property
    def signature(self) -> str:
        return ", ".join((f"const {TYPE} *p", *(f"{TYPE} {name}" for name in self.taken)))

    @property
    def lines(self) -> tuple[str, ...]:
        """Return the C statements of the function. The last statement returns the result."""
        named = Names.of(self.program).named
        values: list[Expr] = []
        found: list[str] = []
        ((_, last),) = self.program.outputs
        for i, instr in enumerate(self.program):
            value = self._expression(instr, values)
            if named[i] and instr.args and i != last:
                found.append(f"const {TYPE} t{i} = {value.text};")
                value = Expr(f"t{i}")
            values.append(value)
        return (*found, f"return {values[last].text};")

    def _expression(self, instr: Instr, values: list[Expr]) -> Expr:
        if instr.slot is not None:
            return Expr(_read(instr.slot))
        if instr.value is not None:
            return literal(instr.value, self.suffix)
        args = [values[a] for a in instr.args]
        listed = ", ".join(arg.text for arg in args)
        if instr.op.unit is Unit.SINCOS:
            return Expr(f"{instr.op}{self.suffix}({listed})")
        if is_call(instr.op):
            return Expr(f"{CALLS[instr.op].function(TYPE)}({listed})")
        return combine(instr.op, args)


def calls_in(functions: Iterable[ScalarFunction]) -> tuple[CallView, ...]:
    """Operations that the functions call."""
    return call_views(frozenset(op for function in functions for op in calls_of(function.program)))


def _read(slot: Slot) -> str:
    return f"p[{slot.index}]" if slot.vector == "p" else slot.vector
