"""The back end that writes Rust crates. The crates have no dependencies, and allocate no memory; no code is unsafe."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Any, NamedTuple

from jinja2 import Environment

from psdmc.backends.describe import (
    axis_lines,
    facts,
    option_items,
    uses_contacts,
    uses_frames,
)
from psdmc.backends.info import PackageInfo
from psdmc.backends.manifest import manifest
from psdmc.backends.protocol import BackEnd, Emission, Function
from psdmc.backends.reference_states import compared_by_row, given_name, tolerance
from psdmc.backends.render import environment_with
from psdmc.backends.rust.body import (
    WRITTEN,
    array,
    comment,
    identifier,
    number,
    place,
    statements,
    string,
    variable,
)
from psdmc.backends.trig_numbers import NUMBERS
from psdmc.errors import InputError, InternalError
from psdmc.program.cost import cost
from psdmc.program.kernel import Kernel
from psdmc.program.signature import Quantity, Sizes

LOCAL = re.compile(r"t\d+|(sin|cos)_\d+|entry|fma|select|sqrt|sin_cos")
"""Names of a body's own; no quantity may have one."""

ARRAYS = """Arrays: matrices are arrays of rows. Quaternions, and cosine and sine of an angle, are of length one."""


class Constant(NamedTuple):
    """A constant with its documentation."""

    name: str
    value: Any
    meaning: str = ""

    @property
    def type(self) -> str:
        return _type(self.value)

    @property
    def text(self) -> str:
        return _literal(self.value)


class Check(NamedTuple):
    """The comparison of one output of a function in the self-test. It has the name of the output, the number of rows
    that are compared separately, the tolerance, and the call for state k. `values` are the expected values, or None if
    there are none."""

    name: str
    rows: int
    tolerance: str
    call: str
    values: Any


class KernelText(NamedTuple):
    """One Rust function. `pivots` is Rust text with pairs (number, value) of the pivots of a factorised matrix. The
    function tests in the order of the pairs that the pivots are positive."""

    name: str
    parameters: str
    returns: str
    cost: str
    lines: list[str]
    result: str
    pivots: str


class FunctionText(NamedTuple):
    """One file: a function and its forms."""

    function: Function
    shape: str
    kernels: tuple[KernelText, ...]


@dataclass(frozen=True, slots=True)
class CrateView:
    """One crate."""

    robot: str
    info: PackageInfo
    version: str
    description: tuple[str, ...]
    functions: tuple[FunctionText, ...]
    constants: tuple[Constant, ...]
    inputs: tuple[Constant, ...]
    checks: tuple[Check, ...]

    @property
    def can_fail(self) -> bool:
        return any(kernel.pivots for function in self.functions for kernel in function.kernels)


def crate_view(given: Emission) -> CrateView:
    """Return the data of a Rust crate. Raises InputError if there are no functions, or for an option that Rust lacks."""
    info, robot, functions = given.info, identifier(given.info.name), given.functions
    if not functions or info.l == 0:
        raise InputError(f"{info.name}: no functions to emit", "choose at least one, of links with inertia")
    if given.options.real != "float64":
        raise InputError("the back end rust writes float64 alone", "leave --real out, or use psdmc emit-c")
    signatures = [function.signature for function in functions]
    framed = uses_frames(signatures)
    version = re.match(r"\d+\.\d+\.\d+", info.psdmc_version)
    return CrateView(
        robot,
        info,
        version[0] if version else "0.0.0",
        (*facts(info, given.options), ARRAYS, *axis_lines(info, signatures, framed)),
        tuple(_function(function, info) for function in functions),
        tuple(_constants(info, functions, framed)),
        tuple(_inputs(given)),
        tuple(_checks(given, robot)),
    )


def _constants(info: PackageInfo, functions: Iterable[Function], framed: bool) -> Iterator[Constant]:
    joints = info.joints
    yield Constant("JOINTS", info.n, "Number of joints.")
    yield Constant("NQ", info.nq, "Length of q.")
    yield Constant("NV", info.nv, "Length of rates and torques: degrees of freedom.")
    yield Constant("BASE_PARAMETERS", info.l, "Length of theta_b.")
    yield Constant("JOINT_NAMES", [joint.name for joint in joints], "Names in the joints' order.")
    for name in ("lower", "upper", "speed", "effort"):
        limits = [float(getattr(joint, name)) for joint in joints]
        yield Constant(f"{name.upper()}_LIMIT", limits, "Limits in SI units; infinite where unknown.")
    yield Constant("GRAVITY_ACCELERATION", list(info.gravity), f"m/s^2 in the {info.base_frame}.")
    theta = [float("nan") if p.value is None else p.value for p in info.parameters]
    yield Constant("THETA_B", theta, "Base parameters that are compiled in; NaN where unknown.")
    if framed:
        yield Constant("FRAME_NAMES", list(info.frames), "Named frames, in the order of arrays over them.")
    if uses_contacts(function.signature for function in functions):
        yield Constant(
            "CONTACT_NAMES",
            [name for name, _ in info.contacts],
            "Contacts, in the order of arrays over them.",
        )
        yield Constant("CONTACT_ROWS", [rows for _, rows in info.contacts], "3 for a point, 6 for a surface.")
    for function in functions:
        if places := function.kernels[0].places:
            name = f"{function.signature.name.upper()}_PATTERN"
            yield Constant(name, [list(place) for place in places], "Row and column of each packed entry.")


def _sizes(kernel: Kernel, info: PackageInfo) -> Sizes:
    return replace(info.sizes, nonzeros=len(kernel.places))


def _inputs(given: Emission) -> Iterator[Constant]:
    """The reference states' vectors that functions read."""
    if given.references is None:
        return
    kernels = [kernel for function in given.functions for kernel in function.kernels]
    read = {
        given_name(q.name, "_theta" * kernel.theta): _sizes(kernel, given.info).shape(q.axes)
        for kernel in kernels
        for q in kernel.function.inputs
    }
    for name, shape in read.items():
        yield Constant(name.upper(), given.references.given[name].reshape(-1, *shape).tolist())
    if any(kernel.theta for kernel in kernels):
        yield Constant("THETA_B", given.references.theta_b.tolist())


def _checks(given: Emission, robot: str) -> Iterator[Check]:
    known = {} if given.references is None else given.references.expected
    for kernel in (kernel for function in given.functions for kernel in function.kernels):
        signature, sizes = kernel.function, _sizes(kernel, given.info)
        names = [(given_name(q.name, "_theta" * kernel.theta).upper(), q.axes) for q in signature.inputs]
        words = [f"{'&' if axes else ''}{name}[k]" for name, axes in names]
        words += ["&THETA_B"] if kernel.theta else []
        call = f"{robot}::{kernel.name}({', '.join(words)}){'.unwrap()' if signature.factorises else ''}"
        for k, output in enumerate(signature.outputs):
            label = signature.label(output, kernel.theta)
            rows = sizes.shape(output.axes)[0] if compared_by_row(output) else 1
            part = f"{call}.{k}" if len(signature.outputs) > 1 else call
            values = Constant("", known[label].tolist()) if label in known else None
            yield Check(label, rows, tolerance(signature, "float64"), part, values)


def _function(function: Function, info: PackageInfo) -> FunctionText:
    shape = _sizes(function.kernels[0], info).shape
    outputs = (f"`{q.name}` is `{array(shape(q.axes))}`" for q in function.signature.outputs)
    return FunctionText(
        function, "; ".join(outputs), tuple(_kernel(kernel, info) for kernel in function.kernels)
    )


def _kernel(kernel: Kernel, info: PackageInfo) -> KernelText:
    signature, sizes = kernel.function, _sizes(kernel, info)
    if kernel.is_loop_of_calls:
        raise InputError(
            f"{signature.name} of {info.name} is too long for one body, and Rust has no other form of it",
            "leave it out of --functions, or use psdmc emit-c",
        )
    if lacking := sorted({instr.op.value for instr in kernel.single} - WRITTEN):
        raise InputError(
            f"{signature.name} of {info.name} needs {', '.join(lacking)}, which the Rust back end lacks",
            "leave it out of --functions, or use psdmc emit-c",
        )
    inputs = (*signature.inputs, *((Quantity("theta_b", ("l",)),) if kernel.theta else ()))
    shapes = {q.name: sizes.shape(q.axes) for q in (*inputs, *signature.stored)}
    if wrong := [name for name in shapes if LOCAL.fullmatch(name)]:
        raise InternalError(f"{signature.name}: Rust takes {wrong[0]!r} for something else")
    parameters = [f"{variable(q.name)}: {'&' if q.axes else ''}{array(shapes[q.name])}" for q in inputs]
    returns, result = (
        each[0] if len(each) == 1 else f"({', '.join(each)})"
        for each in zip(*((array(shapes[q.name]), variable(q.name)) for q in signature.outputs), strict=True)
    )
    positive = pivots = ""
    if signature.pivots:
        positive, returns = signature.pivots.name, f"Result<{returns}, crate::NotPositive>"
        slots = [slot for slot, _ in kernel.single.outputs if slot.vector == positive]
        pivots = ", ".join(f"({slot.index}, {place(slot, shapes)})" for slot in slots)
    lines = statements(kernel.single, shapes, signature.stored)
    about = f"{kernel.name}: {cost(kernel.single)}, {kernel.lowering}"
    return KernelText(kernel.name, ", ".join(parameters), returns, about, lines, result, pivots)


def _type(value: Any) -> str:
    if isinstance(value, list):
        return f"[{_type(value[0])}; {len(value)}]"
    return "&str" if isinstance(value, str) else "f64" if isinstance(value, float) else "usize"


def _literal(value: Any) -> str:
    if isinstance(value, list):
        return f"[{', '.join(map(_literal, value))}]"
    return (
        string(value) if isinstance(value, str) else number(value) if isinstance(value, float) else str(value)
    )


def polynomial(terms: Sequence[float]) -> str:
    """Return a Rust expression of a polynomial in z. The expression uses Rust variables z and z2 = z^2. The
    coefficients begin with the constant term.

    Terms are evaluated in pairs (Estrin's scheme), which has a dependency chain half as long as that of Horner's form.
    """
    *pairs, found = (f"fma(z, {b!r}, {a!r})" for a, b in zip(terms[::2], terms[1::2], strict=True))
    for pair in reversed(pairs):
        found = f"fma(z2, {found}, {pair})"
    return found


FILES = ("Cargo.toml", "README.md", "src/lib.rs", "src/math.rs", "tests/self_test.rs")


@cache
def _environment() -> Environment:
    return environment_with(comment=comment, polynomial=polynomial)


def _files(given: Emission) -> dict[str, str]:
    crate = crate_view(given)

    def rendered(template: str, **view: object) -> str:
        return _environment().get_template(template).render(crate=crate, trig=NUMBERS["double"], **view)

    files = {path: rendered(f"rust/{path.rpartition('/')[2]}.jinja") for path in FILES}
    for each in crate.functions:
        files[f"src/{each.function.signature.name}.rs"] = rendered("rust/function.rs.jinja", function=each)
    files["LICENSE"] = rendered("LICENSE.jinja")
    options = {key: value for key, value in option_items(given.info, given.options).items() if key != "trig"}
    functions = [
        {"name": each.function.signature.name, "kernels": [{"name": kernel.name} for kernel in each.kernels]}
        for each in crate.functions
    ]
    files["manifest.json"] = manifest(crate.robot, given.info, options, {"backend": "rust"}, functions, files)
    return files


BACK_END = BackEnd(
    "Rust",
    "name of the crate",
    _files,
    identifier,
    lambda robot: ("Cargo.toml", f'the crate, {robot} = {{ path = "..." }}'),
    lambda folder: f"cargo test --manifest-path {folder}/Cargo.toml",
    ("trig", "target", "payload", "friction", "bodies", "estimator", "with", "functions NAME_theta_rows"),
)
