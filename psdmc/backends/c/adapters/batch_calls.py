"""The C functions for many states, as programs call them that have arrays of their own: Python's wheel, MATLAB's MEX."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from psdmc.backends.c.kernel_view import FunctionView, KernelView
from psdmc.backends.c.render import c_comment
from psdmc.program.signature import Q, Quantity


@dataclass(frozen=True, slots=True)
class BatchCall:
    """A generated C function for many states, as an extension module calls it.

    name    name of the generated function with its variant
    call    C text of the call, in which the arrays are a[0], a[1], ...
    fails   whether the call returns a status
    sizes   for each array, how many real numbers belong to one state; for theta_b, its whole length
    inputs  number of input arrays, which precede the output arrays
    theta   index of the array theta_b (base parameters), which is shared by all states; -1 if there is none
    """

    name: str
    call: str
    fails: bool
    sizes: tuple[int, ...]
    inputs: int
    theta: int


@dataclass(frozen=True, slots=True)
class BatchArray:
    """An input or output array of a function: name, shape `tail` for one state, and meaning `means`. If it is `batched`,
    it can have one more axis for many states. Texts show users the shape of many states."""

    name: str
    tail: tuple[int, ...]
    means: str
    batched: bool

    @property
    def size(self) -> int:
        """Real numbers per state."""
        return math.prod(self.tail)

    @property
    def python_shape(self) -> str:
        lead = ("...",) if self.batched else ()
        return f"({', '.join(map(str, (*lead, *self.tail)))})"

    @property
    def matlab_shape(self) -> str:
        return " x ".join(map(str, (*(self.tail or (1,)), "N" if self.batched else 1)))


@dataclass(frozen=True, slots=True)
class BatchFunction:
    """One function of another program's module.

    meaning      description in one line of ASCII without quotation marks
    note         explanation of derivatives by q, in one line; empty if the outputs contain none
    baked        name of the C function without the input theta_b (base parameters); None if the package lacks it
    theta        name of the C function with the input theta_b; None if the package lacks it
    positions    indices of the inputs that contain quaternions, which must have length one
    """

    name: str
    meaning: str
    note: str
    inputs: tuple[BatchArray, ...]
    outputs: tuple[BatchArray, ...]
    baked: str | None
    theta: str | None
    positions: tuple[int, ...]

    @property
    def usage(self) -> str:
        """Return the names of the arguments, with brackets around one that is optional."""
        theta = [] if not self.theta else ["[theta_b]" if self.baked else "theta_b"]
        return ", ".join([*(array.name for array in self.inputs), *theta])

    @property
    def result(self) -> str:
        """Return the name of the class that holds the outputs if there are several; else an empty text."""
        return "".join(map(str.capitalize, self.name.split("_"))) if len(self.outputs) > 1 else ""


def batch_call(kernel: KernelView, l: int) -> BatchCall:
    """Return how the function for many states of a kernel is called; l is the number of base parameters."""
    inputs = [*(vector.size for vector in kernel.inputs), *([l] if kernel.theta else [])]
    sizes = (*inputs, *(vector.size for vector in kernel.outputs))
    batch = kernel.prototypes["batch"]
    arrays = ", ".join(f"a[{k}]" for k in range(len(sizes)))
    return BatchCall(
        kernel.name,
        f"{batch.symbol}(count, {arrays})",
        batch.returns != "void",
        sizes,
        len(inputs),
        len(kernel.inputs) if kernel.theta else -1,
    )


def batch_function(function: FunctionView) -> BatchFunction:
    """Return a function with its arrays and their descriptions."""
    signature, (first, *_) = function.signature, function.kernels
    baked, theta = (
        next((k.name for k in function.kernels if k.theta is wants), None) for wants in (False, True)
    )
    return BatchFunction(
        name=function.name,
        meaning=plain(function.meaning),
        note=plain(signature.note),
        inputs=_arrays(signature.inputs, [vector.shape for vector in first.inputs]),
        outputs=_arrays(
            signature.outputs, [vector.shape for vector in first.outputs], bool(signature.inputs)
        ),
        baked=baked,
        theta=theta,
        positions=tuple(
            k for k, q in enumerate(signature.inputs) if q.axes == Q.axes and not signature.normalizes
        ),
    )


def plain(text: str) -> str:
    """Return untrusted text in a form that may stand in a docstring or in a comment."""
    return c_comment(text).replace('"', "'")


def _arrays(
    quantities: Sequence[Quantity], shapes: Sequence[tuple[int, ...]], batched: bool = True
) -> tuple[BatchArray, ...]:
    return tuple(
        BatchArray(q.name, shape, plain(q.means), batched)
        for q, shape in zip(quantities, shapes, strict=True)
    )
