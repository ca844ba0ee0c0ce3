"""Translates a PROGRAM (the list of operations to generate) to C expressions. A value that is used once is written at
its use; any other value gets a C variable.

The C text for one state is also the text for a SIMD vector with one state per lane. A value has the C type `V`, which
is a real number or a vector of real numbers. Values that are equal for all states, such as constants and parameters,
are called uniform and have the type `real`.

Numbers that are too small for float32 are rounded without a warning, as in C.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable
from dataclasses import dataclass
from typing import Literal, NamedTuple

from psdmc.backends.info import EmitOptions
from psdmc.program.operations import Unit
from psdmc.program.program import Op, Program

CReal = Literal["double", "float"]

LARGEST_FLOAT = math.ldexp(2.0 - 2.0**-23, 127)
SMALLEST_FLOAT = math.ldexp(1.0, -149)
"""The subnormal one; half of it and less rounds to zero."""

TOO_LARGE = LARGEST_FLOAT + math.ldexp(1.0, 103)
"""From this number on, numbers round to infinity: half a last digit beyond the largest."""


def c_real(options: EmitOptions) -> CReal:
    """The package's real type in C."""
    return "double" if options.real == "float64" else "float"


def suffix_of(real: str) -> str:
    """Return the suffix of C's constants and libm's functions for the C type `real`."""
    return "" if real == "double" else "f"


def rounded_out(value: float, real: str) -> float:
    """Return the value to which a number outside the range of the C type `real` is rounded: infinity, the largest
    number, or zero. Any other number is returned unchanged."""
    if real == "double" or math.isnan(value):
        return value
    if abs(value) >= TOO_LARGE:
        return math.copysign(math.inf, value)
    if abs(value) > LARGEST_FLOAT:
        return math.copysign(LARGEST_FLOAT, value)
    return math.copysign(0.0, value) if abs(value) <= SMALLEST_FLOAT / 2 else value


def number(value: float | None, real: str) -> str:
    """Return C text of a real constant. None (unknown) is written as NaN. A number outside the range of the C type
    `real` is written as the infinity or zero to which it rounds.

    Minus infinity is written as a product, because the compiler tcc does not accept a minus before INFINITY.
    """
    if value is None or math.isnan(value):
        return f"({real})NAN"
    value = rounded_out(value, real)
    if math.isinf(value):
        return f"({real})INFINITY" if value > 0 else f"({real})(-1e300 * 1e300) /* -INFINITY */"
    return f"{float(value)!r}{suffix_of(real)}"


def numbers(values: Iterable[float], real: str) -> str:
    """Return C text of several constants, separated by commas."""
    return ", ".join(number(value, real) for value in values)


# Expressions


DEEPEST = 4
"""Deepest nesting of operations in one expression: deeper nesting saves no instruction and is hard to read."""

UNIFORM_VECTORS = frozenset({"theta_b"})

_LOOSE, _TIGHT, _UNARY, _ATOM = range(4)
_CALLS = frozenset(
    op for op in Op if op.arity > 0 and not op.operation.written and op.unit is not Unit.SINCOS
)
_OPERATORS = frozenset(op for op in Op if op.unit is not Unit.SINCOS and op not in _CALLS)
"""Operations whose results are uniform if their arguments are; constants are among them, loads apart."""
_SYMBOL = {Op.ADD: ("+", _LOOSE), Op.SUB: ("-", _LOOSE), Op.MUL: ("*", _TIGHT), Op.DIV: ("/", _TIGHT)}


class Expr(NamedTuple):
    """C text of an expression, with the precedence of its outermost operator and the depth of its nested brackets."""

    text: str
    binding: int = _ATOM
    depth: int = 0

    def beside(self, binding: int, is_right: bool) -> str:
        """Return the expression as an operand of another operator. Brackets are added unless C parses the text with the
        same meaning without them.

        binding   precedence of the other operator
        is_right  whether the expression is the right operand
        """
        loose = self.binding < binding or (is_right and self.binding in (binding, _UNARY))
        return f"({self.text})" if loose else self.text


@dataclass(frozen=True, slots=True)
class Names:
    """Tells which values of a PROGRAM (the list of operations to generate) become C variables. This is decided before any
    expression is written.

    named    for each value, whether it becomes a variable: outputs, and values that are used more than once
    uniform  for each value, whether it is equal for all states of a batch
    """

    program: Program
    named: tuple[bool, ...]
    uniform: tuple[bool, ...]

    @staticmethod
    def of(program: Program, shared: Collection[str] = UNIFORM_VECTORS) -> Names:
        """Return which values of a PROGRAM (the list of operations to generate) become C variables. The vectors in
        `shared` are equal for all states of a batch."""
        named = [count > 1 for count in program.uses()]
        for _, index in program.outputs:
            named[index] = True
        _cut_deep_trees(program, named)
        return Names(program, tuple(named), uniform_of(program, shared))


def uniform_of(program: Program, shared: Collection[str] = UNIFORM_VECTORS) -> tuple[bool, ...]:
    """Return, for each value of the PROGRAM (the list of operations to generate), whether it is equal for all states of
    a batch. Such a value is computed from constants and from the vectors `shared` only."""
    uniform: list[bool] = []
    for op, args, slot, _ in program.body:
        if len(args) == 2 and op in _OPERATORS:
            uniform.append(uniform[args[0]] and uniform[args[1]])
        elif slot is not None:
            uniform.append(slot.vector in shared)
        else:
            uniform.append(op in _OPERATORS and all(uniform[a] for a in args))
    return tuple(uniform)


def _cut_deep_trees(program: Program, named: list[bool]) -> None:
    """Also name the values at which an expression would nest deeper than DEEPEST."""
    depth = [0] * len(program)
    for i, (op, args, _, _) in enumerate(program.body):
        if not args or op not in _OPERATORS:
            continue
        deepest = 0
        for a in args:
            if depth[a] == DEEPEST:
                named[a] = True
            elif depth[a] > deepest and not named[a]:
                deepest = depth[a]
        depth[i] = 1 + deepest


def is_call(op: Op) -> bool:
    """Return whether the generated C writes this operation as a macro, because C has no operator for it. Square roots
    are an example. Sines and cosines have other code."""
    return op in _CALLS


def literal(value: float, suffix: str) -> Expr:
    """Return C text of a constant that reads back as the same number; with suffix 'f', as the nearest float."""
    value = rounded_out(value, "float" if suffix else "double")
    return Expr(f"{value!r}{suffix}", _UNARY if str(value).startswith("-") else _ATOM)


def combine(op: Op, operands: list[Expr]) -> Expr:
    """Return C text of one operation on given texts, with brackets only if they change the meaning."""
    if op is Op.NEG:
        return Expr(f"-{operands[0].beside(_UNARY, is_right=True)}", _UNARY, 1 + operands[0].depth)
    symbol, binding = _SYMBOL[op]
    left, right = operands
    depth = 1 + max(left.depth, right.depth)
    text = f"{left.beside(binding, is_right=False)} {symbol} {right.beside(binding, is_right=True)}"
    return Expr(text, binding, depth)


# Operations for which C has no operator, such as square roots
#
# In a generated function body, each of these operations is a macro with the name of the operation. The macros are
# defined in two headers: square roots, which every compiler has for vectors, in roots.h, and all others in
# operations.h.


@dataclass(frozen=True, slots=True)
class CallView:
    """The C code of one operation for which C has no operator.

    parameters  names of the arguments of its macro and its C functions
    one         C expression for one state; FUNCTION(name) becomes the C library's function for float or double
    many        C expression for SIMD vectors; BLEND(mask, x, y) is x in lanes whose mask is set, else y; '': each lane
                is computed alone with `one`
    """

    op: Op
    parameters: tuple[str, ...]
    one: str
    many: str = ""

    @property
    def macro(self) -> str:
        return self.op.upper()

    @property
    def arguments(self) -> str:
        return ", ".join(self.parameters)

    def single(self, suffix: str) -> str:
        """Return what the macro stands for if the code computes one state."""
        return (
            f"{self.function('real')}({self.arguments})"
            if self.has_header
            else self.one.format(suffix=suffix)
        )

    def one_lane(self, suffix: str) -> str:
        """The real of one lane."""
        lanes = ", ".join(f"{name}[lane]" for name in self.parameters)
        return f"{self.op}{suffix}({lanes})"

    @property
    def lanes(self) -> str:
        """Return the definition of the operation's C macro in code that computes one state per SIMD lane."""
        return f"{self.function('lanes') if self.has_header else 'root_lanes'}({self.arguments})"

    @property
    def has_header(self) -> bool:
        """Whether its functions stand in operations.h."""
        return self.op is not Op.SQRT

    @property
    def is_library(self) -> bool:
        """Whether it calls the C library."""
        return self.op.unit is Unit.CALL

    def function(self, kind: str) -> str:
        """Return the name of the C function that computes the operation. `kind` says for what: reals (one state), lanes
        (one state per lane) or limbs (one limb per lane)."""
        return f"{self.op}_{kind}"

    def declared(self, kind: str) -> str:
        """The parameters of that function."""
        return ", ".join(f"{kind} {name}" for name in self.parameters)


CALLS = {
    call.op: call
    for call in (
        CallView(Op.SQRT, ("value",), "sqrt{suffix}(value)"),
        CallView(Op.ABS, ("a",), "fabs{suffix}(a)", "({kind})(({bits})a & ~({bits})(-({kind}){{0}}))"),
        CallView(
            Op.MIN, ("a", "b"), "a < b || a != a ? a : b", "BLEND({kind}, {bits}, (a < b) | (a != a), a, b)"
        ),
        CallView(
            Op.MAX, ("a", "b"), "a > b || a != a ? a : b", "BLEND({kind}, {bits}, (a > b) | (a != a), a, b)"
        ),
        CallView(Op.SELECT, ("a", "b", "x", "y"), "a < b ? x : y", "BLEND({kind}, {bits}, a < b, x, y)"),
        CallView(Op.EXP, ("a",), "exp{suffix}(a)"),
        CallView(Op.TANH, ("a",), "tanh{suffix}(a)"),
        CallView(Op.LOG, ("a",), "log{suffix}(a)"),
        CallView(Op.POW, ("a", "b"), "pow{suffix}(a, b)"),
        CallView(Op.ATAN2, ("a", "b"), "atan2{suffix}(a, b)"),
    )
}


def call_views(calls: frozenset[Op]) -> tuple[CallView, ...]:
    """Return the C code of the given operations, in the order of the table CALLS."""
    return tuple(call for op, call in CALLS.items() if op in calls)
