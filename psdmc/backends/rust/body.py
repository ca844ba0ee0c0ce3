"""Translates a PROGRAM (the list of operations to generate) to Rust statements, and untrusted text to Rust.

A value that is used once is written at its use. A product that is used once, as a term of a sum, becomes a fused
multiply-add.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

from psdmc.backends.render import DEVICE, identifier_of, utf8
from psdmc.program.parts import angles_first
from psdmc.program.program import Op, Program, Slot
from psdmc.program.signature import Quantity

_WORDS = """
as async await break const continue crate dyn else enum extern false fn for gen if impl in let loop match mod move mut pub
ref return self static struct super trait true type union unsafe use where while abstract become box do final macro
override priv try typeof unsized virtual yield
"""
KEYWORDS = frozenset(_WORDS.split())
"""Of all editions, reserved ones too."""

TAKEN = KEYWORDS | {"core", "std", "alloc", "test", "proc_macro", "build", "deps", "examples", "incremental"}
"""What a crate must not be called: crates that come with the compiler, and folders of cargo."""


def identifier(name: str) -> str:
    """A crate's name for `name`, in lower case."""
    return identifier_of(name, _is_reserved).lower()


def _is_reserved(word: str) -> bool:
    return word.lower() in TAKEN or DEVICE.fullmatch(word) is not None


def variable(name: str) -> str:
    """Return the Rust name of a quantity or function. An underscore is added if the name is a Rust keyword or another
    name that the Rust code uses."""
    return f"{name}_" if name in KEYWORDS or name == "fma" else name


def string(untrusted: str) -> str:
    """Return a Rust string literal: plain ASCII stays readable, and an unpaired surrogate becomes U+FFFD."""
    return f'"{"".join(map(_character, untrusted))}"'


def _character(one: str) -> str:
    if " " <= one <= "~" and one not in '"\\':
        return one
    return f"\\u{{{0xFFFD if 0xD800 <= ord(one) < 0xE000 else ord(one):x}}}"


def comment(untrusted: str) -> str:
    """Return text that is safe in a line of Rust documentation: ASCII without backticks, which end code."""
    return "".join(chr(b) if 32 <= b < 127 and b != 96 else f"<{b:02x}>" for b in utf8(untrusted))


# Statements


DEEPEST = 4
"""Deepest nesting of operations in one expression."""

LANES = 4
"""Angles are taken in a multiple of so many, two vectors of which hold a usual arm's: the compiler puts them in lanes."""

_SUM, _PRODUCT, _SIGN, _ATOM = range(4)
WRITTEN = frozenset(
    {Op.LOAD, Op.CONST, Op.ADD, Op.SUB, Op.MUL, Op.DIV, Op.NEG, Op.SQRT, Op.SELECT, Op.SIN, Op.COS}
)
"""Operations that the crate has."""
_SYMBOL = {Op.ADD: ("+", _SUM), Op.SUB: ("-", _SUM), Op.MUL: ("*", _PRODUCT), Op.DIV: ("/", _PRODUCT)}


class Text(NamedTuple):
    """Rust text of an expression, with the precedence of its outermost operator and the depth of its nested brackets."""

    text: str
    binding: int = _ATOM
    depth: int = 0

    def beside(self, binding: int, is_right: bool) -> str:
        """As an operand."""
        loose = self.binding < binding or (is_right and self.binding in (binding, _SIGN))
        return f"({self.text})" if loose else self.text


def place(slot: Slot, shapes: Mapping[str, Sequence[int]]) -> str:
    """Return the Rust text of one entry of a vector or matrix, such as `m[1][2]`. For a scalar, return its name."""
    index, found = slot.index, ""
    for length in reversed(shapes[slot.vector]):
        index, own = divmod(index, length)
        found = f"[{own}]{found}"
    return variable(slot.vector) + found


def number(value: float) -> str:
    """Return a Rust literal that reads back as the same number."""
    if math.isnan(value):
        return "f64::NAN"
    if math.isinf(value):
        return "f64::INFINITY" if value > 0 else "f64::NEG_INFINITY"
    return repr(float(value))


def statements(
    program: Program, shapes: Mapping[str, Sequence[int]], stored: Sequence[Quantity]
) -> list[str]:
    """Return the Rust statements that compute a PROGRAM (the list of operations to generate). All outputs are first set
    to zero, and each entry is stored when its value is known.

    stored  the outputs
    """
    return [*(_declared(q.name, program, shapes) for q in stored), *_Writer(program, shapes).lines()]


def _declared(name: str, program: Program, shapes: Mapping[str, Sequence[int]]) -> str:
    """Declare an output. Rust warns of a value that nothing reads, and of `mut` if nothing is stored."""
    is_stored = any(slot.vector == name and program.body[i].value != 0.0 for slot, i in program.outputs)
    if is_stored and not shapes[name]:
        return f"let {variable(name)};"
    return f"let {'mut ' if is_stored else ''}{variable(name)} = {array(shapes[name], '0.0')};"


def array(shape: Sequence[int], of: str = "f64") -> str:
    """Rust type `[[f64; 3]; 2]` for the shape (2, 3), or an expression with zeros of this type; for no axes, a number."""
    for length in reversed(shape):
        of = f"[{of}; {length}]"
    return of


class _Writer:
    def __init__(self, program: Program, shapes: Mapping[str, Sequence[int]]) -> None:
        self.program, self.shapes = program, shapes
        self.fused = _fused(program)
        self.uses = _uses(program, self.fused)
        self.texts: dict[int, Text] = {}
        self.stores: dict[int, list[Slot]] = {}
        for slot, i in program.outputs:
            self.stores.setdefault(i, []).append(slot)

    def lines(self) -> Iterator[str]:
        for group in angles_first(self.program):
            taken: dict[int, set[Op]] = {}
            for i in group:
                instr = self.program.body[i]
                if not self.uses[i]:
                    continue
                if instr.op in (Op.SIN, Op.COS):
                    taken.setdefault(instr.args[0], set()).add(instr.op)
                    self.texts[i] = Text(f"{instr.op.value}_{instr.args[0]}")
                else:
                    yield from self._value(i)
            if taken:
                yield self._angles(taken)
            for i in group:
                if self.program.body[i].op in (Op.SIN, Op.COS):
                    yield from self._stored(i)

    def _value(self, i: int) -> Iterator[str]:
        made = self._made(i)
        is_own = self.uses[i] > 1 or made.depth >= DEEPEST or i in self.stores
        if is_own and made.depth:
            yield f"let t{i} = {made.text};"
            made = Text(f"t{i}")
        self.texts[i] = made
        yield from self._stored(i)

    def _stored(self, i: int) -> Iterator[str]:
        for slot in self.stores.get(i, ()):
            if self.program.body[i].value != 0.0:
                yield f"{place(slot, self.shapes)} = {self.texts[i].text};"

    def _angles(self, taken: Mapping[int, set[Op]]) -> str:
        free = -len(taken) % LANES if len(taken) > 1 else 0
        angles = [self.texts[a].text for a in taken] + ["0.0"] * free
        names = [
            [f"{op.value}_{a}" if op in ops else "_" for a, ops in taken.items()] + ["_"] * free
            for op in (Op.SIN, Op.COS)
        ]
        return f"let ([{', '.join(names[0])}], [{', '.join(names[1])}]) = sin_cos([{', '.join(angles)}]);"

    def _made(self, i: int) -> Text:
        op, args, slot, value = self.program.body[i]
        if slot is not None:
            return Text(place(slot, self.shapes))
        if value is not None:
            return Text(number(value), _SIGN if math.copysign(1.0, value) < 0 else _ATOM)
        if i in self.fused:
            return self._fma(op, args, self.fused[i])
        operands = [self.texts[a] for a in args]
        depth = 1 + max(operand.depth for operand in operands)
        if op is Op.NEG:
            return Text(f"-{operands[0].beside(_SIGN, True)}", _SIGN, depth)
        if op not in _SYMBOL:
            return Text(f"{op.value}({', '.join(each.text for each in operands)})", _ATOM, depth)
        symbol, binding = _SYMBOL[op]
        left, right = operands
        return Text(f"{left.beside(binding, False)} {symbol} {right.beside(binding, True)}", binding, depth)

    def _fma(self, op: Op, args: tuple[int, ...], product: int) -> Text:
        a, b = (self.texts[x] for x in self.program.body[product].args)
        other = self.texts[args[1] if args[0] == product else args[0]]
        depth = 1 + max(each.depth for each in (a, b, other))
        minus = f"-{other.beside(_SIGN, True)}"
        if op is Op.ADD:
            return Text(f"fma({a.text}, {b.text}, {other.text})", _ATOM, depth)
        if args[0] == product:
            return Text(f"fma({a.text}, {b.text}, {minus})", _ATOM, depth)
        return Text(f"fma(-{a.beside(_SIGN, True)}, {b.text}, {other.text})", _ATOM, depth)


def _fused(program: Program) -> dict[int, int]:
    """Sum -> the product that is fused with it: one that is an operand of sums alone, as C compilers fuse."""
    added = [instr.op is Op.MUL for instr in program]
    for _, i in program.outputs:
        added[i] = False
    for instr in program:
        if instr.op not in (Op.ADD, Op.SUB) or instr.args[0] == instr.args[1]:
            for a in instr.args:
                added[a] = False
    found = {}
    for i, instr in enumerate(program):
        if instr.op in (Op.ADD, Op.SUB):
            products = [a for a in instr.args if added[a]]
            if products:
                found[i] = products[-1]
    return found


def _uses(program: Program, fused: Mapping[int, int]) -> list[int]:
    """How often each value is read: factors of a fused product by its sums."""
    count = [0] * len(program)
    for _, i in program.outputs:
        count[i] += 1
    for i in reversed(range(len(program))):
        if not count[i]:
            continue
        args = program.body[i].args
        if i in fused:
            product = fused[i]
            other = args[1] if args[0] == product else args[0]
            args = (*program.body[product].args, other)
        for a in args:
            count[a] += 1
    return count
