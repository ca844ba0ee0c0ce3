"""The self-test of a package as data for its templates: function calls, inputs, and the sizes of buffers."""

from __future__ import annotations

from dataclasses import dataclass

from psdmc.backends.c.kernel_view import KernelView
from psdmc.backends.c.self_test import GivenVector, SelfCheck, given_vectors, self_checks
from psdmc.backends.options import EmitOptions
from psdmc.backends.self_test import TOLERANCES


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
        """Return the comparison of each output of each kernel (one variant of a generated function). Outputs without
        expected values are marked."""
        return self_checks(self.kernels, self.dof, self.options, self.known)

    @property
    def functions(self) -> int:
        """Return the number of C functions whose values the self-test compares: kernels (variants of generated
        functions), and functions for loads, bodies and friction."""
        return len({check.kernel for check in self.checks if check.expected}) + self.beside

    @property
    def load_tolerance(self) -> str:
        """Of the functions that give theta_b."""
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
