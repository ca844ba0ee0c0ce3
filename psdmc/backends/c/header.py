"""Describes the contents of a C package's headers, besides the functions, as data for the templates.

They are a description of the robot, constant tables with sparsity patterns, and the C++17 classes that wrap the C
functions."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from textwrap import wrap

from psdmc.backends.c.expressions import number, rounded_out
from psdmc.backends.c.kernel_view import FunctionView, KernelView, Prototype
from psdmc.backends.c.render import c_string
from psdmc.backends.describe import axis_lines, facts
from psdmc.backends.info import EmitOptions, PackageInfo
from psdmc.program.kernel import THETA_ROWS
from psdmc.program.signature import Signature
from psdmc.target.target import Target

# The description in the first lines of the C header


WIDTH = 116
"""Characters of a line in the header."""


def description(
    info: PackageInfo, options: EmitOptions, functions: Sequence[FunctionView], with_frames: bool
) -> tuple[str, ...]:
    """Return the text at the top of the C header, as lines. It gives the facts of the robot, the layout of arrays, and
    the variants of functions (such as for many states). Names from the robot file are not escaped yet."""
    lines = [*facts(info, options), *_friction(info, functions), *_array_lines(info), *_forms(options.target)]
    if any(function.name.endswith(THETA_ROWS) for function in functions):
        lines += [
            f"  _theta_rows with one theta_b per state: thetas is an input like q, a state has l = {info.l} reals of it"
        ]
    if any(len(function.signature.outputs) > 1 for function in functions):
        lines += ["Several outputs of one call must not overlap each other."]
    lines += [line for function in functions for line in _failure(function.signature, options.target)]
    return (*lines, *axis_lines(info, (function.signature for function in functions), with_frames))


def _friction(info: PackageInfo, functions: Sequence[FunctionView]) -> tuple[str, ...]:
    """The friction that motor torques contain, with its values, and which functions contain it."""
    law = info.in_dynamics
    if law is None:
        return ()
    names: dict[bool, list[str]] = {True: [], False: []}
    for function in functions:
        names[function.signature.has_motor_torques].append(function.name)
    headings = [name for term in law.terms for name in term.names]
    of_one_rate = (joint.name for joint in info.joints if joint.nv == 1)  # the joints that have friction
    return (
        "Friction in the dynamics: tau are the torques of the motors, M(q) qdd + h(q, qd) + friction (N m; N if sliding).",
        "Friction is positive where the motor must push in the positive direction. Friction that brakes has the",
        f"sign of the joint's rate v (rad/s; m/s if sliding). With s = tanh(v / {law.sign_speed!r}), a smooth sign, it is",
        f"  {law.formula}",
        f"Values per joint ({', '.join(headings)}):",
        *(
            f"  {joint}: {', '.join(f'{x:.9g}' for x in values)}"
            for joint, values in zip(of_one_rate, law.values.tolist(), strict=True)
        ),
        *wrap(f"Functions with friction: {', '.join(names[True]) or 'none'}.", WIDTH, subsequent_indent="  "),
        *wrap(
            f"Functions without friction: {', '.join(names[False]) or 'none'}.", WIDTH, subsequent_indent="  "
        ),
        *(
            (f"The calibration also found what tau does not have: {'; '.join(law.beyond)}.",)
            if law.beyond
            else ()
        ),
        "",
    )


def _array_lines(info: PackageInfo) -> tuple[str, ...]:
    """Lengths of vectors."""
    if not info.is_wide:
        return (
            "Arrays: n reals per vector; matrices row-major. Inputs may overlap each other. An output may overlap any",
        )
    return (
        f"Arrays: q has NQ = {info.nq} reals, rates and torques have NV = {info.nv} each; matrices row-major. Quaternions,",
        "and cosine and sine of an angle, are of length one: only integrate sees to it, in others one that is off by more",
        "than 1e-6 gives results that are off, too. Where something is added to q it is integrate that adds. Inputs may",
        "overlap each other. An output may overlap any",
    )


def _forms(target: Target) -> tuple[str, ...]:
    """Return lines that say what a call may overlap, and what the variants' names mean."""
    if not target.has_batches:
        return ("input.", "  _theta      with the base parameters theta_b given at run time")
    return (
        "input of a call for one state. In a batch it may be the very array of an input whose rows are equally long,",
        "and must not overlap an input (theta_b is one) in any other way.",
        "  _batch      one state per row",
        "  _batch_soa  blocks of LANES states, [block][variable][lane]; the last block is whole, too",
        "  _theta      with the base parameters theta_b given at run time (_theta_batch: one theta_b for all rows)",
    )


def _failure(function: Signature, target: Target) -> tuple[str, ...]:
    if not function.factorises:
        return ()
    status = f"{function.name} returns 0, or 1 + {', or 1 + '.join(function.pivot_numbers)}."
    if not target.has_batches:
        return (status, f"The {function.spoilt} of such a state are NaN.")
    return (
        status,
        f"A batch returns 0, or 1 + the first row that fails. The {function.spoilt} of such a state are NaN.",
    )


# Constant tables: joint names and limits, gravity, base parameters


@dataclass(frozen=True, slots=True)
class Table:
    """One constant array in C that is also a constexpr member of the C++ class.

    name         without the robot's prefix
    declaration  in C, without `extern`
    entries      values as C text
    cpp_type     element type and length in C++, such as 'Real, dof'
    cpp_entries  values as C++ text
    is_text      whether the entries are strings
    """

    name: str
    declaration: str
    entries: tuple[str, ...]
    cpp_type: str
    cpp_entries: tuple[str, ...]
    is_text: bool = False


def tables(
    info: PackageInfo, robot: str, real: str, with_frames: bool = False, with_texts: bool = True
) -> tuple[Table, ...]:
    """Return all constant tables of a package, in the order of the C header. Tables of strings, such as joint names,
    are left out if `with_texts` is false (small machines)."""
    lengths = {"dof": f"{robot}_DOF", "base_parameters": f"{robot}_BASE_PARAMETERS", "3": "3"}
    lengths |= {"frames": f"{robot}_FRAMES", "joints": f"{robot}_JOINTS"}

    def numbers(name: str, length: str, values: Iterable[float | None]) -> Table:
        kept = tuple(values)
        entries = tuple(number(value, real) for value in kept)
        cpp_entries = tuple(_cpp_number(value, real) for value in kept)
        declaration = f"const {real} {robot}_{name}[{lengths[length]}]"
        return Table(name, declaration, entries, f"Real, {length}", cpp_entries)

    def texts(name: str, length: str, values: Iterable[str]) -> Table:
        entries = tuple(map(c_string, values))
        declaration = f"const char *const {robot}_{name}[{lengths[length]}]"
        return Table(name, declaration, entries, f"const char *, {length}", entries, is_text=True)

    joints, parameters = info.joints, info.parameters
    frames = (texts("frame_names", "frames", info.frames),) if with_frames else ()
    each = "joints" if info.is_wide else "dof"
    every = (
        texts("joint_names", each, (joint.name for joint in joints)),
        texts("joint_units", each, (joint.unit for joint in joints)),
        numbers("position_lower", each, (joint.lower for joint in joints)),
        numbers("position_upper", each, (joint.upper for joint in joints)),
        numbers("speed_limit", each, (joint.speed for joint in joints)),
        numbers("acceleration_limit", each, (joint.acceleration for joint in joints)),
        numbers("effort_limit", each, (joint.effort for joint in joints)),
        numbers("gravity_acceleration", "3", info.gravity),
        numbers("theta_b", "base_parameters", (parameter.value for parameter in parameters)),
        texts("base_parameter_equations", "base_parameters", (p.equation for p in parameters)),
        texts("base_parameter_units", "base_parameters", (p.unit for p in parameters)),
        *frames,
    )
    return every if with_texts else tuple(table for table in every if not table.is_text)


def _cpp_number(value: float | None, real: str) -> str:
    """A real constant in C++, where C's macros would be old-style casts."""
    if value is None or math.isnan(value):
        return "std::numeric_limits<Real>::quiet_NaN()"
    value = rounded_out(value, real)
    if math.isinf(value):
        return f"{'-' if value < 0 else ''}std::numeric_limits<Real>::infinity()"
    return number(value, real)


# Sparsity patterns of matrices
#
# They say which entries can differ from zero. In a tree robot, the entries of two joints on different
# branches are zero.


@dataclass(frozen=True, slots=True)
class Pattern:
    """The entries of a function's output matrix that may differ from zero at some state, row by row.

    function   name of the function, which has no other output
    places     (row, column) of each entry
    is_packed  whether the function stores these entries only, one after the other
    is_sparse  whether the matrix has further entries, which are zero at every state
    """

    function: str
    places: tuple[tuple[int, int], ...]
    is_packed: bool
    is_sparse: bool

    @property
    def macro(self) -> str:
        """Return the name of the C macro for the number of entries that may differ from zero, without the prefix."""
        return f"{self.function.upper()}_NONZEROS"

    def table(self, robot: str) -> Table:
        """Return the (row, column) pairs of the nonzero entries as a constant array."""
        name = f"{self.function}_pattern"
        return Table(
            name,
            f"const unsigned short {robot}_{name}[{robot}_{self.macro}][2]",
            tuple(f"{{{row}, {column}}}" for row, column in self.places),
            f"std::array<unsigned short, 2>, {self.macro.lower()}",
            tuple(f"{{{{{row}, {column}}}}}" for row, column in self.places),
        )


def patterns(functions: Sequence[FunctionView]) -> Iterator[Pattern]:
    """Yield the sparsity pattern (positions of nonzero entries) of every function whose only output is a matrix. The
    matrix may be stored with or without its zeros.

    In a matrix that is stored with zeros, an entry counts as zero if it is zero at every state. This must hold in all
    variants of the function, with compiled-in base parameters and with theta_b as an input.
    """
    for function in functions:
        if function.kernels[0].places:
            yield Pattern(function.name, function.kernels[0].places, is_packed=True, is_sparse=True)
            continue
        outputs = [kernel.outputs for kernel in function.kernels]
        if len(outputs[0]) != 1 or len(outputs[0][0].shape) != 2:
            continue
        rows, columns = outputs[0][0].shape
        zero = set.intersection(*(set(of_kernel.zero) for (of_kernel,) in outputs))
        kept = (k for k in range(rows * columns) if k not in zero)
        places = tuple(divmod(k, columns) for k in kept)
        yield Pattern(function.name, places, is_packed=False, is_sparse=bool(zero))


# The C++ classes: their members, and how each member calls C


@dataclass(frozen=True, slots=True)
class CppMethod:
    """One member function of the C++ class, which takes raw pointers.

    parameters  C++ text of the parameters
    call        C++ text of the call of the C function; if the C function takes theta_b, that of the class is passed
    """

    name: str
    returns: str
    parameters: str
    call: str

    @property
    def can_fail(self) -> bool:
        return self.returns != "void"


@dataclass(frozen=True, slots=True)
class CppArrayMethod:
    """A member function that takes and returns std::array.

    output  the output that is returned, of type result_type; '' if all outputs are parameters. Outputs are parameters
            if there are several, or if the C function returns a status
    called  name of the member that it calls; with the name of the class if a parameter has the member's name
    """

    name: str
    returns: str
    parameters: str
    arguments: str
    result_type: str
    output: str
    called: str


@dataclass(frozen=True, slots=True)
class CppClass:
    """One C++ class with generated functions as members. There are three classes: for functions without base
    parameters, for the base parameters of the robot file, and for base parameters that the user passes.

    theta  whether the class stores theta_b, the base parameters of the user
    """

    name: str
    theta: bool
    methods: tuple[CppMethod, ...]
    array_methods: tuple[CppArrayMethod, ...]

    @property
    def qualifier(self) -> str:
        """Qualifier before a member function."""
        return "" if self.theta else "static "

    @property
    def suffix(self) -> str:
        """Text after a member function's parameters."""
        return " const noexcept" if self.theta else " noexcept"


def cpp_classes(functions: Iterable[FunctionView], n: int) -> tuple[CppClass, CppClass, CppClass]:
    """Description, Robot and RobotWithParameters, in this order."""
    shown = tuple(functions)
    free = [f.kernels[0] for f in shown if not f.needs_parameters]
    own = [k for f in shown if f.needs_parameters for k in f.kernels if not k.theta]
    given = [k for f in shown if f.needs_parameters for k in f.kernels if k.theta]
    return (
        _class("Description", free, n),
        _class("Robot", own, n),
        _class("RobotWithParameters", given, n, theta=True),
    )


def _class(name: str, kernels: list[KernelView], n: int, theta: bool = False) -> CppClass:
    methods = [_method(k, p) for k in kernels for p in k.prototypes.values()]
    return CppClass(name, theta, tuple(methods), tuple(_array_method(k, n, name) for k in kernels))


def _method(kernel: KernelView, prototype: Prototype) -> CppMethod:
    words = [argument.rpartition(" ") for argument in prototype.arguments]
    names = [name.lstrip("*") for _, _, name in words]
    taken = [
        f"{_cpp_type(kind)} {name}"
        for (kind, _, name), bare in zip(words, names, strict=True)
        if bare != "theta_b"
    ]
    passed = ["theta_.data()" if name == "theta_b" else name for name in names]
    variant = next(key for key, value in kernel.prototypes.items() if value is prototype)
    suffix = "" if variant == "single" else f"_{variant}"
    return CppMethod(
        name=f"{kernel.name.removesuffix('_theta')}{suffix}",
        returns="std::size_t" if prototype.returns == "size_t" else prototype.returns,
        parameters=", ".join(taken),
        call=f"::{prototype.symbol}({', '.join(passed)})",
    )


def _cpp_type(kind: str) -> str:
    return {"size_t": "std::size_t", "const double": "const Real", "const float": "const Real"}.get(
        kind, "Real"
    )


def _array_method(kernel: KernelView, n: int, owner: str) -> CppArrayMethod:
    """The member function for one state; several results, or one with a status, are written to the last parameters."""
    inputs = [f"const {_std_array(vector.size, n)} &{vector.name}" for vector in kernel.inputs]
    outputs = [f"{_std_array(output.size)} &{output.name}" for output in kernel.outputs]
    status = "int" if kernel.positive else "void"
    returned = kernel.outputs[0] if status == "void" and len(outputs) == 1 else None
    result = _std_array(returned.size) if returned else ""
    name = kernel.name.removesuffix("_theta")
    is_hidden = name in (vector.name for vector in kernel.inputs)
    return CppArrayMethod(
        name=name,
        returns=result or status,
        parameters=", ".join(inputs if returned else [*inputs, *outputs]),
        arguments=", ".join(f"{vector.name}.data()" for vector in (*kernel.inputs, *kernel.outputs)),
        result_type=result,
        output=returned.name if returned else "",
        called=f"{owner}::{name}" if is_hidden else name,
    )


def _std_array(size: int, n: int | None = None) -> str:
    return "Vector" if size == n else f"std::array<Real, {size}>"
