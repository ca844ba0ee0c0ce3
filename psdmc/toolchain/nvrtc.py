"""Compiles CUDA source to machine code for one kind of GPU by NVRTC, NVIDIA's compiler as a library. It needs no GPU."""

from __future__ import annotations

import ctypes
from collections.abc import Iterator
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from psdmc.errors import InternalError, ToolchainError

NAMES = ("libnvrtc.so.13", "libnvrtc.so.12", "libnvrtc.so")
"""Names of the library that the system may have; those of pip's wheels come first."""


def machine_code(source: str, definition: str, arch: int) -> bytes:
    """Return the machine code of a source without includes, compiled for one kind of GPU. If NVRTC is older than the GPU,
    the result is PTX (code of a virtual GPU), which the driver translates.

    definition  name of a macro that is defined
    arch        kind of GPU, ten times its compute capability: 90 for an H100

    Raises ToolchainError if NVRTC is not installed, or knows no GPU so old.
    """
    count, program = ctypes.c_int(), ctypes.c_void_p()
    _call("GetNumSupportedArchs", ctypes.byref(count))
    known = (ctypes.c_int * count.value)()
    _call("GetSupportedArchs", known)
    usable = [each for each in known if each <= arch]
    if not usable:
        raise ToolchainError(
            f"NVRTC knows no GPU as old as compute capability {arch / 10}", "install an older NVRTC"
        )
    kind, what = ("sm", "CUBIN") if arch in usable else ("compute", "PTX")
    given = (f"--gpu-architecture={kind}_{max(usable)}".encode(), f"-D{definition}".encode())
    _call("CreateProgram", ctypes.byref(program), source.encode(), b"robot.cuh", 0, None, None)
    try:
        words = (ctypes.c_char_p * len(given))(*given)
        if opened().nvrtcCompileProgram(program, len(given), words):
            log = _read(program, "ProgramLog").decode(errors="replace")
            raise InternalError(f"NVRTC refuses generated code: {' '.join(log.split())[:500]}")
        return _read(program, what)
    finally:
        opened().nvrtcDestroyProgram(ctypes.byref(program))


@cache
def opened() -> Any:
    """Return the library NVRTC. Raises ToolchainError if it is not installed."""
    for name in _candidates():
        try:
            return ctypes.CDLL(name)
        except OSError:
            continue
    hint = "pip install 'psdmc[cuda]', or install CUDA"
    raise ToolchainError('target "cuda" needs NVRTC, which is not installed', hint)


def _candidates() -> Iterator[str]:
    """Paths and names of the library, pip's wheels first."""
    spec = find_spec("nvidia")
    for folder in (spec and spec.submodule_search_locations) or ():
        yield from map(str, sorted(Path(folder).glob("*/lib/libnvrtc.so.1?")))
    yield from NAMES


def _read(program: ctypes.c_void_p, what: str) -> bytes:
    size = ctypes.c_size_t()
    _call(f"Get{what}Size", program, ctypes.byref(size))
    text = ctypes.create_string_buffer(size.value)
    _call(f"Get{what}", program, text)
    return text.raw


def _call(name: str, *given: Any) -> None:
    if status := getattr(opened(), f"nvrtc{name}")(*given):
        raise ToolchainError(f"nvrtc{name} failed with status {status}", "install NVRTC again")
