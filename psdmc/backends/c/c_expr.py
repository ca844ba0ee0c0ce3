"""Translation of a PROGRAM to C expressions. A value that is used once is written at its use; other values get names.

The C text for one state is the same as for one state per SIMD lane. A value has the type `V`, a real or a vector of
reals, or is uniform, that is, the same for all states. Constants, and values computed from parameters only, are
uniform.
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
    """C text of a value, with the binding strength of its outermost operator and its depth of nesting."""

    text: str
    binding: int = _ATOM
    depth: int = 0

    def beside(self, binding: int, is_right: bool) -> str:
        """Return the text as an operand of another operator, in brackets unless C parses it the same without them."""
        loose = self.binding < binding or (is_right and self.binding in (binding, _UNARY))
        return f"({self.text})" if loose else self.text


@dataclass(frozen=True, slots=True)
class Names:
    """The C names of a PROGRAM's values, decided before any expression is written.

    named    values that get a name: outputs, and values that are used more than once
    uniform  values that are the same for all states
    """

    program: Program
    named: tuple[bool, ...]
    uniform: tuple[bool, ...]

    @staticmethod
    def of(program: Program, shared: Collection[str] = UNIFORM_VECTORS) -> Names:
        """Decide the names of a PROGRAM's values; vectors in `shared` are the same in all lanes."""
        named = [count > 1 for count in program.uses()]
        for _, index in program.outputs:
            named[index] = True
        _cut_deep_trees(program, named)
        return Names(program, tuple(named), uniform_of(program, shared))


def uniform_of(program: Program, shared: Collection[str] = UNIFORM_VECTORS) -> tuple[bool, ...]:
    """For each value of the PROGRAM, whether it is the same for all states."""
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
    """Whether the generated C writes this operation as a macro, because C has no operator for it. Sines and cosines are
    not among these macros."""
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
