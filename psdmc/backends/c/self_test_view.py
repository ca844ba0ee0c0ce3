"""The package's self-test in the form that its templates print: calls, inputs, and the sizes of its buffers."""

from __future__ import annotations

from dataclasses import dataclass

from psdmc.backends.c.kernel_view import KernelView
from psdmc.backends.c.self_test import GivenVector, SelfCheck, given_vectors, self_checks
from psdmc.backends.options import EmitOptions
from psdmc.backends.self_test import TOLERANCES


@dataclass(frozen=True, slots=True)
class SelfTestView:
    """The self-test of one package.

    kernels  of all functions of the package
    dof      length of rates and torques
    known    labels of the outputs that have reference values
    beside   number of further C functions that it compares: for loads, bodies and friction
    """

    kernels: tuple[KernelView, ...]
    dof: int
    options: EmitOptions
    known: tuple[str, ...]
    beside: int

    @property
    def checks(self) -> tuple[SelfCheck, ...]:
        """The calls of every kernel. Calls without a reference value are marked."""
        return self_checks(self.kernels, self.dof, self.options, self.known)

    @property
    def functions(self) -> int:
        """The number of C functions whose values are compared: kernels, and functions for loads, bodies and friction."""
        return len({check.kernel for check in self.checks if check.expected}) + self.beside

    @property
    def load_tolerance(self) -> str:
        """Of the functions that give theta_b."""
        return TOLERANCES[self.options.real]

    @property
    def given(self) -> tuple[GivenVector, ...]:
        """The inputs of all kernels, by their names in the reference states."""
        return given_vectors(self.kernels, self.dof)

    @property
    def given_otherwise(self) -> bool:
        """Whether some input of the tested functions is not a vector with one entry per joint."""
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
