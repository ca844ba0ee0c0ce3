"""Makes the C code of one PROGRAM (the list of scalar operations to generate), line by line, for the template of
function bodies.

Sines and cosines are computed in groups, as early as their angles are known. In code for one state, the angles of a
group then share one SIMD vector.

A function can also consist of regions: straight-line code, loops, and calls of other functions.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby

from psdmc.backends.c.expressions import UNIFORM_VECTORS, Expr, Names, combine, is_call, literal
from psdmc.backends.c.lines import (
    BETWEEN,
    GROUP,
    Angle,
    Body,
    Cleared,
    Entry,
    GroupStore,
    Line,
    Load,
    Multiplication,
    Section,
    Step,
    Store,
    StoreGroups,
    multiplication,
    spread,
)
from psdmc.program.kernel import THETAS
from psdmc.program.operations import Unit
from psdmc.program.parts import TRIGONOMETRIC, angle_groups, cone
from psdmc.program.products import Product
from psdmc.program.program import Op, Program, Slot
from psdmc.program.regions import Call, For, Region, Regions, Slice, Straight, read_late
from psdmc.program.signature import PIVOTS


def make_body(
    program: Program,
    inputs: tuple[str, ...],
    sizes: dict[str, int],
    suffix: str,
    stores_early: bool,
    in_groups: Collection[str] = (),
    products: Sequence[Product] = (),
    uniform: Collection[str] = UNIFORM_VECTORS,
) -> Body:
    """Return the C statements of a PROGRAM (the list of operations to generate) and of the matrix products that follow
    it, divided into sections.

    inputs        vectors of the C function that the statements may read
    sizes         length of each output vector; entries that the PROGRAM does not store become zero
    suffix        of C constants: '' for double, 'f' for float
    stores_early  True: store a value as soon as it is known (large outputs); False: store all at the end (small
                  outputs)
    in_groups     vectors that the batch variant stores four entries at a time, as soon as the fourth is known; any
                  other vector is then stored by the macro STORE_BLOCK
    uniform       vectors that are equal for all states of a batch, such as theta_b
    """
    multiplied = tuple(multiplication(program, product, sizes) for product in products)
    stored = without_products(sizes, multiplied)
    sections = sections_of(program, stored, suffix, stores_early, in_groups, multiplied, uniform)
    return Body(sections, unread(program, inputs), multiplied, calls_of(program))


def without_products(sizes: Mapping[str, int], products: Sequence[Multiplication]) -> dict[str, int]:
    """Return the output vectors that the PROGRAM (the list of operations to generate) stores, with their lengths. Left
    out are outputs that matrix products after the PROGRAM compute."""
    outputs = {product.output for product in products}
    return {name: size for name, size in sizes.items() if name not in outputs}


def unread(program: Program, inputs: Sequence[str]) -> tuple[str, ...]:
    """Return the names of the function's inputs that the PROGRAM (the list of operations to generate) never reads."""
    read = {slot.vector for slot in program.inputs()}
    return tuple(name for name in inputs if name not in read)


def calls_of(program: Program) -> frozenset[Op]:
    """The PROGRAM's operations that are macros."""
    return frozenset(instr.op for instr in program if is_call(instr.op))


def sections_of(
    program: Program,
    sizes: Mapping[str, int],
    suffix: str,
    stores_early: bool,
    in_groups: Collection[str],
    products: Sequence[Multiplication],
    uniform: Collection[str],
    with_zeros: bool = True,
) -> tuple[Section, ...]:
    """Return the C statements of a PROGRAM (the list of operations to generate), divided into sections. With
    `with_zeros`, output entries that the PROGRAM does not store are set to zero. `sizes` are the lengths of the output
    vectors."""
    groups = StoreGroups({vector: size for vector, size in sizes.items() if vector in in_groups})
    beside = {slot.vector for slot, _ in program.outputs} | set(sizes) if in_groups else set()
    apart = frozenset(beside.difference(in_groups))
    whole = {vector: size for vector, size in sizes.items() if vector not in apart}
    runs = cleared(program, whole) if with_zeros and not products else ()
    program = without_zeros(program, runs) if runs else program
    writer = _Writer(program, suffix, stores_early, groups, apart, products, uniform, runs)
    return writer.sections(sizes if with_zeros else {})


class _Writer:
    """Texts of a PROGRAM's values, made in the order in which they are printed."""

    def __init__(
        self,
        program: Program,
        suffix: str,
        stores_early: bool,
        groups: StoreGroups,
        beside: frozenset[str],
        products: Sequence[Multiplication],
        uniform: Collection[str],
        runs: Sequence[Cleared],
    ) -> None:
        self.program, self.suffix, self.stores_early = program, suffix, stores_early
        self.groups, self.beside, self.runs = groups, beside, runs
        self.left = {product.left: product.shape for product in products}
        self.right = {product.right: product.shape for product in products}
        self.stored: dict[Slot, Store] = {}
        self.uniform, self.names = uniform, Names.of(program, uniform)
        self.stores: dict[int, list[Slot]] = {}
        for slot, index in program.outputs:
            self.stores.setdefault(index, []).append(slot)
        self.done = [False] * len(program)
        self.taken = {(op, args) for op, args, _, _ in program.body if op in TRIGONOMETRIC}

    def sections(self, sizes: Mapping[str, int]) -> tuple[Section, ...]:
        sections: list[Section] = []
        for number, group in enumerate(angle_groups(self.program)):
            wanted = cone(self.program, group)
            loads, steps = self._loads(wanted), self._steps(wanted, False)
            sections.append(Section(loads, steps, tuple(self._angle(a) for a in group), number))
        everything = range(len(self.program))
        loads, steps = self._loads(everything), self._steps(everything, self.stores_early)
        late = () if self.stores_early else self.program.outputs
        stores = [line for slot, i in late for line in self._store(slot, i)]
        rest = (*steps, *stores, *self._zeros(sizes), *self.runs)
        return (*sections, Section(loads, rest, (), len(sections)))

    def _loads(self, wanted: range | list[int]) -> tuple[Load, ...]:
        """The inputs among these values that no earlier section has loaded."""
        slots = {self.program.body[i].slot for i in wanted if not self.done[i]}
        return tuple(
            Load(_load_name(slot), slot.vector, slot.index, slot.vector in self.uniform)
            for slot in self.program.inputs()
            if slot in slots and slot.vector not in BETWEEN
        )

    def _steps(self, wanted: range | list[int], with_stores: bool) -> tuple[Line, ...]:
        lines: list[Line] = []
        for i in wanted:
            if not self.done[i] and self.names.named[i]:
                op, args, _, _ = self.program.body[i]
                if args and op.unit is not Unit.SINCOS:
                    lines.append(Step(f"t{i}", self._operation(i).text, self.names.uniform[i]))
            self.done[i] = True
            for slot in self.stores.get(i, ()) if with_stores else ():
                lines += self._store(slot, i)
        return tuple(lines)

    def _store(self, slot: Slot, i: int) -> list[Line]:
        text, uniform = self._value(i).text, self.names.uniform[i]
        if slot.vector in self.right:
            column, row = divmod(slot.index, self.right[slot.vector].n)
            kept = column >= self.right[slot.vector].zero
            return [Entry("KEEP", slot.vector, row, column, spread(text, uniform))] if kept else []
        stored = self._stored(self._store_of(slot, text, uniform))
        if slot.vector in self.left:
            row, column = divmod(slot.index, self.left[slot.vector].n)
            stored.append(Entry("NAME", slot.vector, row, column, spread(text, uniform)))
        return stored

    def _store_of(self, slot: Slot, text: str, uniform: bool) -> Store:
        macro = "STORE_BLOCK" if slot.vector in self.beside else "STORE"
        return Store(slot.vector, slot.index, text, uniform, macro)

    def _zeros(self, sizes: Mapping[str, int]) -> list[Line]:
        taken = {slot for slot, _ in self.program.outputs}
        in_runs = {slot for run in self.runs for slot in run.slots}
        zero = literal(0.0, self.suffix).text
        return [
            line
            for vector, size in sizes.items()
            for index in range(size)
            if (slot := Slot(vector, index)) not in taken
            for line in self._stored(
                Store(vector, index, zero, True, "STORE_ZERO")
                if slot in in_runs
                else self._store_of(slot, zero, True)
            )
        ]

    def _stored(self, store: Store) -> list[Line]:
        """A store, and the groups that it completes."""
        slot = Slot(store.vector, store.index)
        self.stored[slot] = store
        return [store, *(self._group(first) for first in self.groups.completed_by(slot))]

    def _group(self, first: Slot) -> GroupStore:
        members = (self.stored[Slot(first.vector, first.index + k)] for k in range(GROUP))
        texts = tuple(spread(store.text, store.uniform) for store in members)
        return GroupStore(first.vector, first.index, texts)

    def _angle(self, a: int) -> Angle:
        sine = f"sin_{a}" if (Op.SIN, (a,)) in self.taken else None
        cosine = f"cos_{a}" if (Op.COS, (a,)) in self.taken else None
        return Angle(spread(self._value(a).text, self.names.uniform[a]), sine, cosine)

    def _value(self, i: int) -> Expr:
        """A value as an operand: its name, or its expression where nothing else uses it."""
        op, args, slot, value = self.program.body[i]
        if len(args) == 2:  # as nearly all
            return Expr(f"t{i}") if self.names.named[i] else self._operation(i)
        if slot is not None:
            return Expr(_load_name(slot))
        if value is not None:
            return literal(value, self.suffix)
        if op in TRIGONOMETRIC:
            return Expr(f"{op}_{args[0]}")
        return Expr(f"t{i}") if self.names.named[i] else self._operation(i)

    def _operation(self, i: int) -> Expr:
        op, args, _, _ = self.program.body[i]
        operands = [self._value(a) for a in args]
        if is_call(op):
            uniform = (self.names.uniform[a] for a in args)
            texts = (spread(each.text, same) for each, same in zip(operands, uniform, strict=True))
            return Expr(f"{op.upper()}({', '.join(texts)})")
        return combine(op, operands)


def _load_name(slot: Slot) -> str:
    """The name that an input is loaded into; what lies between parts is read where it is used: loaded before, it would be
    stored and fetched once more, as registers are few."""
    if slot.vector in BETWEEN:
        return str(slot)
    return f"{slot.vector}_{slot.index}"


# Outputs that are zero at every state
#
# Finds outputs that are zero at every state of the robot. Code for one state sets consecutive zeros with
# vector instructions.
#
# Most entries of a tree robot's matrices are zero: 1,164 of 1,692 in the regressor of solo12. If they were
# stored one by one, they would take a third of the function's code. Code for batches stores these zeros
# together with neighbouring outputs.


SHORTEST = 4
"""Entries of a run: a vector with AVX2. solo12's regressor: 819 ns, with runs of eight or more cleared 633, of four 621."""

LEAST = 256
"""Entries of all runs together: fewer do not show in a call's time. No six- or seven-joint arm has as many."""


def cleared(program: Program, sizes: Mapping[str, int]) -> tuple[Cleared, ...]:
    """Return the groups of consecutive output entries that are zero at every state. Return an empty tuple if there are
    too few such entries to be worth it.

    sizes  length of each output vector
    """
    zero = zero_outputs(program, sizes)
    runs = tuple(run for vector in sizes for run in _runs(vector, zero[vector]))
    return runs if sum(run.count for run in runs) >= LEAST else ()


def zero_outputs(program: Program, sizes: Mapping[str, int]) -> dict[str, list[int]]:
    """Return, for each output vector, the entries that are zero at every state. The PROGRAM (the list of operations to
    generate) does not store these entries, or stores the constant zero."""
    values = {slot: program.body[i].value for slot, i in program.outputs}
    return {
        vector: [index for index in range(size) if values.get(Slot(vector, index), 0.0) == 0.0]
        for vector, size in sizes.items()
    }


def without_zeros(program: Program, runs: tuple[Cleared, ...]) -> Program:
    """Return the PROGRAM (the list of operations to generate) without the output entries in the given groups of zeros."""
    gone = {slot for run in runs for slot in run.slots}
    return Program(program.body, tuple((slot, i) for slot, i in program.outputs if slot not in gone))


def _runs(vector: str, entries: list[int]) -> Iterator[Cleared]:
    """Runs of neighbours: their number less their place in the list is the same for all."""
    for _, run in groupby(enumerate(entries), key=lambda each: each[1] - each[0]):
        indices = [index for _, index in run]
        if len(indices) >= SHORTEST:
            yield Cleared(vector, indices[0], len(indices))


# Loops and calls


@dataclass(frozen=True, slots=True)
class Piece:
    """Part of a function's C code: lines of C text, or statements of straight-line code with their indentation."""

    spaces: int
    lines: tuple[str, ...]
    body: Body | None = None


@dataclass(frozen=True, slots=True)
class RegionsView:
    """The body of a C function that contains loops or calls. First come declarations of the internal arrays and
    constants, then the parts of the code in their order.

    kept    names and lengths of inputs that are copied first. The code reads them after it has written an output, and
            the caller's arrays may overlap
    tested  name and length of the internal array of pivots that must be positive at the end, besides those of called
            functions; None if there is no such array
    """

    declarations: tuple[str, ...]
    pieces: tuple[Piece, ...]
    kept: tuple[tuple[str, int], ...]
    tested: tuple[str, int] | None = None

    @property
    def calls(self) -> frozenset[Op]:
        """Operations that are macros."""
        return frozenset(op for piece in self.pieces if piece.body for op in piece.body.calls)


def regions_view(
    body: Regions, inputs: Mapping[str, int], outputs: Sequence[str], robot: str, suffix: str
) -> RegionsView:
    """Return the C code of a function that consists of regions (straight-line code, loops, and calls of other
    functions). `inputs` are the lengths of the function's inputs by name, `outputs` the names of its outputs.

    robot   prefix of the names of the called functions
    suffix  of C constants: '' for double, 'f' for float
    """
    constants = tuple(
        f"static const real {name}[{len(values)}] = {{{', '.join(literal(x, suffix).text for x in values)}}}"
        for name, values in body.constants.items()
    )
    arrays = tuple(f"real {name}[{size}]" for name, size in body.arrays.items())
    theta = next((name for name in inputs if name in ("theta_b", THETAS.name)), "")
    writer = _RegionWriter(robot, theta, suffix, {*inputs, *body.constants})
    kept = tuple((name, inputs[name]) for name in read_late(body, tuple(inputs), outputs, theta))
    tested = (PIVOTS, body.arrays[PIVOTS]) if PIVOTS in body.arrays else None
    return RegionsView((*constants, *arrays), tuple(writer.pieces(body.regions, 1)), kept, tested)


@dataclass(frozen=True, slots=True)
class _RegionWriter:
    """`theta`: the parameters that go to the called functions, '' where theirs are compiled in; `fixed`: arrays, and slices
    of them, that nothing may be stored into."""

    robot: str
    theta: str
    suffix: str
    fixed: set[str]

    def pieces(self, regions: Sequence[Region], depth: int) -> Iterator[Piece]:
        spaces = 4 * depth
        for region in regions:
            if isinstance(region, Straight):
                body = make_body(region.program, (), {}, self.suffix, stores_early=False, uniform=())
                if depth > 1 and len(regions) == 1:  # the loop's own braces
                    yield Piece(spaces - 4, (), body)
                    continue
                yield Piece(spaces, ("{",))
                yield Piece(spaces, (), body)
                yield Piece(spaces, ("}",))
            elif isinstance(region, For):
                counter = f"round_{depth}"
                head = f"for (size_t {counter} = 0; {counter} < {region.count}; {counter}++) {{"
                yield Piece(spaces, (head,))
                yield Piece(spaces + 4, tuple(self._slice(each, counter) for each in region.slices))
                yield from self.pieces(region.regions, depth + 1)
                yield Piece(spaces, ("}",))
            else:
                yield Piece(spaces, tuple(self._call(region)))

    def _slice(self, each: Slice, counter: str) -> str:
        is_fixed = each.array in self.fixed
        self.fixed.discard(each.name)
        self.fixed.update({each.name} if is_fixed else ())
        moved = counter if each.stride == 1 else f"{counter} * {each.stride}"
        start = f"{each.array} + {each.first} + {moved}" if each.first else f"{each.array} + {moved}"
        return f"{'const real' if is_fixed else 'real'} *const {each.name} = {start};"

    def _call(self, call: Call) -> Iterator[str]:
        given, found = ([_at(*place) for place in places] for places in (call.given, call.found))
        arguments = ", ".join([*given, *([self.theta] if self.theta else []), *found])
        called = f"{self.robot}_{call.function}{'_theta' if self.theta else ''}({arguments})"
        if not call.pivots:
            yield f"{called};"
            return
        yield "{"
        yield f"    const int bad = {called};"
        yield "    if (bad && !failed) {"
        yield f"        failed = {'' if call.again else 'before + '}bad;"
        yield "    }"
        if not call.again:
            yield f"    before += {call.pivots};"
        yield "}"


def _at(array: str, first: int) -> str:
    return f"{array} + {first}" if first else array
