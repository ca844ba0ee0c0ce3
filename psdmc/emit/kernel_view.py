"""Kernels as the templates see them: names, sizes and bodies, everything decided."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from psdmc.emit.body import Body, make_body
from psdmc.emit.options import EmitOptions
from psdmc.emit.prototypes import AT_RUN_TIME, BAKED, Prototype, Variant, prototype
from psdmc.emit.store_groups import GROUP
from psdmc.errors import InternalError
from psdmc.program.cost import Cost, cost
from psdmc.program.functions import BY_NAME, FUNCTIONS, Function
from psdmc.program.kernel import Kernel
from psdmc.program.program import Program


@dataclass(frozen=True, slots=True)
class VectorView:
    """A vector of a signature, `size` reals per state (a uniform one: the same for all states)."""

    name: str
    size: int


@dataclass(frozen=True, slots=True)
class KernelView:
    """One kernel: the file(s) that hold its body, its C functions and their signatures.

    single_file  body file, included once per instantiation; lanes_file, too, where one order serves both
    pivot_order  joints in the order in which their pivots are found, empty where there are none
    direct       a batch call writes its rows straight from registers, without a block of them on the stack
    """

    name: str
    meaning: str
    theta: bool
    inputs: tuple[VectorView, ...]
    output: VectorView
    prototypes: Mapping[str, Prototype]
    single_file: str
    lanes_file: str
    single_body: Body
    lanes_body: Body
    pivot_order: tuple[int, ...]
    direct: bool
    cost: Cost
    lowering: str

    @property
    def needs_lanes(self) -> bool:
        """Whether anything calls the form that leaves its output lane by lane."""
        return not self.direct or "batch_soa" in self.prototypes

    @property
    def lanes(self) -> str:
        """The static function that computes one state per lane."""
        return f"{self.name}_lanes"

    @property
    def lanes_signature(self) -> str:
        return self._signature(f"real *{self.output.name}")

    @property
    def rows(self) -> str:
        """The static function that computes one state per lane and writes its output into rows."""
        return f"{self.name}_rows"

    @property
    def rows_signature(self) -> str:
        return self._signature(f"real *const *{self.output.name}_row")

    def _signature(self, output: str) -> str:
        names = [f"const real *{vector.name}" for vector in self.inputs]
        names += ["const real *theta_b"] if self.theta else []
        names += [output]
        names += ["real *pivot"] if self.pivot_order else []
        return ", ".join(names)

    @property
    def lanes_arguments(self) -> str:
        return self._arguments(f"{self.output.name}_block + lane")

    @property
    def rows_arguments(self) -> str:
        return self._arguments(f"{self.output.name}_row + lane")

    def _arguments(self, output: str) -> str:
        names = [f"{vector.name}_block + lane" for vector in self.inputs]
        names += ["theta_b"] if self.theta else []
        names += [output]
        names += ["pivot_block + lane"] if self.pivot_order else []
        return ", ".join(names)

    @property
    def cost_text(self) -> str:
        """Operations of one state, as the header states them."""
        return f"{self.name}: {self.cost}, {self.lowering}"

    @property
    def blocks(self) -> tuple[VectorView, ...]:
        """Buffers of a batch call: every vector lane by lane."""
        pivots = (VectorView("pivot", self.inputs[0].size),) if self.pivot_order else ()
        output = () if self.direct else (self.output,)
        return (*self.inputs, *output, *pivots)


@dataclass(frozen=True, slots=True)
class FunctionView:
    """A function with its kernels, baked first: one C file.

    shape  of the output, in words
    """

    name: str
    meaning: str
    shape: str
    kernels: tuple[KernelView, ...]

    @property
    def has_pivots(self) -> bool:
        return any(kernel.pivot_order for kernel in self.kernels)

    @property
    def needs_parameters(self) -> bool:
        return BY_NAME[self.name].theta


def function_views(
    kernels: Mapping[str, Kernel], n: int, l: int, robot: str, options: EmitOptions
) -> tuple[FunctionView, ...]:
    """The functions that `kernels` hold, in the order of FUNCTIONS, whatever the mapping's order."""
    known = {name for f in FUNCTIONS for name in (f.name, f"{f.name}_theta")}
    unknown = [name for name, kernel in kernels.items() if name not in known or name != kernel.name]
    if unknown:
        raise InternalError(f"kernel {unknown[0]!r} is filed under a name that is not its own")
    views = []
    for function in FUNCTIONS:
        own = [kernels[name] for name in (function.name, f"{function.name}_theta") if name in kernels]
        if own:
            shown = tuple(kernel_view(kernel, n, l, robot, options) for kernel in own)
            views.append(FunctionView(function.name, function.meaning, _shape(function, n, l), shown))
    return tuple(views)


def kernel_view(kernel: Kernel, n: int, l: int, robot: str, options: EmitOptions) -> KernelView:
    function = kernel.function
    single_body = _body(kernel, kernel.single, n, l, options)
    lanes_body = _body(kernel, kernel.batch, n, l, options)
    shared = single_body == lanes_body
    return KernelView(
        name=kernel.name,
        meaning=function.meaning,
        theta=kernel.theta,
        inputs=tuple(VectorView(name, n) for name in function.inputs),
        output=VectorView(function.output, function.size(n, l)),
        prototypes=_prototypes(function, kernel.theta, robot, options.c_real),
        single_file=f"{kernel.name}.inc",
        lanes_file=f"{kernel.name}.inc" if shared else f"{kernel.name}_lanes.inc",
        single_body=single_body,
        lanes_body=lanes_body,
        pivot_order=tuple(slot.index for slot, _ in kernel.single.outputs if slot.vector == "pivot"),
        direct=_is_direct(function, n, l),
        cost=cost(kernel.single),
        lowering=kernel.lowering,
    )


def _shape(function: Function, n: int, l: int) -> str:
    lengths = {"n": n, "l": l, "6": 6, "1": 1}
    rows, columns = lengths[function.rows], lengths[function.columns]
    size = str(rows) if function.columns == "1" else f"{rows} x {columns}, row-major"
    return f"{function.output} is {size}"


def _body(kernel: Kernel, program: Program, n: int, l: int, options: EmitOptions) -> Body:
    """Large outputs are stored as they are found: keeping them all until the end would spill them first."""
    function = kernel.function
    inputs = (*function.inputs, *(("theta_b",) if kernel.theta else ()))
    sizes = {function.output: function.size(n, l)}
    suffix = "" if options.real == "float64" else "f"
    is_matrix = function.columns != "1"
    return make_body(program, inputs, sizes, suffix, is_matrix, _is_direct(function, n, l))


def _is_direct(function: Function, n: int, l: int) -> bool:
    return function.columns != "1" and function.size(n, l) >= GROUP


def _prototypes(function: Function, theta: bool, robot: str, real: str) -> dict[str, Prototype]:
    variants: tuple[Variant, ...] = AT_RUN_TIME if theta else BAKED
    names = ("single", "batch", "batch_soa")
    made = [prototype(function, variant, robot, real) for variant in variants]
    return dict(zip(names, made, strict=False))
