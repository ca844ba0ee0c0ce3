"""The function calls of the package's self-test. Every function is called for single states and for batches in every
memory layout, and the results are compared with reference values."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from psdmc.backends.c.expressions import number, numbers
from psdmc.backends.c.kernel_view import KernelView, Prototype
from psdmc.backends.info import EmitOptions
from psdmc.backends.reference_states import (
    LOAD_COM,
    LOAD_INERTIA,
    LOAD_MASS,
    TOLERANCES,
    ReferenceStates,
    compared_by_row,
    given_name,
    tolerance,
)
from psdmc.robot.inertia import six_of


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


def given_vectors(kernels: Iterable[KernelView], n: int) -> tuple[GivenVector, ...]:
    """Return the inputs of all kernels, without duplicates, by their names in the reference states."""
    return tuple(
        dict.fromkeys(
            GivenVector(given_name(v.name, kernel.variant), v.size, v.size == n)
            for kernel in kernels
            for v in kernel.inputs
        )
    )


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
    batch, lanes = (["count", *(f"{name}_{kind}" for name in names)] for kind in ("rows", "lanes"))

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


# States and expected results as C text


@dataclass(frozen=True, slots=True)
class ReferenceTable:
    """One constant C array of the self-test: its name, number of columns, and C text of each row (one state)."""

    name: str
    columns: int
    rows: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class LoadView:
    """The example load of the self-test as C text: mass, com (centre of mass), inertia (Ixx Ixy Iyy Ixz Iyz Izz), and
    rows `added`. Each row is what the load adds to theta_b (the base parameters) at the tip or at one named frame."""

    mass: str
    com: str
    inertia: str
    added: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class ReferenceView:
    """The data of the self-test as C text.

    count     number of states
    tables    the inputs at all states, then the expected values of each output
    expected  names of the outputs that have a table of expected values
    theta_b   the base parameters that the functions take as an input, one constant each; empty if no function takes
              them
    load      a load and what it adds to theta_b; None if the package has no functions that add loads
    """

    count: int
    tables: tuple[ReferenceTable, ...]
    expected: tuple[str, ...]
    theta_b: tuple[str, ...]
    load: LoadView | None = None


def reference_view(
    references: ReferenceStates, real: str, kernels: Sequence[KernelView], n: int
) -> ReferenceView:
    """Return the data of the self-test as C text: the inputs of these kernels at some states, and the expected outputs.
    `n` is the length of rates and torques.

    Raises ValueError if the states belong to another robot.
    """
    sizes = {vector.name: vector.size for vector in given_vectors(kernels, n)}
    given = []
    for name, array in references.given.items():
        if name not in sizes:
            continue
        if array.shape[1] != sizes[name]:
            raise ValueError(
                f"reference states have {array.shape[1]} entries of {name}, expected {sizes[name]}"
            )
        given.append(_table(f"{name}_given", array, real))
    labels = (_label(kernel, k) for kernel in kernels for k in range(len(kernel.outputs)))
    known = tuple(label for label in labels if label in references.expected)
    expected = [_table(f"{label}_expected", references.expected[label], real) for label in known]
    takes_theta = any(kernel.theta for kernel in kernels)
    theta_b = tuple(number(value, real) for value in references.theta_b.tolist()) if takes_theta else ()
    load = None
    if references.load is not None:
        load = LoadView(
            number(LOAD_MASS, real),
            numbers(LOAD_COM, real),
            numbers(six_of(LOAD_INERTIA), real),
            tuple(numbers(row, real) for row in references.load.tolist()),
        )
    count = len(next(iter(references.given.values())))
    return ReferenceView(count, (*given, *expected), known, theta_b, load)


def _table(name: str, array: NDArray[np.float64], real: str) -> ReferenceTable:
    rows = tuple(numbers(row, real) for row in np.asarray(array, float).tolist())
    return ReferenceTable(name, array.shape[1], rows)


# The data of the templates


@dataclass(frozen=True, slots=True)
class SelfTestView:
    """The self-test of one package.

    kernels  variants of all functions of the package
    dof      length of rates and torques
    known    names of the outputs that have expected values
    beside   number of further C functions that the self-test compares: for loads, bodies and friction
    """

    kernels: tuple[KernelView, ...]
    dof: int
    options: EmitOptions
    known: tuple[str, ...]
    beside: int

    @property
    def checks(self) -> tuple[SelfCheck, ...]:
        """Return the comparison of each output of each kernel. Outputs without expected values are marked."""
        return tuple(
            _check(kernel, k, self.dof, self.options, self.known)
            for kernel in self.kernels
            for k in range(len(kernel.outputs))
        )

    @property
    def functions(self) -> int:
        """Return the number of C functions whose values the self-test compares: kernels (variants of generated
        functions), and functions for loads, bodies and friction."""
        return len({check.kernel for check in self.checks if check.expected}) + self.beside

    @property
    def load_tolerance(self) -> str:
        """Return the tolerance of the functions that give theta_b."""
        return TOLERANCES[self.options.real]

    @property
    def given(self) -> tuple[GivenVector, ...]:
        """Return the inputs of all kernels (variants of generated functions), by their names in the reference states."""
        return given_vectors(self.kernels, self.dof)

    @property
    def given_otherwise(self) -> bool:
        """Return whether some input of the tested functions is not a vector with one entry per joint."""
        return not all(vector.of_joints for vector in self.given)

    @property
    def largest_output(self) -> int:
        return max(output.size for kernel in self.kernels for output in kernel.outputs)

    @property
    def has_several_outputs(self) -> bool:
        return self.most_outputs > 1

    @property
    def most_outputs(self) -> int:
        return max(len(kernel.outputs) for kernel in self.kernels)
