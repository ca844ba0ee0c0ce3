"""What the package's own test calls: every function in every layout, against what the reference states say."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass

from psdmc.emit.kernel_view import KernelView
from psdmc.emit.options import EmitOptions
from psdmc.emit.prototypes import Prototype
from psdmc.program.functions import BY_NAME

TOLERANCES = {"float64": "1e-10", "float32": "1e-3"}
FORWARD_TOLERANCES = {"float64": "1e-7", "float32": "1e-1"}
"""Relative to a joint's largest value: loose enough for badly conditioned mass matrices, tight for wrong
code."""


@dataclass(frozen=True, slots=True)
class SelfCheck:
    """One kernel called state by state, row by row and, where it has that form, lane by lane.

    rows, columns  of its output per state
    single, batch  C calls, `row` being the state's number and `count` the batch's size; lanes: '' where there is no
                   such form
    status         whether the calls return one
    expected       array that it should reproduce; '' where no reference state has a value
    """

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
    """One check per kernel; `known`: the kernels whose values the reference states hold."""
    return tuple(_check(kernel, n, options, known) for kernel in kernels)


def given_vectors(kernels: Iterable[KernelView]) -> tuple[str, ...]:
    """Input vectors of all these kernels, by the reference states' names, each once."""
    return tuple(dict.fromkeys(_given(kernel, v.name) for kernel in kernels for v in kernel.inputs))


def _check(kernel: KernelView, n: int, options: EmitOptions, known: Collection[str]) -> SelfCheck:
    function = BY_NAME[kernel.name.removesuffix("_theta")]
    rows = 6 if function.rows == "6" else n
    size = kernel.output.size
    prototypes: Mapping[str, Prototype] = kernel.prototypes
    theta = ["theta_b_given"] if kernel.theta else []
    names = [_given(kernel, vector.name) for vector in kernel.inputs]
    each = [f"{name}_rows + row * N" for name in names]
    batch, lanes = (
        ["count", *(f"{name}_rows" for name in names)],
        ["count", *(f"{name}_lanes" for name in names)],
    )
    tolerances = FORWARD_TOLERANCES if function.pivots else TOLERANCES
    return SelfCheck(
        name=kernel.name,
        rows=rows,
        columns=size // rows,
        single=_call(prototypes["single"], [*each, *theta, f"found + row * {size}"]),
        batch=_call(prototypes["batch"], [*batch, *theta, "found"]),
        lanes=_call(prototypes["batch_soa"], [*lanes, "blocks"]) if "batch_soa" in prototypes else "",
        status=function.pivots,
        expected=f"{kernel.name}_expected" if kernel.name in known else "",
        tolerance=tolerances[options.real],
    )


def _call(prototype: Prototype, arguments: list[str]) -> str:
    call = f"{prototype.symbol}({', '.join(arguments)})"
    return call if prototype.returns == "void" else f"status |= {call} != 0"


def _given(kernel: KernelView, vector: str) -> str:
    """The reference states' name of an input: torques depend on the parameters that they belong to."""
    return "tau_theta" if kernel.theta and vector == "tau" else vector
