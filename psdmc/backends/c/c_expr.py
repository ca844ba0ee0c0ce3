"""Translates a PROGRAM (the list of operations to generate) to C expressions. A value that is used once is written at
its use; any other value gets a C variable.

The C text for one state is also the text for a SIMD vector with one state per lane. A value has the C type `V`, which
is a real number or a vector of real numbers. Values that are equal for all states, such as constants and parameters,
are called uniform and have the type `real`.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from typing import NamedTuple

from psdmc.backends.c.reals import rounded_out
from psdmc.program.operations import Unit
from psdmc.program.program import Op, Program

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
