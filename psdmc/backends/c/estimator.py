"""C text for the functions that estimate a load at the tip and friction offsets while the robot moves."""

from __future__ import annotations

from dataclasses import dataclass

from psdmc.backends.c.expressions import CReal, c_real
from psdmc.backends.c.kernel_view import FunctionView, Prototype
from psdmc.backends.c.make_kernel_view import make_kernel_view
from psdmc.backends.info import EmitOptions, PackageInfo
from psdmc.program.kernel import Kernel

WIDEST = 16
"""Most floats in a SIMD vector."""


@dataclass(frozen=True, slots=True)
class EstimatorView:
    """The functions of one C package that estimate a load, as data for the templates.

    momentum  the function that computes momenta for the estimator; no header declares it
    """

    robot: str
    real: CReal
    momentum: FunctionView

    @property
    def count(self) -> int:
        """Return how many parameters of the load are estimated, 4 or 10."""
        kernel = self.momentum.kernels[0]
        own, load = kernel.outputs[0], kernel.outputs[2]
        return load.size // own.size

    @property
    def has_inertia(self) -> bool:
        return self.count > 4

    @property
    def stride(self) -> int:
        """Return the length of the covariance's rows: a multiple of every processor's SIMD width."""
        return -(-(self.count + self.momentum.kernels[0].outputs[0].size) // WIDEST) * WIDEST

    @property
    def sources(self) -> tuple[str, ...]:
        return (*(f"src/{unit.name}.c" for unit in self.momentum.units), "src/estimator.c")

    @property
    def init(self) -> Prototype:
        given = (f"{self.robot}_estimator *state", f"{self.real} largest_mass", f"{self.real} reach")
        return Prototype("void", f"{self.robot}_estimate_init", (*given, f"const {self.real} *tau_sd"))

    @property
    def step(self) -> Prototype:
        given = tuple(f"const {self.real} *{name}" for name in ("q", "qd", "tau"))
        return Prototype(
            "int",
            f"{self.robot}_estimate_step",
            (f"{self.robot}_estimator *state", *given, f"{self.real} dt"),
        )

    @property
    def load(self) -> Prototype:
        given = (f"const {self.robot}_estimator *state", f"{self.robot}_load *load")
        return Prototype("void", f"{self.robot}_estimate_load", given)


def estimator_view(kernel: Kernel, info: PackageInfo, robot: str, options: EmitOptions) -> EstimatorView:
    """Return the estimator of a package. `options` are those of a package without functions for many states."""
    made = make_kernel_view(kernel, info.sizes, robot, options)
    return EstimatorView(
        robot, c_real(options), FunctionView(made.name, kernel.function.meaning, "", kernel.function, (made,))
    )
