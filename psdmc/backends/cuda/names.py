"""Names that CUDA takes, beside those that C and C++ take."""

from __future__ import annotations

from psdmc.backends.c.render import is_reserved
from psdmc.backends.render import identifier_of
from psdmc.program.theta_rows import THETA_ROWS

LIBRARIES = frozenset(
    {"cuda", "cudart", "cudart_static", "cudadevrt", "culibos", "nvrtc", "nvptxcompiler_static"}
)
"""Libraries that nvcc and CMake link: a package's own library must not hide one of them."""


def symbol_of(robot: str, function: str) -> str:
    """Return the name of a function in CUDA, to which kernels add _states or _rows. NAME_theta_rows becomes NAME_thetas, as
    R_NAME_theta_rows is a kernel of NAME_theta."""
    stem = function.removesuffix(THETA_ROWS)
    return f"{robot}_{function if stem == function else f'{stem}_thetas'}"


def identifier(name: str) -> str:
    """Return an identifier for `name`, which is no name of C, C++ or CUDA."""
    return identifier_of(name, lambda word: word.lower() in LIBRARIES or is_reserved(word))
