"""A PROGRAM of one value as a static C function of numbers, beside a vector p of parameters: friction of one joint."""

from __future__ import annotations

from dataclasses import dataclass

from psdmc.emit.c_expr import Expr, Names, combine, literal
from psdmc.program.program import Instr, Program, Slot

FUNCTIONS = {
    "abs": "fabs",
    "min": "fmin",
    "max": "fmax",
    "exp": "exp",
    "tanh": "tanh",
    "pow": "pow",
    "sqrt": "sqrt",
    "sin": "sin",
    "cos": "cos",
    "atan2": "atan2",
}
"""libm's, by operation."""


@dataclass(frozen=True, slots=True)
class ScalarFunction:
    """A function `name(const real *p, real x, ...)`; it has those of `arguments` that the PROGRAM reads."""

    name: str
    program: Program
    arguments: tuple[str, ...]
    real: str

    @property
    def taken(self) -> tuple[str, ...]:
        """Arguments beside p."""
        read = {slot.vector for slot in self.program.inputs()}
        return tuple(name for name in self.arguments if name in read)

    @property
    def signature(self) -> str:
        return ", ".join((f"const {self.real} *p", *(f"{self.real} {name}" for name in self.taken)))

    @property
    def lines(self) -> tuple[str, ...]:
        """Its statements, the last one of which returns the value."""
        named = Names.of(self.program).named
        values: list[Expr] = []
        found: list[str] = []
        ((_, last),) = self.program.outputs
        for i, instr in enumerate(self.program):
            value = self._expression(instr, values)
            if named[i] and instr.args and i != last:
                found.append(f"const {self.real} t{i} = {value.text};")
                value = Expr(f"t{i}")
            values.append(value)
        return (*found, f"return {values[last].text};")

    def _expression(self, instr: Instr, values: list[Expr]) -> Expr:
        suffix = "" if self.real == "double" else "f"
        if instr.slot is not None:
            return Expr(_read(instr.slot))
        if instr.value is not None:
            return literal(instr.value, suffix)
        args = [values[a] for a in instr.args]
        texts = [arg.text for arg in args]
        if instr.op.value == "select":
            a, b, x, y = texts
            return Expr(f"({a} < {b} ? {x} : {y})")
        function = FUNCTIONS.get(instr.op.value)
        return (
            combine(instr.op, args) if function is None else Expr(f"{function}{suffix}({', '.join(texts)})")
        )


def _read(slot: Slot) -> str:
    return f"p[{slot.index}]" if slot.vector == "p" else slot.vector
