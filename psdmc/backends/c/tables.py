"""Constant tables of the C package: joint names and limits, gravity, base parameters; sparsity patterns."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

from psdmc.backends.c.expressions import number, rounded_out
from psdmc.backends.c.kernel_view import FunctionView
from psdmc.backends.c.render import c_string
from psdmc.backends.info import PackageInfo


@dataclass(frozen=True, slots=True)
class Table:
    """One constant array in C that is also a constexpr member of the C++ class.

    name         without the robot's prefix
    declaration  in C, without `extern`
    entries      values as C text
    cpp_type     element type and length in C++, such as 'Real, dof'
    cpp_entries  values as C++ text
    is_text      whether the entries are strings
    """

    name: str
    declaration: str
    entries: tuple[str, ...]
    cpp_type: str
    cpp_entries: tuple[str, ...]
    is_text: bool = False


def tables(
    info: PackageInfo, robot: str, real: str, with_frames: bool = False, with_texts: bool = True
) -> tuple[Table, ...]:
    """Return all constant tables of a package, in the order of the C header. Tables of strings, such as joint names,
    are left out if `with_texts` is false (small machines)."""
    lengths = {"dof": f"{robot}_DOF", "base_parameters": f"{robot}_BASE_PARAMETERS", "3": "3"}
    lengths |= {"frames": f"{robot}_FRAMES", "joints": f"{robot}_JOINTS"}

    def numbers(name: str, length: str, values: Iterable[float | None]) -> Table:
        kept = tuple(values)
        entries = tuple(number(value, real) for value in kept)
        cpp_entries = tuple(_cpp_number(value, real) for value in kept)
        declaration = f"const {real} {robot}_{name}[{lengths[length]}]"
        return Table(name, declaration, entries, f"Real, {length}", cpp_entries)

    def texts(name: str, length: str, values: Iterable[str]) -> Table:
        entries = tuple(map(c_string, values))
        declaration = f"const char *const {robot}_{name}[{lengths[length]}]"
        return Table(name, declaration, entries, f"const char *, {length}", entries, is_text=True)

    joints, parameters = info.joints, info.parameters
    frames = (texts("frame_names", "frames", info.frames),) if with_frames else ()
    each = "joints" if info.is_wide else "dof"
    every = (
        texts("joint_names", each, (joint.name for joint in joints)),
        texts("joint_units", each, (joint.unit for joint in joints)),
        numbers("position_lower", each, (joint.lower for joint in joints)),
        numbers("position_upper", each, (joint.upper for joint in joints)),
        numbers("speed_limit", each, (joint.speed for joint in joints)),
        numbers("acceleration_limit", each, (joint.acceleration for joint in joints)),
        numbers("effort_limit", each, (joint.effort for joint in joints)),
        numbers("gravity_acceleration", "3", info.gravity),
        numbers("theta_b", "base_parameters", (parameter.value for parameter in parameters)),
        texts("base_parameter_equations", "base_parameters", (p.equation for p in parameters)),
        texts("base_parameter_units", "base_parameters", (p.unit for p in parameters)),
        *frames,
    )
    return every if with_texts else tuple(table for table in every if not table.is_text)


def _cpp_number(value: float | None, real: str) -> str:
    """A real constant in C++, where C's macros would be old-style casts."""
    if value is None or math.isnan(value):
        return "std::numeric_limits<Real>::quiet_NaN()"
    value = rounded_out(value, real)
    if math.isinf(value):
        return f"{'-' if value < 0 else ''}std::numeric_limits<Real>::infinity()"
    return number(value, real)


# Sparsity patterns of matrices
#
# They say which entries can differ from zero. In a tree robot, the entries of two joints on different
# branches are zero.


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
        """Return the name of the C macro for the number of entries that may differ from zero, without the prefix."""
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
