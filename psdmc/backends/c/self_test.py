"""The function calls of the package's self-test. Every function is called for single states and for batches in every
memory layout, and the results are compared with reference values."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from dataclasses import dataclass

from psdmc.backends.c.kernel_view import KernelView
from psdmc.backends.c.prototypes import Prototype
from psdmc.backends.options import EmitOptions
from psdmc.backends.self_test import compared_by_row, given_name, tolerance


@dataclass(frozen=True, slots=True)
class GivenVector:
    """One input of the self-test: its name in the reference states, and how many real numbers belong to one state
    (`size`). `of_joints` states whether the input has one entry per joint."""

    name: str
    size: int
    of_joints: bool

    @property
    def length(self) -> str:
        """Its size as C text."""
        return "N" if self.of_joints else str(self.size)

    @property
    def repeat(self) -> str:
        """C that fills its rows and lanes."""
        places = f"{self.name}_rows, {self.name}_lanes"
        if self.of_joints:
            return f"repeat({self.name}_given, {places})"
        return f"repeat_sized({self.size}, {self.name}_given[0], {places})"


@dataclass(frozen=True, slots=True)
class SelfCheck:
    """The comparison of one output of a generated function with expected values, in the self-test. The function is
    called for single states and, if it has batch variants, for many states.

    rows, columns  shape of the output for one state
    single         C call for the state with the number `row`
    batch          C call for `count` states, stored one state after the other; '' if there is no batch variant
    lanes          C call for `count` states, stored in blocks [entry][lane] with one state per lane; '' if there is no
                   such variant
    status         whether the calls return a status
    expected       C name of the array of expected values; '' if there are no expected values
    tolerance      largest permitted error, as C text
    """

    kernel: str
    name: str
    rows: int
    columns: int
    single: str
    batch: str
    lanes: str
    status: bool
    expected: str
    tolerance: str

    @property
    def size(self) -> int:
        return self.rows * self.columns


def self_checks(
    kernels: Iterable[KernelView], n: int, options: EmitOptions, known: Collection[str]
) -> tuple[SelfCheck, ...]:
    """Return one comparison for each output of each kernel (one variant of a generated function). `known` are the names
    of outputs that have expected values."""
    return tuple(
        _check(kernel, k, n, options, known) for kernel in kernels for k in range(len(kernel.outputs))
    )


def given_vectors(kernels: Iterable[KernelView], n: int) -> tuple[GivenVector, ...]:
    """Return the inputs of all kernels (variants of generated functions), without duplicates, by their names in the
    reference states."""
    return tuple(
        dict.fromkeys(
            GivenVector(given_name(v.name, kernel.variant), v.size, v.size == n)
            for kernel in kernels
            for v in kernel.inputs
        )
    )


def labels(kernels: Iterable[KernelView]) -> tuple[str, ...]:
    """Labels of all outputs of these kernels."""
    return tuple(_label(kernel, k) for kernel in kernels for k in range(len(kernel.outputs)))


def _label(kernel: KernelView, k: int) -> str:
    return kernel.function.label(kernel.function.outputs[k], kernel.theta)


def _check(kernel: KernelView, k: int, n: int, options: EmitOptions, known: Collection[str]) -> SelfCheck:
    """The check of output number k; the kernel's other outputs are written to an array that is not compared."""
    quantity, output, label = kernel.function.outputs[k], kernel.outputs[k], _label(kernel, k)
    rows = output.shape[0] if compared_by_row(quantity) else 1
    prototypes = kernel.prototypes
    theta = ["theta_b_given"] if kernel.theta else []
    names = [given_name(vector.name, kernel.variant) for vector in kernel.inputs]
    each = [f"{given.name}_rows + row * {given.length}" for given in given_vectors([kernel], n)]
    batch, lanes = (
        ["count", *(f"{name}_rows" for name in names)],
        ["count", *(f"{name}_lanes" for name in names)],
    )

    def found(place: str) -> list[str]:
        return [place if i == k else f"unseen[{i}]" for i in range(len(kernel.outputs))]

    return SelfCheck(
        kernel=kernel.name,
        name=label,
        rows=rows,
        columns=output.size // rows,
        single=_call(prototypes["single"], [*each, *theta, *found(f"found + row * {output.size}")]),
        batch=_call(prototypes["batch"], [*batch, *theta, *found("found")]) if "batch" in prototypes else "",
        lanes=_call(prototypes["batch_soa"], [*lanes, *found("blocks")]) if "batch_soa" in prototypes else "",
        status=kernel.positive is not None,
        expected=f"{label}_expected" if label in known else "",
        tolerance=tolerance(kernel.function, options.real),
    )


def _call(prototype: Prototype, arguments: list[str]) -> str:
    call = f"{prototype.symbol}({', '.join(arguments)})"
    return call if prototype.returns == "void" else f"status |= {call} != 0"
