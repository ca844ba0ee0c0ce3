"""Kernels in the form that templates print: names, sizes and bodies, with all decisions made."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

from psdmc.emit.body import make_body
from psdmc.emit.limbs import LimbsView, limbs_view
from psdmc.emit.lines import Body
from psdmc.emit.options import EmitOptions
from psdmc.emit.parts import body_in_parts, is_long
from psdmc.emit.products import Multiplication
from psdmc.emit.prototypes import AT_RUN_TIME, BAKED, Prototype, Variant, prototype
from psdmc.emit.store_groups import GROUP
from psdmc.errors import InternalError
from psdmc.program.cost import Cost, cost
from psdmc.program.kernel import Kernel
from psdmc.program.products import LARGE
from psdmc.program.program import Program
from psdmc.program.signature import Quantity, Signature, Sizes, in_order

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
    cost: Cost
    lowering: str
    limbs: LimbsView | None = None

    @property
    def pivots_in_loop(self) -> bool:
        """Whether one state's pivots are looked at in a loop."""
        return len(self.pivot_order) >= LOOPED and self.pivot_order == tuple(range(len(self.pivot_order)))

    @property
    def called(self) -> str:
        """Name of the kernel that its stages call, '' where it has a body."""
        return f"{self.function.calls}{'_theta' if self.theta else ''}" if self.function.calls else ""

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
        sizes = {output.size for output in self.outputs}
        return self.positive is not None and len(self.outputs) == 1 and sizes == {self.positive.size}

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


@dataclass(frozen=True, slots=True)
class FunctionView:
    """A function with its kernels, baked first.

    shape  of its outputs, and of inputs that are no vectors of all joints, in words
    """

    name: str
    meaning: str
    shape: str
    signature: Signature
    kernels: tuple[KernelView, ...]

    @property
    def has_pivots(self) -> bool:
        return any(kernel.pivot_order for kernel in self.kernels)

    @property
    def products(self) -> tuple[Multiplication, ...]:
        """Those of all kernels."""
        return tuple(p for kernel in self.kernels for p in kernel.single_body.products)

    @property
    def limbs(self) -> tuple[int, ...]:
        """Numbers of limbs in lanes, over all kernels."""
        return tuple(
            sorted({count for kernel in self.kernels if kernel.limbs for count in kernel.limbs.counts})
        )

    @property
    def units(self) -> tuple[FunctionView, ...]:
        """One for each C file, which has its name: the whole function, or a kernel each where bodies are in parts."""
        if not any(kernel.single_body.parts or kernel.lanes_body.parts for kernel in self.kernels):
            return (self,)
        return tuple(replace(self, name=kernel.name, kernels=(kernel,)) for kernel in self.kernels)

    @property
    def needs_parameters(self) -> bool:
        return self.signature.theta


def function_views(
    kernels: Mapping[str, Kernel], sizes: Sizes, robot: str, options: EmitOptions
) -> tuple[FunctionView, ...]:
    """The functions that `kernels` hold, in the order of their signatures, whatever the mapping's order."""
    wrong = [name for name, kernel in kernels.items() if name != kernel.name]
    if wrong:
        raise InternalError(f"kernel {wrong[0]!r} is filed under a name that is not its own")
    functions = {kernel.function.name: kernel.function for kernel in kernels.values()}
    views = []
    for function in in_order(tuple(functions.values())):
        own = [kernels[name] for name in (function.name, f"{function.name}_theta") if name in kernels]
        shown = tuple(kernel_view(kernel, sizes, robot, options) for kernel in own)
        views.append(FunctionView(function.name, function.meaning, _shape(function, sizes), function, shown))
    return tuple(views)


def kernel_view(kernel: Kernel, sizes: Sizes, robot: str, options: EmitOptions) -> KernelView:
    function = _checked(kernel.function)
    has_lanes = options.target.has_batches and not _is_by_state(kernel, sizes)
    outputs = tuple(
        OutputView(
            q.name,
            sizes.size(q),
            sizes.shape(q.axes),
            has_lanes and not function.calls and _is_direct(q, sizes),
            _zero(q, kernel.single, sizes),
        )
        for q in function.outputs
    )
    if function.calls:
        single_body = lanes_body = Body((), ())
    else:
        single_body, lanes_body = _bodies(kernel, outputs, options, has_lanes)
    shared = single_body == lanes_body
    positive = _vector(function.positive.quantity, sizes) if function.positive else None
    return KernelView(
        name=kernel.name,
        function=function,
        theta=kernel.theta,
        inputs=tuple(_vector(q, sizes) for q in function.inputs),
        outputs=outputs,
        positive=positive,
        prototypes=_prototypes(function, kernel.theta, robot, options),
        single_file=f"{kernel.name}.inc",
        lanes_file=f"{kernel.name}.inc" if shared else f"{kernel.name}_lanes.inc",
        single_body=single_body,
        lanes_body=lanes_body,
        pivot_order=tuple(
            slot.index for slot, _ in kernel.single.outputs if positive and slot.vector == positive.name
        ),
        cost=cost(kernel.single),
        lowering=kernel.lowering,
        limbs=_limbs(kernel, sizes, options),
    )


def _limbs(kernel: Kernel, sizes: Sizes, options: EmitOptions) -> LimbsView | None:
    if kernel.limbs is None or not options.target.vectors:
        return None
    return limbs_view(kernel.name, kernel.limbs, kernel.inputs, kernel.function.sizes(sizes), options)


def _is_by_state(kernel: Kernel, sizes: Sizes) -> bool:
    return kernel.before is not None and sizes.nv >= LARGE


def _bodies(
    kernel: Kernel, outputs: tuple[OutputView, ...], options: EmitOptions, has_lanes: bool
) -> tuple[Body, Body]:
    """For one state and for lanes."""
    one, lanes = kernel.before or kernel.single, kernel.before or kernel.batch
    single = _body(kernel, one, outputs, options, has_lanes)
    if not has_lanes or lanes is one:
        return single, single
    return single, _body(kernel, lanes, outputs, options, has_lanes)


TAKEN = {
    *(
        "V",
        "LOAD",
        "STORE",
        "STORE_GROUP",
        "STORE_BLOCK",
        "KEEP",
        "NAME",
        "SPLAT",
        "SINCOS",
        "SQRT",
        "LANES",
        "WIDTH",
        "real",
        "lanes",
        "angles",
    ),
    *("DIRECT", "KEEP_DIRECT", "STORE_ZEROS", "PART", "NOT_INLINE", "kept", "kept_reals", "zero"),
    *("theta_b", "count", "block", "blocks", "lane", "first", "row", "rows", "failed", "bad", "two", "four"),
}
"""Names that mean something else in the emitted C where a quantity's name would stand."""


def _checked(function: Signature) -> Signature:
    """The function's signature; InternalError where a quantity's name means something else in the emitted C."""
    names = [quantity.name for quantity in (*function.inputs, *function.stored)]
    for name in (*names, *(product.right for product in function.products)):
        if name in TAKEN:
            raise InternalError(f"{function.name}: C takes {name!r} for something else")
    return function


def _vector(quantity: Quantity, sizes: Sizes) -> VectorView:
    return VectorView(quantity.name, sizes.size(quantity), sizes.shape(quantity.axes))


def _shape(function: Signature, sizes: Sizes) -> str:
    numbers = [f"{q.name} is a number" for q in function.inputs if not q.axes]
    told = [q for q in function.inputs if len(q.axes) > 1] + list(function.outputs)
    return "; ".join([*numbers, *(f"{q.name} is {_lengths(sizes.shape(q.axes))}" for q in told)])


def _lengths(shape: tuple[int, ...]) -> str:
    if not shape:
        return "1"
    return str(shape[0]) if len(shape) == 1 else f"{' x '.join(map(str, shape))}, row-major"


def _body(
    kernel: Kernel, program: Program, outputs: tuple[OutputView, ...], options: EmitOptions, has_lanes: bool
) -> Body:
    """The body. Large outputs are stored as they are computed, as keeping them all until the end would spill them."""
    sizes = {output.name: output.size for output in outputs}
    suffix = "" if options.real == "float64" else "f"
    has_matrix = any(len(output.shape) > 1 for output in outputs)
    direct = tuple(output.name for output in outputs if output.direct)
    products = kernel.function.products if kernel.before else ()
    in_lines = bool(products) and has_lanes  # lanes' products take values from the lines before them
    make = body_in_parts if is_long(program, sizes) and not in_lines else make_body
    return make(program, kernel.inputs, sizes, suffix, has_matrix, direct, products)


def _zero(output: Quantity, program: Program, sizes: Sizes) -> tuple[int, ...]:
    """Entries that the PROGRAM does not store, or stores as the constant zero."""
    values = {slot.index: program.body[i].value for slot, i in program.outputs if slot.vector == output.name}
    return tuple(index for index in range(sizes.size(output)) if values.get(index, 0.0) == 0.0)


def _is_direct(output: Quantity, sizes: Sizes) -> bool:
    return len(output.axes) > 1 and sizes.size(output) >= GROUP


def _prototypes(function: Signature, theta: bool, robot: str, options: EmitOptions) -> dict[str, Prototype]:
    """Prototypes by form, for the forms that the target has."""
    variants: tuple[Variant, ...] = AT_RUN_TIME if theta else BAKED
    made = (prototype(function, variant, robot, options.c_real) for variant in variants)
    return dict(zip(options.target.forms, made, strict=False))
