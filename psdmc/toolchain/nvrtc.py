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

    Raises ToolchainError if NVRTC is not installed, or does not know a GPU so old.
    """
    nvrtc = _opened()
    known = _architectures(nvrtc)
    older = [each for each in known if each <= arch]
    if not older:
        raise ToolchainError(
            f"NVRTC knows no GPU as old as compute capability {arch / 10}", "use an older NVRTC"
        )
    kind, what = ("sm", "CUBIN") if arch in known else ("compute", "PTX")
    program = ctypes.c_void_p()
    _checked(
        nvrtc, nvrtc.nvrtcCreateProgram(ctypes.byref(program), source.encode(), b"robot.cuh", 0, None, None)
    )
    try:
        words = (f"--gpu-architecture={kind}_{max(older)}".encode(), f"-D{definition}".encode())
        if nvrtc.nvrtcCompileProgram(program, len(words), (ctypes.c_char_p * len(words))(*words)):
            log = _read(nvrtc, program, "ProgramLog").decode(errors="replace")
            raise InternalError(f"NVRTC refuses generated code: {' '.join(log.split())[:500]}")
        return _read(nvrtc, program, what)
    finally:
        nvrtc.nvrtcDestroyProgram(ctypes.byref(program))


@cache
def _opened() -> Any:
    for name in _candidates():
        try:
            return ctypes.CDLL(name)
        except OSError:
            continue
    raise ToolchainError(
        'target "cuda" needs NVRTC, which is not installed',
        "pip install nvidia-cuda-nvrtc-cu12, or install CUDA",
    )


def _candidates() -> Iterator[str]:
    """Paths and names of the library, pip's wheels first."""
    spec = find_spec("nvidia")
    for folder in (spec and spec.submodule_search_locations) or ():
        yield from map(str, sorted(Path(folder).glob("*/lib/libnvrtc.so.1?")))
    yield from NAMES


def _architectures(nvrtc: Any) -> list[int]:
    count = ctypes.c_int()
    _checked(nvrtc, nvrtc.nvrtcGetNumSupportedArchs(ctypes.byref(count)))
    found = (ctypes.c_int * count.value)()
    _checked(nvrtc, nvrtc.nvrtcGetSupportedArchs(found))
    return list(found)


def _read(nvrtc: Any, program: ctypes.c_void_p, what: str) -> bytes:
    size = ctypes.c_size_t()
    _checked(nvrtc, getattr(nvrtc, f"nvrtcGet{what}Size")(program, ctypes.byref(size)))
    text = ctypes.create_string_buffer(size.value)
    _checked(nvrtc, getattr(nvrtc, f"nvrtcGet{what}")(program, text))
    return text.raw


def _checked(nvrtc: Any, status: int) -> None:
    if status:
        nvrtc.nvrtcGetErrorString.restype = ctypes.c_char_p
        raise ToolchainError(f"NVRTC: {nvrtc.nvrtcGetErrorString(status).decode()}", "install NVRTC again")
