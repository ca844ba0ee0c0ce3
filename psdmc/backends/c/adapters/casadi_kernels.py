"""Kernels of derivatives that CasADi needs and no generated function computes. They are made from the functions' PROGRAMs.

CasADi's function normalizes the quaternions of q before it calls the generated function. This module writes the
normalization in front of the PROGRAM. Thus all derivatives, also second derivatives, are by the entries of q, for
quaternions of any length. The entries of matrices are in CasADi's order, column by column.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from math import prod

from psdmc.backends.info import PackageInfo
from psdmc.program.interpret import Value, replayed
from psdmc.program.kernel import Kernel
from psdmc.program.pipeline import ordered, shortened
from psdmc.program.program import Op, Program, Slot
from psdmc.program.signature import PIVOTS, Q, Quantity, Signature, Sizes
from psdmc.program.slopes import Block, jacobians, vjp
from psdmc.program.trace import Tracer
from psdmc.target.target import Costs

JACOBIAN, ADJOINT, SECOND = "_jac", "_adj1", "_jac_adj1"
"""Endings of the kernels' names. The first has derivatives of all outputs by all inputs, the second the gradient of the
outputs' weighted sum by all inputs, the third derivatives of this gradient by all inputs and weights."""

MOST = 10_000
"""Largest number of entries of a Jacobian. A quadruped's mass matrix has fewer, and its frame Jacobians, too."""

THETA = "theta_b"


def sizes_of(function: Signature, sizes: Sizes, theta: bool) -> tuple[dict[str, int], dict[str, int]]:
    """Return the length of each input, including theta_b, and of each output."""
    inputs = {quantity.name: sizes.size(quantity) for quantity in function.inputs}
    return inputs | ({THETA: sizes.l} if theta else {}), {q.name: sizes.size(q) for q in function.outputs}


def has_small_jacobian(function: Signature, sizes: Sizes, theta: bool = False) -> bool:
    """True if a function has inputs, and at most MOST derivatives."""
    inputs, outputs = sizes_of(function, sizes, theta)
    return 0 < sum(inputs.values()) * sum(outputs.values()) <= MOST


@dataclass(frozen=True, eq=False)
class Derived:
    """Makes the kernels of one function's derivatives. `kernel` has a straight-line PROGRAM."""

    kernel: Kernel
    info: PackageInfo
    costs: Costs

    @cached_property
    def _lengths(self) -> tuple[dict[str, int], dict[str, int]]:
        return sizes_of(self.kernel.function, self.info.sizes, self.kernel.theta)

    @property
    def jacobian(self) -> Kernel:
        inputs, outputs = self._lengths
        blocks = [Block(f"jac_{o}_{i}", o, i, outputs[o], inputs[i]) for o, i in product(outputs, inputs)]
        return self._of_blocks(JACOBIAN, (), self._function, blocks)

    @property
    def adjoint(self) -> Kernel:
        sizes, inputs = self.info.sizes, self.kernel.function.inputs
        shapes = {f"adj_{q.name}": shape_of_input(sizes.shape(q.axes)) for q in inputs}
        shapes |= {f"adj_{THETA}": (sizes.l,)} if self.kernel.theta else {}
        at = {name: _columns_first(shape[::-1]) for name, shape in shapes.items()}
        stored = tuple(
            (Slot(slot.vector, at[slot.vector][slot.index]) if slot.vector in at else slot, value)
            for slot, value in self._gradients.outputs
        )
        outputs = [Quantity(name, tuple(map(str, shape))) for name, shape in shapes.items()]
        return self._kernel(ADJOINT, self._seeds, outputs, Program(self._gradients.body, stored))

    @property
    def second(self) -> Kernel:
        inputs, _ = self._lengths
        by = inputs | {seed.name: int(seed.axes[0]) for seed in self._seeds}
        blocks = [Block(f"jac_adj_{i}_{j}", f"adj_{i}", j, inputs[i], by[j]) for i, j in product(inputs, by)]
        return self._of_blocks(SECOND, self._seeds, self._gradients, blocks)

    @property
    def _seeds(self) -> list[Quantity]:
        return [Quantity(f"seed_{name}", (str(size),)) for name, size in self._lengths[1].items()]

    @cached_property
    def _function(self) -> Program:
        """The PROGRAM of CasADi's function."""
        function, sizes = self.kernel.function, self.info.sizes
        at = {q.name: _columns_first(sizes.shape(q.axes)) for q in function.outputs}
        tracer = Tracer()
        positions = [q.name for q in function.inputs if q.axes == Q.axes and not function.normalizes]
        given = dict(
            one for name, unit in product(positions, self.info.units) for one in _divided(tracer, name, *unit)
        )
        values = replayed(self.kernel.single, tracer, given)
        slots = [
            Slot(slot.vector, at[slot.vector][slot.index] if slot.vector in at else slot.index)
            for slot, _ in self.kernel.single.outputs
        ]
        return tracer.finish(list(zip(slots, values, strict=True)))

    @cached_property
    def _gradients(self) -> Program:
        inputs, outputs = self._lengths
        found = vjp(
            self._function,
            {name: f"seed_{name}" for name in outputs},
            {name: f"adj_{name}" for name in inputs},
            inputs,
        )
        return _storing(found, [PIVOTS, *(f"adj_{name}" for name in inputs)])

    def _of_blocks(
        self, ending: str, more: Sequence[Quantity], program: Program, blocks: Sequence[Block]
    ) -> Kernel:
        """Return the kernel of Jacobians, by the mode that gives the shorter PROGRAM."""
        found = min((jacobians(program, blocks, mode) for mode in ("forward", "reverse")), key=len)
        outputs = [Quantity(block.name, (str(block.rows), str(block.columns))) for block in blocks]
        return self._kernel(ending, more, outputs, found)

    def _kernel(
        self, ending: str, more: Sequence[Quantity], outputs: Sequence[Quantity], program: Program
    ) -> Kernel:
        own = self.kernel.function
        function = replace(
            own,
            name=own.name + ending,
            meaning=f"derivatives of {own.name} for CasADi",
            inputs=(*own.inputs, *more),
            outputs=tuple(outputs),
            products=(),
            thin=(),
            calls=(),
            normalizes=True,
        )
        stored = _storing(program, [PIVOTS, *(quantity.name for quantity in outputs)])
        one, _ = ordered(shortened(stored), self.costs)
        return Kernel(function, self.kernel.theta, one, one, self.kernel.lowering)


def matrix_of(shape: Sequence[int]) -> tuple[int, int]:
    """Return rows and columns. The last axis is that of columns; a vector is a column."""
    return (prod(shape[:-1]), shape[-1]) if len(shape) > 1 else (prod(shape), 1)


def shape_of_input(shape: Sequence[int]) -> tuple[int, ...]:
    """Return an input's shape in CasADi. A matrix has one column per row of ours, so the order in memory is the same."""
    return matrix_of(shape)[::-1] if len(shape) > 1 else (prod(shape),)


def _columns_first(shape: Sequence[int]) -> list[int]:
    """Return where CasADi stores the entries of a row-major array, whose last axis is that of columns."""
    rows, columns = matrix_of(shape)
    return [column * rows + row for row in range(rows) for column in range(columns)]


def _divided(tracer: Tracer, name: str, first: int, end: int) -> Iterator[tuple[Slot, Value]]:
    """Yield a quaternion of a position, divided by its length."""
    slots = [Slot(name, k) for k in range(first, end)]
    entries = [tracer.symbol(slot) for slot in slots]
    square: Value = sum((entry * entry for entry in entries), start=0.0)
    length = tracer.operated(Op.SQRT, [square])
    yield from zip(slots, (entry / length for entry in entries), strict=True)


def _storing(program: Program, names: Sequence[str]) -> Program:
    """Return the PROGRAM with only the outputs of these names."""
    return Program(program.body, tuple(each for each in program.outputs if each[0].vector in names))
