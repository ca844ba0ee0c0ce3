"""The operations of a PROGRAM (list of scalar operations), as a table with one entry for each.

The code that traces, interprets, folds, differentiates, counts, checks, prints and reads PROGRAMs uses this table. Each
back end (printer for one language) has a table from `Op` to its language, and a test checks that it is complete.

| comparison        | with NaN                              | zeros                                                   |
|-------------------|---------------------------------------|---------------------------------------------------------|
| abs a             | NaN                                   | abs(-0.0) is 0.0                                        |
| min a b, max a b  | NaN, whichever of the two is NaN      | of two zeros the second; passes may swap arguments      |
| select a b x y    | y: no comparison with NaN is true     | y: -0.0 is not less than 0.0                            |

The derivative of a comparison is that of the argument that the comparison returns. If a and b are equal, min and max
have the derivative of the second argument. At zero, abs has the derivative 1.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Any, Literal

import numpy as np

from psdmc.program.dimensions import Known, alike, angle, chosen, number, product, quotient, raised, root
from psdmc.reproducible import angle_of, cosine, exponential, hyperbolic_tangent, logarithm, power, sine

Scalar = Any
"""A float, an array of states, or a symbol that records what is done to it (trace.py)."""


class Unit(StrEnum):
    """The kinds of operations for which a target processor has latencies and costs. The texts are names of fields in
    psdmc/target/target.py.

    CHOICE  a comparison that selects one of two values, without a branch
    CALL    an elementary function of the C library, one real at a time
    """

    NONE = "none"
    LOAD = "load"
    ADD = "add"
    MUL = "mul"
    DIV = "div"
    NEG = "neg"
    SINCOS = "sincos"
    CHOICE = "choice"
    CALL = "call"


@dataclass(frozen=True, slots=True)
class Operation:
    """The properties of one operation of PROGRAMs (lists of scalar operations).

    arity        number of arguments
    unit         the kind as which its cost is counted
    numbers      function that computes its value for floats and arrays; also for symbols, if `written` is set
    partials     function that returns the derivative by each argument, from the value and the arguments
    dimension    function that returns the physical dimension of the value from those of the arguments; raises Unlike if
                 the operation does not admit them
    ulp          largest error of a double in `numbers` and in generated C, in units in the last place; 0.5: rounded
                 once
    written      whether symbols have it as a Python operator such as +, and simplify it as they record it
    commutative  whether its arguments may be swapped
    parity       effect of the first argument's sign: 'odd' changes the result's sign, 'even' does not change the result
    """

    arity: int
    unit: Unit
    numbers: Callable[..., Any]
    partials: Callable[..., tuple[Scalar, ...]]
    dimension: Callable[..., Known] = number
    ulp: float = 0.5
    written: bool = False
    commutative: bool = False
    parity: Literal["odd", "even", ""] = ""


def _none(*_: Scalar) -> tuple[Scalar, ...]:
    return ()


def _smaller(a: Any, b: Any) -> Any:
    return np.where((a < b) | (a != a), a, b)


def _larger(a: Any, b: Any) -> Any:
    return np.where((a > b) | (a != a), a, b)


def _selected(a: Any, b: Any, x: Any, y: Any) -> Any:
    return np.where(np.less(a, b), x, y)


def _quotient_partials(value: Scalar, a: Scalar, b: Scalar) -> tuple[Scalar, ...]:
    reciprocal = 1.0 / b
    return reciprocal, -(value * reciprocal)


def _angle_partials(value: Scalar, y: Scalar, x: Scalar) -> tuple[Scalar, ...]:
    reciprocal = 1.0 / (x * x + y * y)
    return x * reciprocal, -(y * reciprocal)


def _power_partials(value: Scalar, base: Scalar, exponent: Scalar) -> tuple[Scalar, ...]:
    known = exponent.constant_value() if hasattr(exponent, "constant_value") else None
    if known is not None:  # a base with a unit has no logarithm
        return known * Op.POW(base, known - 1.0), 0.0
    return exponent * Op.POW(base, exponent - 1.0), value * Op.LOG(base)


class Op(StrEnum):
    """The operations in PROGRAMs (lists of scalar operations). Their values are the words for them in PROGRAMs that are
    written as text.

    Called with arguments, an operation computes its value: `Op.TANH(x)`, of floats, arrays or symbols.
    """

    LOAD = "load", Operation(0, Unit.LOAD, _none, _none)
    CONST = "const", Operation(0, Unit.NONE, _none, _none)
    ADD = (
        "add",
        Operation(
            2, Unit.ADD, operator.add, lambda _, a, b: (1.0, 1.0), alike, written=True, commutative=True
        ),
    )
    SUB = "sub", Operation(2, Unit.ADD, operator.sub, lambda _, a, b: (1.0, -1.0), alike, written=True)
    MUL = (
        "mul",
        Operation(2, Unit.MUL, operator.mul, lambda _, a, b: (b, a), product, written=True, commutative=True),
    )
    DIV = "div", Operation(2, Unit.DIV, operator.truediv, _quotient_partials, quotient, written=True)
    NEG = "neg", Operation(1, Unit.NEG, operator.neg, lambda _, a: (-1.0,), alike, written=True)
    SIN = "sin", Operation(1, Unit.SINCOS, sine, lambda _, a: (Op.COS(a),), ulp=1.0, parity="odd")
    COS = "cos", Operation(1, Unit.SINCOS, cosine, lambda _, a: (-Op.SIN(a),), ulp=1.0, parity="even")
    SQRT = "sqrt", Operation(1, Unit.DIV, np.sqrt, lambda value, a: (0.5 / value,), root)
    ABS = (
        "abs",
        Operation(
            1,
            Unit.CHOICE,
            np.abs,
            lambda _, a: (Op.SELECT(a, 0.0, -1.0, 1.0),),
            alike,
            ulp=0.0,
            parity="even",
        ),
    )
    MIN = (
        "min",
        Operation(
            2,
            Unit.CHOICE,
            _smaller,
            lambda _, a, b: (Op.SELECT(a, b, 1.0, 0.0), Op.SELECT(a, b, 0.0, 1.0)),
            alike,
            ulp=0.0,
            commutative=True,
        ),
    )
    MAX = (
        "max",
        Operation(
            2,
            Unit.CHOICE,
            _larger,
            lambda _, a, b: (Op.SELECT(b, a, 1.0, 0.0), Op.SELECT(b, a, 0.0, 1.0)),
            alike,
            ulp=0.0,
            commutative=True,
        ),
    )
    SELECT = (
        "select",
        Operation(
            4,
            Unit.CHOICE,
            _selected,
            lambda _, a, b, x, y: (0.0, 0.0, Op.SELECT(a, b, 1.0, 0.0), Op.SELECT(a, b, 0.0, 1.0)),
            chosen,
            ulp=0.0,
        ),
    )
    EXP = "exp", Operation(1, Unit.CALL, exponential, lambda value, a: (value,), ulp=1.0)
    TANH = (
        "tanh",
        Operation(
            1, Unit.CALL, hyperbolic_tangent, lambda value, a: (1.0 - value * value,), ulp=2.5, parity="odd"
        ),
    )
    LOG = "log", Operation(1, Unit.CALL, logarithm, lambda _, a: (1.0 / a,), ulp=1.0)
    POW = "pow", Operation(2, Unit.CALL, power, _power_partials, raised, ulp=1.0)
    ATAN2 = "atan2", Operation(2, Unit.CALL, angle_of, _angle_partials, angle, ulp=1.0, parity="odd")

    arity: int
    unit: Unit
    operation: Operation
    numbers: Callable[..., Any]
    written: bool

    def __new__(cls, word: str, operation: Operation) -> Op:
        op = str.__new__(cls, word)
        op._value_ = word
        op.operation, op.arity, op.unit = operation, operation.arity, operation.unit
        op.numbers, op.written = operation.numbers, operation.written
        return op

    def __call__(self, *arguments: Scalar) -> Scalar:
        """The operation's value; recorded where an argument is a symbol."""
        if not self.written:
            for argument in arguments:
                if hasattr(argument, "operated"):
                    found = argument.operated(self, arguments)
                    if found is not NotImplemented:
                        return found
        return self.numbers(*arguments)

    def of_numbers(self, values: Sequence[float]) -> float | None:
        """Return the operation's value for numbers as arguments. Return None if the value is not finite, because such a
        value cannot be a constant of a PROGRAM."""
        with np.errstate(all="ignore"):
            value = float(self.numbers(*map(np.float64, values)))
        return value if math.isfinite(value) else None


BY_WORD = {op.value: op for op in Op}
"""Operations by their words."""
