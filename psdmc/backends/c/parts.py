"""Divides a long PROGRAM (the list of operations to generate) into several C functions. The compile time then grows
nearly linearly with the length."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import replace

from psdmc.backends.c.body import calls_of, sections_of, unread, without_products
from psdmc.backends.c.c_expr import uniform_of
from psdmc.backends.c.lines import KEPT, KEPT_REALS, Body, GroupStore, Part, Store, Zeros
from psdmc.backends.c.products import Entry, Multiplication, multiplication
from psdmc.backends.c.store_groups import GROUP
from psdmc.program.parts import in_parts
from psdmc.program.products import Product
from psdmc.program.program import Instr, Op, Program, Slot

LONG = 4950
"""Operations and stores from which on a body is cut: shorter ones compile in seconds, and calls cost a little."""

PART = 800
"""Operations and stores of a part. GCC 12's time for a line, register allocation above all, grows from some 4,000 on."""

_UNIFORM = frozenset({"theta_b", KEPT_REALS})


def is_long(program: Program, sizes: Mapping[str, int]) -> bool:
    """Return whether a PROGRAM (the list of operations to generate) is so long that it is divided into several C
    functions. The length is the number of operations plus the number of output entries (`sizes` by vector)."""
    operations = sum(bool(instr.args) for instr in program)
    return operations + sum(sizes.values()) > LONG


def body_in_parts(
    program: Program,
    inputs: Sequence[str],
    sizes: Mapping[str, int],
    suffix: str,
    stores_early: bool,
    in_groups: Collection[str] = (),
    products: Sequence[Product] = (),
) -> Body:
    """Return the body of a C function for a long PROGRAM (the list of operations to generate). The body calls several
    functions, each of which computes a part. Loops set outputs to zero that are zero at every state.

    The arguments have the meaning of those of make_body.
    """
    multiplied = tuple(multiplication(program, product, sizes) for product in products)
    stored = without_products(sizes, multiplied)
    whole, zeros = _without_zeros(program, stored)
    kept_in = [KEPT_REALS if same else KEPT for same in uniform_of(whole)]
    groups = [group for vector in in_groups if vector in stored for group in _groups(vector, stored[vector])]
    cut = in_parts(whole, kept_in, groups, late=not stores_early, longest=PART)
    signature = dict.fromkeys((*inputs, *stored, *(slot.vector for slot, _ in whole.outputs)))
    names = (*signature, KEPT, KEPT_REALS)
    parts = []
    for number, part in enumerate(cut.programs):
        sections = sections_of(part, stored, suffix, True, in_groups, multiplied, _UNIFORM, with_zeros=False)
        if number == len(cut.programs) - 1:
            sections = (*sections[:-1], replace(sections[-1], steps=(*sections[-1].steps, *zeros)))
        read = {slot.vector for slot in part.inputs()}
        parts.append(_part(names, read, in_groups, multiplied, Body(sections, ())))
    kept = (f"{'V' if vector == KEPT else 'real'} {vector}[{length}]" for vector, length in cut.kept.items())
    return Body((), unread(program, inputs), multiplied, calls_of(program), tuple(parts), tuple(kept))


def _without_zeros(program: Program, sizes: Mapping[str, int]) -> tuple[Program, list[Zeros]]:
    """The PROGRAM storing every output, but for runs of groups that are always zero."""
    values = {slot: program.body[i].value for slot, i in program.outputs}
    runs = [run for vector, size in sizes.items() for run in _zero_runs(vector, size, values)]
    gone = {Slot(run.vector, run.first + k) for run in runs for k in range(run.count)}
    zero = len(program)
    outputs = [(slot, i) for slot, i in program.outputs if slot not in gone]
    taken = {slot for slot, _ in program.outputs} | gone
    wanted = (Slot(vector, k) for vector, size in sizes.items() for k in range(size))
    outputs += [(slot, zero) for slot in wanted if slot not in taken]
    return Program((*program.body, Instr(Op.CONST, value=0.0)), tuple(outputs)), runs


def _zero_runs(vector: str, size: int, values: Mapping[Slot, float | None]) -> Iterator[Zeros]:
    """Runs of two whole groups or more, apart from those that overlap the last one."""
    first, groups = 0, size // GROUP - (1 if size % GROUP else 0)
    for number in range(groups + 1):
        group = (Slot(vector, number * GROUP + k) for k in range(GROUP))
        if number < groups and all(values.get(slot, 0.0) == 0.0 for slot in group):
            continue
        if number > first + 1:
            yield Zeros(vector, first * GROUP, (number - first) * GROUP)
        first = number + 1


def _groups(vector: str, size: int) -> Iterator[list[Slot]]:
    """Outputs that are stored together; the last two groups overlap where the size is no multiple of four."""
    whole = size // GROUP - (1 if size % GROUP else 0)
    for number in range(whole):
        yield [Slot(vector, number * GROUP + k) for k in range(GROUP)]
    if size % GROUP:
        yield [Slot(vector, k) for k in range(whole * GROUP, size)]


def _part(
    names: Sequence[str],
    read: Collection[str],
    in_groups: Collection[str],
    products: Sequence[Multiplication],
    body: Body,
) -> Part:
    """A part's function: of the function's vectors, and those between parts, what it reads and writes."""
    lines = [line for section in body.sections for line in section.steps]
    written = {line.vector for line in lines if isinstance(line, Store | Zeros | GroupStore)}
    right = {line.matrix for line in lines if isinstance(line, Entry) and line.macro == "KEEP"}
    rows = {product.right: product.shape.n for product in products}
    own = tuple(name for name in names if name in {*read, *written, *right})

    def declared(name: str) -> str:
        if name in in_groups:
            return f"DIRECT({name})"
        if name in right:
            return f"real (*{name})[{rows[name]}]"
        return f"{'' if name in written else 'const '}{'V' if name == KEPT else 'real'} *{name}"

    direct = tuple(name for name in own if name in in_groups)
    return Part(tuple(declared(name) for name in own), own, direct, body)
