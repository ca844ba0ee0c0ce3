"""Generated functions and their kernels (the variants of one function) as data for the templates.

The data are names, sizes, function bodies, and the C text of signatures and calls."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

from psdmc.backends.c.body import RegionsView
from psdmc.backends.c.limbs import LimbsView
from psdmc.backends.c.lines import Body, Multiplication
from psdmc.program.kernel import THETA_ROWS
from psdmc.program.products import LARGE
from psdmc.program.signature import Signature


@dataclass(frozen=True, slots=True)
class Prototype:
    """A C function's type: `returns symbol(arguments)`."""

    returns: str
    symbol: str
    arguments: tuple[str, ...]

    @property
    def text(self) -> str:
        return f"{self.returns} {self.symbol}({', '.join(self.arguments)})"


LOOPED = 10
"""Pivots from which on one state's are looked at in a loop: each one alone costs 85 bytes of code."""


@dataclass(frozen=True, slots=True)
class VectorView:
    """An input or output of a C function: `size` real numbers per state, with the array axes `shape`."""

    name: str
    size: int
    shape: tuple[int, ...] = ()


@dataclass(frozen=True, slots=True)
class OutputView(VectorView):
    """One output of a C function.

    direct  True: a batch call writes registers straight into the output array; False: a block of states is collected on
            the stack first
    zero    indices of entries that are zero at every state
    """

    direct: bool = False
    zero: tuple[int, ...] = ()


@dataclass(frozen=True, slots=True)
class KernelView:
    """One kernel (one variant of a generated function): its files with function bodies, its C functions and their
    signatures.

    theta        whether theta_b (the base parameters) is an input
    single_file  file with the body for one state; also used as `lanes_file` if both need the same order of operations
    lanes_file   file with the body for SIMD vectors that hold one state per lane
    limbs        a further body for one state, which computes equal limbs (legs) in SIMD lanes; None if there is none
    positive     the vector of pivots, which must be positive, if it is no output; None if there is no such vector
    pivot_order  the order in which the entries of `positive` are computed
    places       of a matrix that is stored without zeros: (row, column) of each stored entry
    regions      loops and calls of functions, which replace all other bodies; None if there are none
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
        """Return the ending of the kernel's name, which says where the base parameters come from. '' stands for
        compiled-in parameters, '_theta' for an input theta_b, and '_theta_rows' for one theta_b per state of a batch."""
        if self.name.endswith(THETA_ROWS):
            return THETA_ROWS
        return "_theta" if self.theta else ""

    @property
    def pivots_in_loop(self) -> bool:
        """Return whether the code for one state checks in a loop that all pivots of a factorised matrix are positive."""
        return len(self.pivot_order) >= LOOPED and self.pivot_order == tuple(range(len(self.pivot_order)))

    @property
    def single_parts(self) -> str:
        """Return the name of the file with the C functions into which a long function body is divided."""
        return self.single_file.replace(".inc", "_parts.inc")

    @property
    def lanes_parts(self) -> str:
        return self.lanes_file.replace(".inc", "_parts.inc")

    @property
    def by_state(self) -> bool:
        """Return whether the batch function computes the states one after the other. It does so if code with one state
        per SIMD lane would be too long."""
        return any(product.shape.n >= LARGE for product in self.single_body.products)

    @property
    def direct(self) -> bool:
        """Return whether a batch call writes at least one output straight from registers into the output array."""
        return any(output.direct for output in self.outputs)

    @property
    def is_mixed(self) -> bool:
        """Return whether a batch call needs both kinds of storage. One output is then written straight from registers
        into the output array, while another output or the pivots are first collected in a block."""
        return self.direct and (
            self.positive is not None or not all(output.direct for output in self.outputs)
        )

    @property
    def fails_alone(self) -> bool:
        """Return whether the function has one output only, which becomes NaN on failure and has as many entries as
        there are pivots."""
        shapes = [output.shape for output in self.outputs]
        return self.positive is not None and shapes == [self.positive.shape]

    @property
    def mark_rows(self) -> str:
        """Return a C expression for the number of the first state in a block of a batch whose computation failed."""
        assert self.positive is not None
        block = f"{self.positive.name}_block"
        if self.fails_alone:
            return f"mark_failed(rows, {block}, {self.outputs[0].name}_block)"
        return f"first_failed({self.positive.size}, rows, {block})"

    @property
    def needs_lanes(self) -> bool:
        """Return whether another C function calls the variant that stores results as [entry][lane], one state per lane."""
        return not self.direct or "batch_soa" in self.prototypes

    @property
    def lanes(self) -> str:
        """Return the name of the static C function with one state per SIMD lane and results as [entry][lane]."""
        return f"{self.name}_lanes"

    @property
    def lanes_signature(self) -> str:
        return self._signature(f"real *{output.name}" for output in self.outputs)

    @property
    def rows(self) -> str:
        """Return the name of the static C function that computes one state per SIMD lane. It writes outputs that need
        no intermediate block straight into the array of the caller."""
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
    def whole(self) -> str:
        """Return the name of the static C function for states that the code with limbs in lanes cannot compute."""
        return f"{self.name}_whole"

    @property
    def whole_arguments(self) -> str:
        """Return C text of the arguments of `whole` without pivots: copies of inputs, which outputs may overlap."""
        given = [f"{vector.name}_given" for vector in self.inputs]
        return ", ".join([*given, *(output.name for output in self.outputs)])

    @property
    def own_arguments(self) -> str:
        """Return C text of the names of the function's own arguments for one state."""
        return ", ".join(vector.name for vector in (*self.inputs, *self.outputs))

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
        """Return C text of the arguments for one call of the function for one state. The call is for the state `row` of
        a batch, and reads and writes the arrays of the caller."""
        inputs, outputs = (
            [f"{vector.name} + row * {vector.size}" for vector in vectors]
            for vectors in (self.inputs, self.outputs)
        )
        return ", ".join([*inputs, *(["theta_b"] if self.theta else []), *outputs])

    @property
    def one_arguments(self) -> str:
        """Return C text of the arguments for one call of the function for one state. The state was first copied out of
        a block that holds one state per lane."""
        return ", ".join(f"{vector.name}_one" for vector in (*self.inputs, *self.outputs))

    def _arguments(self, outputs: Iterable[str]) -> str:
        names = [f"{vector.name}_block + lane" for vector in self.inputs]
        names += ["theta_b"] if self.theta else []
        names += outputs
        names += [f"{self.positive.name}_block + lane"] if self.positive else []
        return ", ".join(names)

    @property
    def cost_text(self) -> str:
        """Return the numbers of multiplications and additions for one state, as text for the C header."""
        limbs = f"; one state with limbs in lanes: {self.limbs.cost}" if self.limbs else ""
        return f"{self.name}: {self.cost}, {self.lowering}{limbs}"

    @property
    def blocks(self) -> tuple[VectorView, ...]:
        """Return the vectors for which a batch call has blocks on the stack with one state per lane. Outputs that are
        written straight into the output array need no block."""
        outputs = (output for output in self.outputs if not output.direct)
        return (*self.inputs, *outputs, *((self.positive,) if self.positive else ()))


@dataclass(frozen=True, slots=True)
class FunctionView:
    """One generated function with its kernels (its variants without and with theta_b as an input). The variant without
    comes first.

    shape  in words, the shape of each output and of each input that is no vector with one entry per joint
    """

    name: str
    meaning: str
    shape: str
    signature: Signature
    kernels: tuple[KernelView, ...]

    @property
    def has_pivots(self) -> bool:
        return any(kernel.pivot_order or (kernel.regions and kernel.positive) for kernel in self.kernels)

    @property
    def is_regions(self) -> bool:
        """Return whether the C code is loops and calls of other functions, and not straight-line code."""
        return any(kernel.regions for kernel in self.kernels)

    @property
    def products(self) -> tuple[Multiplication, ...]:
        """Return the products of all kernels."""
        return tuple(p for kernel in self.kernels for p in kernel.single_body.products)

    @property
    def limbs(self) -> tuple[int, ...]:
        """Return the numbers of equal limbs that the function computes in SIMD lanes, in ascending order. An example is
        4 for the legs of a quadruped."""
        return tuple(
            sorted({count for kernel in self.kernels if kernel.limbs for count in kernel.limbs.counts})
        )

    @property
    def units(self) -> tuple[FunctionView, ...]:
        """Return one object for each C file of the function. There is one file for the whole function, or one per
        kernel (variant) if the code is so long that it is divided into parts."""
        if not any(kernel.single_body.parts or kernel.lanes_body.parts for kernel in self.kernels):
            return (self,)
        return tuple(replace(self, name=kernel.name, kernels=(kernel,)) for kernel in self.kernels)

    @property
    def needs_parameters(self) -> bool:
        return self.signature.theta
