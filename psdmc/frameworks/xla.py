"""Makes functions of compiled robots callable from XLA programs on a CPU. The C code in psdmc/frameworks/xla_call.c is
compiled once on each machine."""

from __future__ import annotations

import ctypes
import hashlib
from functools import cache
from pathlib import Path

import jax
import jaxlib

from psdmc.errors import InternalError, ToolchainError
from psdmc.toolchain.direct_calls import MOST_ARRAYS, called_from

SOURCE = Path(__file__).with_name("xla_call.c")
PRODUCT = "psdmc_xla_call.so"
TARGET = "psdmc_call"
"""Name of the custom call, for all functions of all robots."""

FLAGS = ("-std=c11", "-O2", "-fPIC", "-shared")
BITS = 63
"""Of a function's number, which C compares as a signed one."""


def number_of(key: str) -> int:
    """Return the number by which XLA programs find the function named `key`, equal in every process."""
    return int.from_bytes(hashlib.sha256(key.encode()).digest()[:8], "big") >> (64 - BITS)


def add(
    number: int, address: int, can_fail: bool, is_single: bool, theta: int | None, sizes: tuple[int, ...]
) -> None:
    """Register a batch function (one call for many states) with XLA under a number. The library of the function must
    stay loaded as long as XLA can call it.

    theta  index of theta_b among the arrays, or None
    sizes  number of entries of each array per state, in the order inputs, theta_b, outputs; of theta_b all entries
    """
    place, counts = -1 if theta is None else theta, (ctypes.c_int64 * len(sizes))(*sizes)
    if not _library().psdmc_xla_add(
        ctypes.c_int64(number), ctypes.c_size_t(address), can_fail, is_single, len(sizes), place, counts
    ):
        raise InternalError(
            f"a function of {len(sizes)} arrays, of {MOST_ARRAYS} at most, or no memory for one"
        )


@cache
def _library() -> ctypes.PyDLL:
    words = (*FLAGS, f"-I{jax.ffi.include_dir()}")
    path = called_from(SOURCE, PRODUCT, words, ("calls from XLA", jaxlib.__version__))
    try:
        library = ctypes.PyDLL(str(path))  # its calls hold the GIL, so they come one at a time
    except OSError as error:
        raise ToolchainError(
            f"the library that XLA calls cannot be loaded: {error}", "set CC to a compiler that works here"
        ) from error
    capsule = jax.ffi.pycapsule(library.psdmc_xla_call)
    jax.ffi.register_ffi_target(TARGET, capsule, platform="cpu")
    return library
