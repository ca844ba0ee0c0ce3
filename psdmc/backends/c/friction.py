"""Writes friction laws as C text for the templates: the law of one joint, and the joint friction of a calibrated model.

The law of one joint is a PROGRAM (a list of scalar operations) with one output, which becomes a static C function.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from psdmc.backends.c.body import calls_of
from psdmc.backends.c.expressions import (
    CALLS,
    CallView,
    Expr,
    Names,
    call_views,
    combine,
    is_call,
    literal,
    number,
    numbers,
    rounded_out,
    suffix_of,
)
from psdmc.backends.c.kernel_view import Prototype
from psdmc.friction.joints import Friction
from psdmc.friction.law import Array
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


TOLERANCE = {"double": "1e-13", "float": "1e-5"}
"""Of the self-test, beside the largest friction: a few roundings of tanh and of powers."""


@dataclass(frozen=True, slots=True)
class FrictionView:
    """`R_friction`, printed for one real type."""

    friction: Friction
    robot: str
    real: str

    @property
    def prototype(self) -> Prototype:
        given = ("q", "qd") if self.by_position else ("qd",)
        arguments = (*(f"const {self.real} *{name}" for name in given), f"{self.real} *tau_f")
        return Prototype("void", f"{self.robot}_friction", arguments)

    @property
    def by_position(self) -> bool:
        """Whether the function takes positions, too."""
        return self.friction.by_position

    @property
    def one_joint(self) -> ScalarFunction:
        law = self.friction.program()
        return ScalarFunction("joint_friction", law, ("q", "v"), suffix_of(self.real))

    @property
    def calls(self) -> tuple[CallView, ...]:
        return calls_in([self.one_joint])

    @property
    def passed(self) -> str:
        """Joint i's state behind its values."""
        state = {"q": "q[i]", "v": "qd[i]"}
        return "".join(f", {state[name]}" for name in self.one_joint.taken)

    @property
    def beyond(self) -> tuple[str, ...]:
        """Return sentences about effects that the calibration found in addition to joint friction and rigid bodies,
        such as springs. The sentences contain no names from files."""
        return self.friction.beyond

    @property
    def headings(self) -> tuple[str, ...]:
        """Names of the numbers per joint."""
        return tuple(name for term in self.friction.terms for name in term.names)

    @property
    def formula(self) -> str:
        """The law, for the header."""
        return self.friction.formula

    @property
    def sign_speed(self) -> str:
        return number(self.friction.sign_speed, self.real)

    @property
    def rows(self) -> tuple[str, ...]:
        return self._printed(self.friction.values)

    @property
    def speeds(self) -> tuple[str, ...]:
        """Return, as C text, the joint speeds at which the self-test of the package compares friction torques.

        The speeds are zero, a tenth of the speed over which friction changes sign, and speeds in both directions.
        Constants of a friction law that are speeds are included, too.
        """
        return self._printed(self._states)

    @property
    def expected(self) -> tuple[str, ...]:
        """Return the friction torques that the self-test of the package expects, as C text. The self-test passes the
        joint speeds as joint positions, too."""
        return self._printed(self.friction.torque(self._states, self._states))

    @property
    def tolerance(self) -> str:
        return TOLERANCE[self.real]

    @property
    def _states(self) -> Array:
        n = len(self.friction.values)
        ramp = np.linspace(0.5, 1.5, n) * np.where(np.arange(n) % 2, -1.0, 1.0)
        speeds = (term.number for term in self.friction.terms if term.number is not None)
        shares = (0.0, 0.1 * self.friction.sign_speed, 1.0, -0.7, *speeds)
        rounded = [rounded_out(float(v), self.real) for v in np.outer(shares, ramp).reshape(-1)]
        return np.array(rounded).reshape(len(shares), n)

    def _printed(self, rows: Array) -> tuple[str, ...]:
        return tuple(numbers(row, self.real) for row in rows)
