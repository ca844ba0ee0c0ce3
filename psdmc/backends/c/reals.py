"""Range checks for the package's real type. Numbers that are too small for float32 are rounded without a warning, as in
C; numbers that are too large raise an error."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Literal

from psdmc.backends.info import PackageInfo
from psdmc.backends.options import EmitOptions
from psdmc.errors import InputError
from psdmc.program.kernel import Kernel

CReal = Literal["double", "float"]

LARGEST_FLOAT = math.ldexp(2.0 - 2.0**-23, 127)
SMALLEST_FLOAT = math.ldexp(1.0, -149)
"""The subnormal one; half of it and less rounds to zero."""

TOO_LARGE = LARGEST_FLOAT + math.ldexp(1.0, 103)
"""From this number on, numbers round to infinity: half a last digit beyond the largest."""


def c_real(options: EmitOptions) -> CReal:
    """The package's real type in C."""
    return "double" if options.real == "float64" else "float"


def rounded_out(value: float, real: str) -> float:
    """Return the value to which a number outside the range of the C type `real` is rounded: infinity, the largest
    number, or zero. Any other number is returned unchanged."""
    if real == "double" or math.isnan(value):
        return value
    if abs(value) >= TOO_LARGE:
        return math.copysign(math.inf, value)
    if abs(value) > LARGEST_FLOAT:
        return math.copysign(LARGEST_FLOAT, value)
    return math.copysign(0.0, value) if abs(value) <= SMALLEST_FLOAT / 2 else value


def check_range(info: PackageInfo, kernels: Mapping[str, Kernel], real: str) -> None:
    """Raise InputError if a base parameter, gravity or a constant in the generated code is too large for the C type
    `real`.

    Joint limits are not checked. A limit that is too large for `real` is no limit, and is written as infinite.
    """
    numbers = [("gravity", value) for value in info.gravity]
    numbers += [
        (f"base parameter {parameter.equation!r}", parameter.value)
        for parameter in info.parameters
        if parameter.value is not None
    ]
    numbers += [
        (f"a constant of {name}", value) for name, kernel in kernels.items() for value in _constants(kernel)
    ]
    for what, value in numbers:
        if math.isinf(rounded_out(value, real)):
            raise InputError(
                f"{info.name}: {what} is {value:.6g}, more than float32's {LARGEST_FLOAT:.6g}",
                "emit it with --real float64, or check the robot's units",
            )


def _constants(kernel: Kernel) -> Iterable[float]:
    stages = kernel.limbs.stages if kernel.limbs else ()
    for program in (kernel.single, kernel.batch, *(stage.program for stage in stages)):
        for instr in program:
            if instr.value is not None:
                yield instr.value
    for group in kernel.limbs.groups if kernel.limbs else ():
        yield from (value for row in group.constants for value in row)
