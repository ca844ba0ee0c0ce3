"""The sparsity patterns of matrices, that is, which entries can differ from zero. In a tree robot, the entries of two
joints on different branches are zero."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from psdmc.backends.c.function_view import FunctionView
from psdmc.backends.c.tables import Table


@dataclass(frozen=True, slots=True)
class Pattern:
    """The entries of a function's output matrix that may differ from zero at some state, row by row.

    function   name of the function, which has no other output
    places     (row, column) of each entry
    is_packed  whether the function stores these entries only, one after the other
    is_sparse  whether the matrix has further entries, which are zero at every state
    """

    function: str
    places: tuple[tuple[int, int], ...]
    is_packed: bool
    is_sparse: bool

    @property
    def macro(self) -> str:
        """Return the name of the C macro for the number of entries that may differ from zero, without the robot's
        prefix."""
        return f"{self.function.upper()}_NONZEROS"

    def table(self, robot: str) -> Table:
        """Return the (row, column) pairs of the nonzero entries as a constant array."""
        name = f"{self.function}_pattern"
        return Table(
            name,
            f"const unsigned short {robot}_{name}[{robot}_{self.macro}][2]",
            tuple(f"{{{row}, {column}}}" for row, column in self.places),
            f"std::array<unsigned short, 2>, {self.macro.lower()}",
            tuple(f"{{{{{row}, {column}}}}}" for row, column in self.places),
        )


def patterns(functions: Sequence[FunctionView]) -> Iterator[Pattern]:
    """Yield the sparsity pattern (positions of nonzero entries) of every function whose only output is a matrix. The
    matrix may be stored with or without its zeros.

    In a matrix that is stored with zeros, an entry counts as zero if it is zero at every state. This must hold in all
    variants of the function, with compiled-in base parameters and with theta_b as an input.
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
