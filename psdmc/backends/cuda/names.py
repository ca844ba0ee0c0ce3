"""Names that CUDA takes, beside those that C and C++ take."""

from __future__ import annotations

from psdmc.backends.c.names import is_reserved
from psdmc.backends.names import identifier_of

LIBRARIES = frozenset(
    {"cuda", "cudart", "cudart_static", "cudadevrt", "culibos", "nvrtc", "nvptxcompiler_static"}
)
"""Libraries that nvcc and CMake link: a package's own library must not hide one of them."""


def identifier(name: str) -> str:
    """Return an identifier for `name`, which is no name of C, C++ or CUDA."""
    return identifier_of(name, lambda word: word.lower() in LIBRARIES or is_reserved(word))
