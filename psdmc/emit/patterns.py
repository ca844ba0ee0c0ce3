"""Where matrices have entries that are not zero at every state: branches of a tree do not see each other."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from psdmc.emit.function_view import FunctionView
from psdmc.emit.tables import Table


@dataclass(frozen=True, slots=True)
class Pattern:
    """The entries of a function's matrix that may differ from zero, row by row.

    function  name of the function, whose one output is the matrix
    shape     rows and columns
    places    (row, column) of each
    """

    function: str
    shape: tuple[int, int]
    places: tuple[tuple[int, int], ...]

    @property
    def is_sparse(self) -> bool:
        return len(self.places) < self.shape[0] * self.shape[1]

    @property
    def macro(self) -> str:
        """Name of its length, without the robot's prefix."""
        return f"{self.function.upper()}_NONZEROS"

    def table(self, robot: str) -> Table:
        """The places as a constant array of pairs."""
        name = f"{self.function}_pattern"
        return Table(
            name,
            f"const unsigned short {robot}_{name}[{robot}_{self.macro}][2]",
            tuple(f"{{{row}, {column}}}" for row, column in self.places),
            f"std::array<unsigned short, 2>, {self.macro.lower()}",
            tuple(f"{{{{{row}, {column}}}}}" for row, column in self.places),
        )


def patterns(functions: Sequence[FunctionView]) -> Iterator[Pattern]:
    """Of every function that puts out one matrix.

    An entry is left out where every kernel of the function, with parameters compiled in and given at run time, has the
    constant zero in its place.
    """
    for function in functions:
        outputs = [kernel.outputs for kernel in function.kernels]
        if len(outputs[0]) != 1 or len(outputs[0][0].shape) != 2:
            continue
        rows, columns = outputs[0][0].shape
        zero = set.intersection(*(set(of_kernel.zero) for (of_kernel,) in outputs))
        kept = (k for k in range(rows * columns) if k not in zero)
        yield Pattern(function.name, (rows, columns), tuple(divmod(k, columns) for k in kept))
