"""A kernel in the form that templates print: names, sizes and bodies, and the C text of its signatures and calls."""

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
    """A quantity of a signature, `size` reals per state, with its axes' lengths."""

    name: str
    size: int
    shape: tuple[int, ...] = ()


@dataclass(frozen=True, slots=True)
class OutputView(VectorView):
    """An output.

    direct  a batch call writes its rows straight from registers, without a block of them on the stack
    zero    entries that are zero at every state
    """

    direct: bool = False
    zero: tuple[int, ...] = ()


@dataclass(frozen=True, slots=True)
class KernelView:
    """One kernel: the file(s) with its body, its C functions and their signatures.

    single_file  body file, included once per instantiation; also `lanes_file` where one order serves both
    limbs        a further body for one state; None where there is none
    positive     what must be positive and is not put out; None where there is no such thing
    pivot_order  its entries in the order in which they are found
    places       of a packed matrix: (row, column) of each entry
    regions      loops and calls, in the place of all bodies; None where there are none
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
        """Ending of its name that says where its parameters come from: '' if they are compiled in."""
        if self.name.endswith(THETA_ROWS):
            return THETA_ROWS
        return "_theta" if self.theta else ""

    @property
    def pivots_in_loop(self) -> bool:
        """Whether one state's pivots are looked at in a loop."""
        return len(self.pivot_order) >= LOOPED and self.pivot_order == tuple(range(len(self.pivot_order)))

    @property
    def single_parts(self) -> str:
        """File of the functions that a long body consists of."""
        return self.single_file.replace(".inc", "_parts.inc")

    @property
    def lanes_parts(self) -> str:
        return self.lanes_file.replace(".inc", "_parts.inc")

    @property
    def by_state(self) -> bool:
        """Whether its forms for many states take one after the other: lines for lanes would be too many."""
        return any(product.shape.n >= LARGE for product in self.single_body.products)

    @property
    def direct(self) -> bool:
        """Whether a batch call writes rows of some output straight from registers."""
        return any(output.direct for output in self.outputs)

    @property
    def is_mixed(self) -> bool:
        """Whether some outputs are written from registers and others, or what must be positive, are not."""
        return self.direct and (
            self.positive is not None or not all(output.direct for output in self.outputs)
        )

    @property
    def fails_alone(self) -> bool:
        """Whether the outputs that become NaN are one vector, as long as what must be positive."""
        shapes = [output.shape for output in self.outputs]
        return self.positive is not None and shapes == [self.positive.shape]

    @property
    def mark_rows(self) -> str:
        """C expression for the first row of a block that fails."""
        assert self.positive is not None
        block = f"{self.positive.name}_block"
        if self.fails_alone:
            return f"mark_failed(rows, {block}, {self.outputs[0].name}_block)"
        return f"first_failed({self.positive.size}, rows, {block})"

    @property
    def needs_lanes(self) -> bool:
        """Whether anything calls the form that leaves its outputs lane by lane."""
        return not self.direct or "batch_soa" in self.prototypes

    @property
    def lanes(self) -> str:
        """The static function that computes one state per lane."""
        return f"{self.name}_lanes"

    @property
    def lanes_signature(self) -> str:
        return self._signature(f"real *{output.name}" for output in self.outputs)

    @property
    def rows(self) -> str:
        """The static function that computes one state per lane and writes direct outputs into rows."""
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
        """What the function for one state is called with for a row."""
        inputs, outputs = (
            [f"{vector.name} + row * {vector.size}" for vector in vectors]
            for vectors in (self.inputs, self.outputs)
        )
        return ", ".join([*inputs, *(["theta_b"] if self.theta else []), *outputs])

    @property
    def one_arguments(self) -> str:
        """The same for one state that was taken out of its block of lanes."""
        return ", ".join(f"{vector.name}_one" for vector in (*self.inputs, *self.outputs))

    def _arguments(self, outputs: Iterable[str]) -> str:
        names = [f"{vector.name}_block + lane" for vector in self.inputs]
        names += ["theta_b"] if self.theta else []
        names += outputs
        names += [f"{self.positive.name}_block + lane"] if self.positive else []
        return ", ".join(names)

    @property
    def cost_text(self) -> str:
        """Operations of one state, as text for the header."""
        limbs = f"; one state with limbs in lanes: {self.limbs.cost}" if self.limbs else ""
        return f"{self.name}: {self.cost}, {self.lowering}{limbs}"

    @property
    def blocks(self) -> tuple[VectorView, ...]:
        """Buffers of a batch call: every vector lane by lane, except those whose rows are written directly."""
        outputs = (output for output in self.outputs if not output.direct)
        return (*self.inputs, *outputs, *((self.positive,) if self.positive else ()))
