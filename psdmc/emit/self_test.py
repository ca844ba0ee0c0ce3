"""What the package's own test calls: each function whose result the reference states tell."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from psdmc.emit.kernel_view import KernelView
from psdmc.emit.options import EmitOptions

EXPECTED = {"inverse_dynamics": "tau", "forward_dynamics": "qdd"}
TOLERANCES = {
    ("inverse_dynamics", "float64"): "1e-10",
    ("inverse_dynamics", "float32"): "1e-3",
    ("forward_dynamics", "float64"): "1e-7",
    ("forward_dynamics", "float32"): "1e-1",
}
"""Relative to a joint's largest value: loose enough for badly conditioned mass matrices, tight for wrong
code."""


@dataclass(frozen=True, slots=True)
class SelfCheck:
    """One kernel, called state by state and as a batch, and the reference vector that it should reproduce."""

    name: str
    call: str
    batch_call: str
    expected: str
    tolerance: str


def self_checks(kernels: Iterable[KernelView], robot: str, options: EmitOptions) -> tuple[SelfCheck, ...]:
    return tuple(_check(kernel, robot, options) for kernel in kernels if _function(kernel) in EXPECTED)


def _check(kernel: KernelView, robot: str, options: EmitOptions) -> SelfCheck:
    single, batch = kernel.prototypes["single"].symbol, kernel.prototypes["batch"].symbol
    theta = [f"{robot}_theta_b"] if kernel.theta else []
    rows = [f"reference_{vector.name}[row]" for vector in kernel.inputs]
    starts = [f"reference_{vector.name}[0]" for vector in kernel.inputs]
    return SelfCheck(
        name=kernel.name,
        call=f"(void){single}({', '.join([*rows, *theta, 'found[row]'])})",
        batch_call=f"(void){batch}({', '.join(['REFERENCE_COUNT', *starts, *theta, 'found[0]'])})",
        expected=EXPECTED[_function(kernel)],
        tolerance=TOLERANCES[_function(kernel), options.real],
    )


def _function(kernel: KernelView) -> str:
    return kernel.name.removesuffix("_theta")
