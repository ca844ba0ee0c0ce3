"""Where matrices have entries that are not zero at every state: branches of a tree do not see each other."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from psdmc.backends.c.function_view import FunctionView
from psdmc.backends.c.tables import Table


@dataclass(frozen=True, slots=True)
class Pattern:
    """The entries of a function's matrix that may differ from zero, row by row.

    function   name of the function, whose one output is the matrix
    places     (row, column) of each
    is_packed  whether these entries are all that it puts out
    is_sparse  whether the matrix has others
    """

    function: str
    places: tuple[tuple[int, int], ...]
    is_packed: bool
    is_sparse: bool

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
    """Of every function that puts out one matrix, packed or not.

    An entry of one that is not is left out where every kernel of the function, with parameters compiled in and given at
    run time, has the constant zero in its place.
    """
    for function in functions:
        if function.kernels[0].places:
            yield Pattern(function.name, function.kernels[0].places, is_packed=True, is_sparse=True)
            continue
        outputs = [kernel.outputs for kernel in function.kernels]
        if len(outputs[0]) != 1 or len(outputs[0][0].shape) != 2:
            continue
        rows, columns = outputs[0][0].shape
        zero = set.intersection(*(set(of_kernel.zero) for (of_kernel,) in outputs))
        kept = (k for k in range(rows * columns) if k not in zero)
        places = tuple(divmod(k, columns) for k in kept)
        yield Pattern(function.name, places, is_packed=False, is_sparse=bool(zero))
