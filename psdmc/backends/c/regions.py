"""C code of a function that consists of regions (straight-line code, loops, and calls of other functions), as data for
the template. Loops and calls are C text; straight-line code is a list of statements."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from psdmc.backends.c.body import make_body
from psdmc.backends.c.expressions import literal
from psdmc.backends.c.lines import Body
from psdmc.program.operations import Op
from psdmc.program.regions import Call, For, Region, Regions, Slice, Straight, read_late
from psdmc.program.signature import PIVOTS
from psdmc.program.theta_rows import THETAS


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
    writer = _Writer(robot, theta, suffix, {*inputs, *body.constants})
    kept = tuple((name, inputs[name]) for name in read_late(body, tuple(inputs), outputs, theta))
    tested = (PIVOTS, body.arrays[PIVOTS]) if PIVOTS in body.arrays else None
    return RegionsView((*constants, *arrays), tuple(writer.pieces(body.regions, 1)), kept, tested)


@dataclass(frozen=True, slots=True)
class _Writer:
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
