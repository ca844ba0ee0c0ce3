"""A kernel (the code of one function variant) in the form that templates print: names, sizes, bodies, and the C text of
signatures and calls."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from psdmc.backends.c.limbs import LimbsView
from psdmc.backends.c.lines import Body
from psdmc.backends.c.prototypes import Prototype
from psdmc.backends.c.regions import RegionsView
from psdmc.program.products import LARGE
from psdmc.program.signature import Signature
from psdmc.program.theta_rows import THETA_ROWS

LOOPED = 10
"""Pivots from which on one state's are looked at in a loop: each one alone costs 85 bytes of code."""


@dataclass(frozen=True, slots=True)
class VectorView:
    """An input or output of a C function: `size` reals per state, and the lengths of its axes."""

    name: str
    size: int
    shape: tuple[int, ...] = ()


@dataclass(frozen=True, slots=True)
class OutputView(VectorView):
    """One output of a C function.

    direct  a batch call writes its rows straight from registers, without first storing a block of them on the stack
    zero    entries that are zero at every state
    """

    direct: bool = False
    zero: tuple[int, ...] = ()


@dataclass(frozen=True, slots=True)
class KernelView:
    """One kernel, the code of one variant of a function: its body files, C functions and their signatures.

    single_file  body file, included once per instantiation; also `lanes_file` if one order of operations serves both
    limbs        a further body for one state, with limbs in SIMD lanes; None if there is none
    positive     the vector that must be positive and is not an output; None if there is no such vector
    pivot_order  the order in which the entries of `positive` are computed
    places       of a packed matrix: (row, column) of each entry
    regions      loops and calls, which replace all bodies; None if there are none
    """

    name: str
    function: Signature
    theta: bool
    inputs: tuple[VectorView, ...]
    outputs: tuple[OutputView, ...]
    positive: VectorView | None
    prototypes: Mapping[str, Prototype]
    single_file: str
    lanes_file: str
    single_body: Body
    lanes_body: Body
    pivot_order: tuple[int, ...]
    cost: str
    lowering: str
    limbs: LimbsView | None = None
    places: tuple[tuple[int, int], ...] = ()
    regions: RegionsView | None = None

    @property
    def variant(self) -> str:
        """The ending of the kernel's name: '_theta' or '_theta_rows' for parameters at run time, '' for compiled-in
        ones."""
        if self.name.endswith(THETA_ROWS):
            return THETA_ROWS
        return "_theta" if self.theta else ""

    @property
    def pivots_in_loop(self) -> bool:
        """Whether the code for one state tests its pivots in a loop."""
        return len(self.pivot_order) >= LOOPED and self.pivot_order == tuple(range(len(self.pivot_order)))

    @property
    def single_parts(self) -> str:
        """Name of the file that contains the C functions of a long body."""
        return self.single_file.replace(".inc", "_parts.inc")

    @property
    def lanes_parts(self) -> str:
        return self.lanes_file.replace(".inc", "_parts.inc")

    @property
    def by_state(self) -> bool:
        """Whether batch functions compute one state after the other, because code for SIMD lanes would be too long."""
        return any(product.shape.n >= LARGE for product in self.single_body.products)

    @property
    def direct(self) -> bool:
        """Whether a batch call writes the rows of at least one output straight from registers."""
        return any(output.direct for output in self.outputs)

    @property
    def is_mixed(self) -> bool:
        """Whether some outputs are written from registers while others, or the pivots, are stored in a block first."""
        return self.direct and (
            self.positive is not None or not all(output.direct for output in self.outputs)
        )

    @property
    def fails_alone(self) -> bool:
        """Whether exactly one output vector becomes NaN on failure, and this vector is as long as the pivots."""
        shapes = [output.shape for output in self.outputs]
        return self.positive is not None and shapes == [self.positive.shape]

    @property
    def mark_rows(self) -> str:
        """C expression for the number of the first failing row of a block."""
        assert self.positive is not None
        block = f"{self.positive.name}_block"
        if self.fails_alone:
            return f"mark_failed(rows, {block}, {self.outputs[0].name}_block)"
        return f"first_failed({self.positive.size}, rows, {block})"

    @property
    def needs_lanes(self) -> bool:
        """Whether another function calls the variant that leaves its outputs lane by lane."""
        return not self.direct or "batch_soa" in self.prototypes

    @property
    def lanes(self) -> str:
        """The static C function that computes one state per SIMD lane."""
        return f"{self.name}_lanes"

    @property
    def lanes_signature(self) -> str:
        return self._signature(f"real *{output.name}" for output in self.outputs)

    @property
    def rows(self) -> str:
        """The static C function that computes one state per lane and writes direct outputs into the caller's rows."""
        return f"{self.name}_rows"

    @property
    def rows_signature(self) -> str:
        return self._signature(
            f"real *const *{output.name}_row" if output.direct else f"real *{output.name}"
            for output in self.outputs
        )

    def _signature(self, outputs: Iterable[str]) -> str:
        names = [f"const real *{vector.name}" for vector in self.inputs]
        names += ["const real *theta_b"] if self.theta else []
        names += outputs
        names += [f"real *{self.positive.name}"] if self.positive else []
        return ", ".join(names)

    @property
    def lanes_arguments(self) -> str:
        return self._arguments(f"{output.name}_block + lane" for output in self.outputs)

    @property
    def rows_arguments(self) -> str:
        return self._arguments(
            f"{output.name}_{'row' if output.direct else 'block'} + lane" for output in self.outputs
        )

    @property
    def row_arguments(self) -> str:
        """C text of the arguments with which the function for one state is called for a row."""
        inputs, outputs = (
            [f"{vector.name} + row * {vector.size}" for vector in vectors]
            for vectors in (self.inputs, self.outputs)
        )
        return ", ".join([*inputs, *(["theta_b"] if self.theta else []), *outputs])

    @property
    def one_arguments(self) -> str:
        """C text of the arguments for one state that was copied out of its block of lanes."""
        return ", ".join(f"{vector.name}_one" for vector in (*self.inputs, *self.outputs))

    def _arguments(self, outputs: Iterable[str]) -> str:
        names = [f"{vector.name}_block + lane" for vector in self.inputs]
        names += ["theta_b"] if self.theta else []
        names += outputs
        names += [f"{self.positive.name}_block + lane"] if self.positive else []
        return ", ".join(names)

    @property
    def cost_text(self) -> str:
        """The number of operations for one state, as text for the header."""
        limbs = f"; one state with limbs in lanes: {self.limbs.cost}" if self.limbs else ""
        return f"{self.name}: {self.cost}, {self.lowering}{limbs}"

    @property
    def blocks(self) -> tuple[VectorView, ...]:
        """Buffers of a batch call, lane by lane: all vectors except those whose rows are written directly."""
        outputs = (output for output in self.outputs if not output.direct)
        return (*self.inputs, *outputs, *((self.positive,) if self.positive else ()))
