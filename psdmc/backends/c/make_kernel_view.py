"""Decides how the C code of one kernel (one variant of a generated function) is written. The decisions are which
outputs need no intermediate block, which files hold the code, and which C functions exist."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import replace

from psdmc.backends.c.body import (
    calls_of,
    make_body,
    regions_view,
    sections_of,
    unread,
    without_products,
    zero_outputs,
)
from psdmc.backends.c.expressions import c_real, is_call, suffix_of, uniform_of
from psdmc.backends.c.kernel_view import (
    FunctionView,
    KernelView,
    OutputView,
    Prototype,
    VectorView,
)
from psdmc.backends.c.limbs import limbs_view
from psdmc.backends.c.lines import (
    GROUP,
    KEPT,
    KEPT_REALS,
    Body,
    Entry,
    GroupStore,
    Multiplication,
    Part,
    Store,
    Zeros,
    multiplication,
)
from psdmc.backends.info import EmitOptions
from psdmc.backends.protocol import functions_of
from psdmc.errors import InternalError
from psdmc.program.cost import cost
from psdmc.program.kernel import Kernel
from psdmc.program.parts import in_parts
from psdmc.program.products import LARGE, Product
from psdmc.program.program import Instr, Op, Program, Slot
from psdmc.program.signature import Quantity, Signature, Sizes


def make_kernel_view(kernel: Kernel, sizes: Sizes, robot: str, options: EmitOptions) -> KernelView:
    """Return one kernel (one variant of a generated function) as data for the templates. Raises InternalError if the C
    code itself uses a name of an input or output.

    robot  identifier with which the names of the C functions begin
    """
    function, sizes = _checked(kernel.function), sizes_of(kernel, sizes)
    is_by_state = kernel.before is not None and sizes.nv >= LARGE
    has_lanes = options.target.has_batches and not is_by_state
    results = {q.name: sizes.size(q) for q in function.outputs}
    zero = {} if kernel.is_loop_of_calls else zero_outputs(kernel.single, results)
    outputs = tuple(
        OutputView(
            q.name,
            results[q.name],
            sizes.shape(q.axes),
            has_lanes and kernel.regions is None and q.is_matrix and results[q.name] >= GROUP,
            tuple(zero.get(q.name, ())),
        )
        for q in function.outputs
    )
    regions = None
    if kernel.regions is not None:
        single_body = lanes_body = Body((), ())
        lengths = {q.name: sizes.size(q) for q in function.inputs}
        lengths |= dict.fromkeys(kernel.inputs[len(lengths) :], sizes.l)
        regions = regions_view(kernel.regions, lengths, list(results), robot, suffix_of(c_real(options)))
    else:
        single_body, lanes_body = _bodies(kernel, outputs, options, has_lanes)
    shared = single_body == lanes_body
    positive = _vector(function.pivots, sizes) if function.pivots else None
    limbs = None
    if kernel.limbs is not None and options.target.vectors:
        limbs = limbs_view(kernel.name, kernel.limbs, kernel.inputs, function.sizes(sizes), options)
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
        cost=f"calls of {' and '.join(function.calls)}"
        if kernel.is_loop_of_calls
        else str(cost(kernel.single)),
        lowering=kernel.lowering,
        limbs=limbs,
        places=kernel.places,
        regions=regions,
    )


def function_views(
    kernels: Mapping[str, Kernel], sizes: Sizes, robot: str, options: EmitOptions, base_frame: str
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


def undeclared(kernel: Kernel, sizes: Sizes, robot: str, options: EmitOptions) -> FunctionView:
    """Return a kernel as a function without further variants, which no header declares."""
    made = make_kernel_view(kernel, sizes, robot, options)
    return FunctionView(made.name, kernel.function.meaning, "", kernel.function, (made,))


def _shape(function: Signature, sizes: Sizes) -> str:
    numbers = [f"{q.name} is a number" for q in function.inputs if not q.axes]
    told = [q for q in function.inputs if len(q.axes) > 1] + list(function.outputs)
    return "; ".join([*numbers, *(f"{q.name} is {_lengths(sizes.shape(q.axes))}" for q in told)])


def _lengths(shape: tuple[int, ...]) -> str:
    if not shape:
        return "1"
    return str(shape[0]) if len(shape) == 1 else f"{' x '.join(map(str, shape))}, row-major"


def sizes_of(kernel: Kernel, sizes: Sizes) -> Sizes:
    """Return the sizes of the robot for one kernel (one variant of a generated function). If the kernel stores a matrix
    without zeros, the number of stored entries is included."""
    return replace(sizes, nonzeros=len(kernel.places))


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
        *(op.upper() for op in Op if is_call(op)),
        "LANES",
        "WIDTH",
        "real",
        "lanes",
        "angles",
    ),
    *("DIRECT", "KEEP_DIRECT", "STORE_ZEROS", "PART", "NOT_INLINE", "kept", "kept_reals", "zero"),
    *("STORE_ZERO", "CLEAR", "cleared"),
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


def _body(
    kernel: Kernel, program: Program, outputs: tuple[OutputView, ...], options: EmitOptions, has_lanes: bool
) -> Body:
    """The body. Large outputs are stored as they are computed, as keeping them all until the end would spill them."""
    sizes = {output.name: output.size for output in outputs}
    suffix = suffix_of(c_real(options))
    has_matrix = any(output.is_matrix for output in kernel.function.outputs)
    direct = tuple(output.name for output in outputs if output.direct)
    products = kernel.function.products if kernel.before else ()
    in_lines = bool(products) and has_lanes  # lanes' products take values from the lines before them
    make = body_in_parts if is_long(program, sizes) and not in_lines else make_body
    return make(program, kernel.inputs, sizes, suffix, has_matrix, direct, products)


def _prototypes(function: Signature, theta: bool, robot: str, options: EmitOptions) -> dict[str, Prototype]:
    """Prototypes by form, for the forms that the target has. A function that can fail returns which entry failed (one
    state), or which row (many)."""
    real = c_real(options)
    inputs = [*(q.name for q in function.inputs), *(["theta_b"] if theta else [])]
    outputs = (f"{real} *{q.name}" for q in function.outputs)
    arrays = (*(f"const {real} *{name}" for name in inputs), *outputs)
    suffixes = ("_theta", "_theta_batch") if theta else ("", "_batch", "_batch_soa")
    found: dict[str, Prototype] = {}
    for form, suffix in zip(options.target.forms, suffixes, strict=False):
        count, status = ((), "int") if form == "single" else (("size_t count",), "size_t")
        returns = status if function.factorises else "void"
        found[form] = Prototype(returns, f"{robot}_{function.name}{suffix}", (*count, *arrays))
    return found


# Long functions in several C functions
#
# The compile time then grows nearly linearly with the length.


LONG = 4950
"""Operations and stores from which on a body is cut: shorter ones compile in seconds, and calls cost a little."""

PART = 800
"""Operations and stores of a part. GCC 12's time for a line, register allocation above all, grows from some 4,000 on."""

_UNIFORM = frozenset({"theta_b", KEPT_REALS})


def is_long(program: Program, sizes: Mapping[str, int]) -> bool:
    """Return whether a PROGRAM (the list of operations to generate) is so long that it is divided into several C
    functions. The length is the number of operations plus the number of output entries (`sizes` by vector)."""
    operations = sum(bool(instr.args) for instr in program)
    return operations + sum(sizes.values()) > LONG


def body_in_parts(
    program: Program,
    inputs: Sequence[str],
    sizes: Mapping[str, int],
    suffix: str,
    stores_early: bool,
    in_groups: Collection[str] = (),
    products: Sequence[Product] = (),
) -> Body:
    """Return the body of a C function for a long PROGRAM (the list of operations to generate). The body calls several
    functions, each of which computes a part. Loops set outputs to zero that are zero at every state.

    The arguments have the meaning of those of make_body.
    """
    multiplied = tuple(multiplication(program, product, sizes) for product in products)
    stored = without_products(sizes, multiplied)
    whole, zeros = _without_zeros(program, stored)
    kept_in = [KEPT_REALS if same else KEPT for same in uniform_of(whole)]
    groups = [group for vector in in_groups if vector in stored for group in _groups(vector, stored[vector])]
    cut = in_parts(whole, kept_in, groups, late=not stores_early, longest=PART)
    signature = dict.fromkeys((*inputs, *stored, *(slot.vector for slot, _ in whole.outputs)))
    names = (*signature, KEPT, KEPT_REALS)
    parts = []
    for number, part in enumerate(cut.programs):
        sections = sections_of(part, stored, suffix, True, in_groups, multiplied, _UNIFORM, with_zeros=False)
        if number == len(cut.programs) - 1:
            sections = (*sections[:-1], replace(sections[-1], steps=(*sections[-1].steps, *zeros)))
        read = {slot.vector for slot in part.inputs()}
        parts.append(_part(names, read, in_groups, multiplied, Body(sections, ())))
    kept = (f"{'V' if vector == KEPT else 'real'} {vector}[{length}]" for vector, length in cut.kept.items())
    return Body((), unread(program, inputs), multiplied, calls_of(program), tuple(parts), tuple(kept))


def _without_zeros(program: Program, sizes: Mapping[str, int]) -> tuple[Program, list[Zeros]]:
    """The PROGRAM storing every output, but for runs of groups that are always zero."""
    values = {slot: program.body[i].value for slot, i in program.outputs}
    runs = [run for vector, size in sizes.items() for run in _zero_runs(vector, size, values)]
    gone = {Slot(run.vector, run.first + k) for run in runs for k in range(run.count)}
    zero = len(program)
    outputs = [(slot, i) for slot, i in program.outputs if slot not in gone]
    taken = {slot for slot, _ in program.outputs} | gone
    wanted = (Slot(vector, k) for vector, size in sizes.items() for k in range(size))
    outputs += [(slot, zero) for slot in wanted if slot not in taken]
    return Program((*program.body, Instr(Op.CONST, value=0.0)), tuple(outputs)), runs


def _zero_runs(vector: str, size: int, values: Mapping[Slot, float | None]) -> Iterator[Zeros]:
    """Runs of two whole groups or more, apart from those that overlap the last one."""
    first, groups = 0, size // GROUP - (1 if size % GROUP else 0)
    for number in range(groups + 1):
        group = (Slot(vector, number * GROUP + k) for k in range(GROUP))
        if number < groups and all(values.get(slot, 0.0) == 0.0 for slot in group):
            continue
        if number > first + 1:
            yield Zeros(vector, first * GROUP, (number - first) * GROUP)
        first = number + 1


def _groups(vector: str, size: int) -> Iterator[list[Slot]]:
    """Outputs that are stored together; the last two groups overlap where the size is no multiple of four."""
    whole = size // GROUP - (1 if size % GROUP else 0)
    for number in range(whole):
        yield [Slot(vector, number * GROUP + k) for k in range(GROUP)]
    if size % GROUP:
        yield [Slot(vector, k) for k in range(whole * GROUP, size)]


def _part(
    names: Sequence[str],
    read: Collection[str],
    in_groups: Collection[str],
    products: Sequence[Multiplication],
    body: Body,
) -> Part:
    """A part's function: of the function's vectors, and those between parts, what it reads and writes."""
    lines = [line for section in body.sections for line in section.steps]
    written = {line.vector for line in lines if isinstance(line, Store | Zeros | GroupStore)}
    right = {line.matrix for line in lines if isinstance(line, Entry) and line.macro == "KEEP"}
    rows = {product.right: product.shape.n for product in products}
    own = tuple(name for name in names if name in {*read, *written, *right})

    def declared(name: str) -> str:
        if name in in_groups:
            return f"DIRECT({name})"
        if name in right:
            return f"real (*{name})[{rows[name]}]"
        return f"{'' if name in written else 'const '}{'V' if name == KEPT else 'real'} *{name}"

    direct = tuple(name for name in own if name in in_groups)
    return Part(tuple(declared(name) for name in own), own, direct, body)
