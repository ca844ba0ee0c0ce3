"""A crate in the form that templates print, from the emission."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from psdmc.backends.describe import facts, frame_lines, uses_frames
from psdmc.backends.info import PackageInfo
from psdmc.backends.protocol import Emission, Function
from psdmc.backends.rust.body import number, statements
from psdmc.backends.rust.names import identifier, text, variable
from psdmc.backends.self_test import compared_by_row, given_name, tolerance
from psdmc.backends.trig_numbers import NUMBERS
from psdmc.errors import InputError, InternalError
from psdmc.program.cost import cost
from psdmc.program.kernel import Kernel
from psdmc.program.signature import Quantity, Sizes

LOCAL = re.compile(r"t\d+|(sin|cos)_\d+|fma|sqrt|sin_cos|entry")
"""Names of a body's own; no quantity may have one."""


@dataclass(frozen=True, slots=True)
class Constant:
    """A constant with its documentation."""

    name: str
    type: str
    value: str
    meaning: str = ""


@dataclass(frozen=True, slots=True)
class KernelText:
    """One Rust function.

    pivots    entries of `positive` that must be positive, in the order in which they are looked at; empty: it cannot fail
    """

    name: str
    parameters: str
    returns: str
    cost: str
    lines: tuple[str, ...]
    result: str
    positive: str = ""
    pivots: str = ""


@dataclass(frozen=True, slots=True)
class FunctionText:
    """One file: a function with compiled-in parameters and with theta_b, and what it needs of crate::math."""

    name: str
    meaning: str
    shape: str
    which: str
    kernels: tuple[KernelText, ...]

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(kernel.name for kernel in self.kernels)

    @property
    def math(self) -> tuple[str, ...]:
        lines = "\n".join(line for kernel in self.kernels for line in kernel.lines)
        return tuple(name for name in ("fma", "sin_cos", "sqrt") if re.search(rf"\b{name}\(", lines))


@dataclass(frozen=True, slots=True)
class Check:
    """One output's comparison in the self-test."""

    name: str
    rows: int
    tolerance: str
    expected: str
    call: str


@dataclass(frozen=True, slots=True)
class TrigText:
    """The numbers of sine and cosine."""

    two_over_pi: str
    magic: str
    half_pi: tuple[str, ...]
    sine: str
    cosine: str
    limit: str


@dataclass(frozen=True)
class CrateView:
    """One crate."""

    given: Emission

    @property
    def robot(self) -> str:
        return identifier(self.given.info.name)

    @property
    def info(self) -> PackageInfo:
        return self.given.info

    @property
    def version(self) -> str:
        """psdmc's version as the three numbers that cargo compares."""
        found = re.match(r"(\d+)\.(\d+)(?:\.(\d+))?", self.info.psdmc_version)
        return ".".join(part or "0" for part in found.groups()) if found else "0.0.0"

    @property
    def uses_frames(self) -> bool:
        return uses_frames(function.signature for function in self.given.functions)

    @property
    def description(self) -> tuple[str, ...]:
        lines = (
            "Arrays: matrices are arrays of rows. Quaternions, and cosine and sine of an angle, are of length one.",
            "Functions with _theta take the base parameters theta_b at run time.",
        )
        return (
            *facts(self.info, self.given.options),
            *lines,
            *(frame_lines(self.info) if self.uses_frames else ()),
        )

    @cached_property
    def functions(self) -> tuple[FunctionText, ...]:
        return tuple(self._function(function) for function in self.given.functions)

    @property
    def can_fail(self) -> bool:
        return any(kernel.pivots for function in self.functions for kernel in function.kernels)

    @property
    def constants(self) -> Iterator[Constant]:
        info, joints = self.info, self.info.joints
        yield Constant("JOINTS", "usize", str(info.n), "Number of joints.")
        yield Constant("NQ", "usize", str(info.nq), "Length of q.")
        yield Constant("NV", "usize", str(info.nv), "Length of rates and torques: degrees of freedom.")
        yield Constant("BASE_PARAMETERS", "usize", str(info.l), "Length of theta_b.")
        yield _texts("JOINT_NAMES", [joint.name for joint in joints], "Of the joints in their order.")
        yield _numbers(
            "POSITION_LOWER", [j.lower for j in joints], "Limits, rad or m; infinite where unknown."
        )
        yield _numbers(
            "POSITION_UPPER", [j.upper for j in joints], "Limits, rad or m; infinite where unknown."
        )
        yield _numbers(
            "SPEED_LIMIT", [j.speed for j in joints], "Limits, rad/s or m/s; infinite where unknown."
        )
        yield _numbers(
            "EFFORT_LIMIT", [j.effort for j in joints], "Limits, N m or N; infinite where unknown."
        )
        yield _numbers("GRAVITY_ACCELERATION", info.gravity, f"m/s^2 in the {info.base_frame}.")
        theta = [parameter.value for parameter in info.parameters]
        yield _numbers("THETA_B", theta, "Base parameters that are compiled in; NaN where unknown.")
        if self.uses_frames:
            yield _texts("FRAME_NAMES", info.frames, "Named frames, in the order of every array over them.")
        for function in self.given.functions:
            if places := function.kernels[0].places:
                rows = ", ".join(f"({row}, {column})" for row, column in places)
                name, kind = f"{function.signature.name.upper()}_PATTERN", f"[(usize, usize); {len(places)}]"
                yield Constant(name, kind, f"[{rows}]", "Row and column of each packed entry.")

    @property
    def numbers(self) -> TrigText:
        own = NUMBERS["double"]
        return TrigText(
            number(own.two_over_pi),
            number(1.5 * 2.0 ** (own.digits - 1)),
            tuple(map(number, own.half_pi)),
            _polynomial(own.sin_terms),
            _polynomial(own.cos_terms),
            number(own.limit),
        )

    @property
    def reference_constants(self) -> Iterator[Constant]:
        references = self.given.references
        if references is None:
            return
        kernels = [kernel for function in self.given.functions for kernel in function.kernels]
        given = {
            given_name(q.name, kernel.theta): self._sizes(kernel).shape(q.axes)
            for kernel in kernels
            for q in kernel.function.inputs
        }
        for name, shape in given.items():
            values = references.given[name].reshape(-1, *shape)
            yield Constant(name.upper(), array_type(values.shape), _nested(values))
        if any(kernel.theta for kernel in kernels):
            values = references.theta_b
            yield Constant("THETA_B", array_type(values.shape), _nested(values))
        for check in self.checks:
            values = references.expected[check.name]
            yield Constant(check.expected, array_type(values.shape), _nested(values))

    @property
    def checks(self) -> tuple[Check, ...]:
        known = () if self.given.references is None else self.given.references.expected
        return tuple(check for check in self._outputs() if check.name in known)

    @property
    def unchecked(self) -> tuple[str, ...]:
        checked = {check.name for check in self.checks}
        return tuple(check.name for check in self._outputs() if check.name not in checked)

    def _outputs(self) -> Iterator[Check]:
        for function in self.given.functions:
            for kernel in function.kernels:
                yield from (self._check(kernel, k) for k in range(len(kernel.function.outputs)))

    def _check(self, kernel: Kernel, k: int) -> Check:
        signature, output = kernel.function, kernel.function.outputs[k]
        shape = self._sizes(kernel).shape(output.axes)
        label = signature.label(output, kernel.theta)
        names = (given_name(q.name, kernel.theta).upper() for q in signature.inputs)
        arguments = [
            f"{'&' if q.axes else ''}{name}[k]" for q, name in zip(signature.inputs, names, strict=True)
        ]
        arguments += ["&THETA_B"] if kernel.theta else []
        failing = ".unwrap()" if signature.positive else ""
        part = f".{k}" if len(signature.outputs) > 1 else ""
        call = f"{self.robot}::{kernel.name}({', '.join(arguments)}){failing}{part}"
        rows = shape[0] if compared_by_row(output) else 1
        return Check(label, rows, tolerance(signature, "float64"), f"{label.upper()}_EXPECTED", call)

    def _sizes(self, kernel: Kernel) -> Sizes:
        return replace(self.info.sizes, nonzeros=len(kernel.places))

    def _function(self, function: Function) -> FunctionText:
        signature = function.signature
        shape = self._sizes(function.kernels[0]).shape
        outputs = "; ".join(f"`{q.name}` is {array_type(shape(q.axes))}" for q in signature.outputs)
        which = signature.positive.which if signature.positive else ""
        kernels = tuple(self._kernel(kernel) for kernel in function.kernels)
        return FunctionText(signature.name, function.meaning, outputs, which, kernels)

    def _kernel(self, kernel: Kernel) -> KernelText:
        signature, sizes = kernel.function, self._sizes(kernel)
        if kernel.is_loop_of_calls:
            raise InputError(
                f"{signature.name} of {self.info.name} is too long for one body, and the back end rust writes no other",
                "leave it out of --functions, or emit C: psdmc emit-c",
            )
        theta = (Quantity("theta_b", ("l",)),) if kernel.theta else ()
        inputs = (*signature.inputs, *theta)
        shapes = {q.name: sizes.shape(q.axes) for q in (*inputs, *signature.stored)}
        for name in shapes:
            if LOCAL.fullmatch(name):
                raise InternalError(f"{signature.name}: Rust takes {name!r} for something else")
        parameters = (
            f"{variable(q.name)}: {'&' if q.axes else ''}{array_type(shapes[q.name])}" for q in inputs
        )
        types = [array_type(shapes[q.name]) for q in signature.outputs]
        results = [variable(q.name) for q in signature.outputs]
        returns, result = (
            (types[0], results[0])
            if len(types) == 1
            else (f"({', '.join(types)})", f"({', '.join(results)})")
        )
        positive, pivots = "", ""
        if signature.positive:
            positive, returns = signature.positive.quantity.name, f"Result<{returns}, crate::NotPositive>"
            order = [slot.index for slot, _ in kernel.single.outputs if slot.vector == positive]
            pivots = f"0..{len(order)}" if order == sorted(order) else f"[{', '.join(map(str, order))}]"
        lines = tuple(statements(kernel.single, shapes, signature.stored))
        about = f"{kernel.name}: {cost(kernel.single)}, {kernel.lowering}"
        return KernelText(
            kernel.name, ", ".join(parameters), returns, about, lines, result, variable(positive), pivots
        )


def array_type(shape: Sequence[int]) -> str:
    """`[[f64; 3]; 2]` of the shape (2, 3); a number of no axes."""
    found = "f64"
    for length in reversed(shape):
        found = f"[{found}; {length}]"
    return found


def _nested(values: NDArray[np.float64]) -> str:
    if values.ndim == 0:
        return number(float(values))
    return f"[{', '.join(map(_nested, values))}]"


def _texts(name: str, values: Sequence[str], meaning: str) -> Constant:
    return Constant(name, f"[&str; {len(values)}]", f"[{', '.join(map(text, values))}]", meaning)


def _numbers(name: str, values: Sequence[float | None], meaning: str) -> Constant:
    return Constant(name, f"[f64; {len(values)}]", f"[{', '.join(map(number, values))}]", meaning)


def _polynomial(terms: Sequence[float]) -> str:
    """In z and z2 = z^2, constant term first: pairs (Estrin), half as deep as Horner's form."""
    pairs = [f"fma(z, {number(b)}, {number(a)})" for a, b in zip(terms[::2], terms[1::2], strict=True)]
    found = pairs[-1]
    for pair in reversed(pairs[:-1]):
        found = f"fma(z2, {found}, {pair})"
    return found
