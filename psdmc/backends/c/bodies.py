"""Makes C text for the functions about bodies. They compute theta_b (the base parameters) from all bodies' masses and
inertias, add a load to it, and estimate a load at the tip and friction offsets while the robot moves."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from psdmc.backends.c.expressions import CReal, c_real, number, numbers
from psdmc.backends.c.kernel_view import FunctionView, Prototype
from psdmc.backends.c.make_kernel_view import undeclared
from psdmc.backends.info import BodiesMap, EmitOptions, PackageInfo
from psdmc.program.kernel import Kernel
from psdmc.robot.mechanism import Array


@dataclass(frozen=True, slots=True, eq=False)
class BodiesView:
    """The linear map from all bodies' parameters to theta_b (the base parameters), as C text for float or double."""

    robot: str
    real: CReal
    map: BodiesMap

    @property
    def prototype(self) -> Prototype:
        given = (f"const {self.real} *{name}" for name in ("masses", "coms", "inertias"))
        return Prototype("void", f"{self.robot}_theta_from_bodies", (*given, f"{self.real} *theta_b"))

    @property
    def count(self) -> int:
        return len(self.map.links)

    @property
    def constant(self) -> str:
        return numbers(self.map.constant, self.real)

    @property
    def entries(self) -> tuple[str, ...]:
        """Return the nonzero entries of the matrix from body parameters to base parameters, column by column. Each
        entry is C text {index of the base parameter, factor}."""
        return tuple(
            f"{{{row}, {number(float(column[row]), self.real)}}}"
            for column in self.map.columns.T
            for row in np.flatnonzero(column).tolist()
        )

    @property
    def ends(self) -> tuple[str, ...]:
        """Return, for each body and each of its ten parameters, the index in `entries` after the last entry of this
        parameter. Each body is one line of C text."""
        ends = np.cumsum((self.map.columns != 0.0).sum(axis=0)).reshape(self.count, -1)
        return tuple(", ".join(map(str, row)) for row in ends.tolist())

    @property
    def number_type(self) -> str:
        """C's type of places in the map."""
        return "unsigned short" if len(self.entries) < 2**16 else "unsigned"

    @property
    def masses(self) -> str:
        return numbers(self.map.masses, self.real)

    @property
    def coms(self) -> tuple[str, ...]:
        return tuple(numbers(row, self.real) for row in self.map.coms)

    @property
    def inertias(self) -> tuple[str, ...]:
        return tuple(numbers(row, self.real) for row in self.map.inertias)

    @property
    def theta_b(self) -> str:
        return numbers(self.map.theta_b, self.real)


@dataclass(frozen=True, slots=True, eq=False)
class PayloadView:
    """The functions of one robot that add a load to theta_b (the base parameters), as C text for float or double.

    matrices  (l, 10) each: factors from the ten inertial parameters of a load to the change of the l base parameters.
              The first is for a load at the tip, then there is one for each named frame
    """

    robot: str
    real: CReal
    matrices: tuple[Array, ...]

    @property
    def prototypes(self) -> tuple[Prototype, Prototype]:
        """Return the signatures of the functions for a load at the tip, and for one at a frame with a given number."""
        given = (f"{self.real} mass", f"const {self.real} *com", f"const {self.real} *inertia")
        load = (*given, f"{self.real} *theta_b")
        return (
            Prototype("void", f"{self.robot}_add_payload", load),
            Prototype("int", f"{self.robot}_add_payload_at", ("size_t frame", *load)),
        )

    @property
    def rows(self) -> tuple[tuple[str, ...], ...]:
        """Each matrix's rows as C text."""
        return tuple(tuple(numbers(row, self.real) for row in matrix.tolist()) for matrix in self.matrices)


# The estimator of a load


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
    return EstimatorView(robot, c_real(options), undeclared(kernel, info.sizes, robot, options))
