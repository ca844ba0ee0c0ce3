"""The generated functions as data for the templates: each function with its variants and its C files."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

from psdmc.backends.c.kernel_view import KernelView
from psdmc.backends.c.make_kernel_view import make_kernel_view, sizes_of
from psdmc.backends.c.products import Multiplication
from psdmc.backends.options import EmitOptions
from psdmc.backends.protocol import functions_of
from psdmc.program.kernel import Kernel
from psdmc.program.signature import Signature, Sizes
from psdmc.robot.mechanism import BASE_FRAME


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


def function_views(
    kernels: Mapping[str, Kernel],
    sizes: Sizes,
    robot: str,
    options: EmitOptions,
    base_frame: str = BASE_FRAME,
) -> tuple[FunctionView, ...]:
    """Return the functions to which the given kernels (variants of generated functions) belong, in the order of the
    function list. `base_frame` is the name of the base frame in the descriptions of the functions."""
    views = []
    for found in functions_of(kernels, base_frame):
        function = found.signature
        shown = tuple(make_kernel_view(kernel, sizes, robot, options) for kernel in found.kernels)
        shape = _shape(function, sizes_of(found.kernels[0], sizes))
        views.append(FunctionView(function.name, found.meaning, shape, function, shown))
    return tuple(views)


def _shape(function: Signature, sizes: Sizes) -> str:
    numbers = [f"{q.name} is a number" for q in function.inputs if not q.axes]
    told = [q for q in function.inputs if len(q.axes) > 1] + list(function.outputs)
    return "; ".join([*numbers, *(f"{q.name} is {_lengths(sizes.shape(q.axes))}" for q in told)])


def _lengths(shape: tuple[int, ...]) -> str:
    if not shape:
        return "1"
    return str(shape[0]) if len(shape) == 1 else f"{' x '.join(map(str, shape))}, row-major"
