"""The extension module that calls compiled functions from Python with little overhead. It is compiled once on each
machine.

The module needs Python's C headers. If the module cannot be compiled or loaded, calls go through cffi and take some
microseconds longer. The results are the same, bit for bit.
"""

from __future__ import annotations

import importlib.util
import os
import sys
import sysconfig
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from importlib.machinery import ExtensionFileLoader
from pathlib import Path
from typing import Any

import numpy as np

from psdmc.errors import ToolchainError
from psdmc.toolchain.cache import cache_key, cached
from psdmc.toolchain.compiler_command import find_compiler, run

MODULE = "psdmc_direct_call"
SOURCE = Path(__file__).with_name("direct_call.c")
ARRAYS = Path(__file__).with_name("called_arrays.h")
PRODUCT = f"{MODULE}.so"

VARIABLE = "PSDMC_DIRECT_CALLS"
"""Environment variable: 0 turns direct calls off."""

FLAGS = ("-std=c99", "-O2", "-fPIC", "-shared")

MOST_ARRAYS, MOST_UNITS = 20, 64
"""Of one function, as the C sources have them (MOST_CALLED, MOST_UNITS)."""


@dataclass(frozen=True, slots=True)
class DirectCalls:
    """The result of the test whether the extension module for direct calls works on this machine.

    make    the type of callable objects: DirectCall(slow, address, failures, is_single, inputs, outputs, result, units,
            theta_address, parameters); None if the module does not work. `failures`: 0, no state can fail; 1, the
            results of a failed state are NaN; 2, the function `slow` repeats a failed call and raises an error
    reason  why the module does not work, for people; empty if it works
    remedy  what the user can do about the reason
    """

    make: Callable[..., Any] | None
    reason: str = ""
    remedy: str = ""


def direct_calls() -> DirectCalls:
    """Return whether direct calls work; compile the extension if needed. Never raises an error."""
    if os.environ.get(VARIABLE, "").strip() == "0":
        return DirectCalls(None, f"{VARIABLE} is 0", f"unset {VARIABLE}")
    return _found()


@cache
def _found() -> DirectCalls:
    headers = Path(sysconfig.get_path("include"))
    if sys.implementation.name != "cpython" or sys.platform == "win32":
        reason = f"not made for {sys.implementation.name} on {sys.platform}"
        return DirectCalls(None, reason, "use CPython on Linux")
    if not (headers / "Python.h").is_file():
        return DirectCalls(None, f"no Python.h in {headers}", "apt install python3-dev")
    try:
        path = _library(headers)
        loader = ExtensionFileLoader(MODULE, str(path))
        spec = importlib.util.spec_from_file_location(MODULE, path, loader=loader)
        if spec is None:
            raise ImportError(f"{path} is no extension module")
        module = importlib.util.module_from_spec(spec)
        loader.exec_module(module)
        return DirectCalls(module.DirectCall)
    except (ToolchainError, ImportError, OSError) as error:
        return DirectCalls(
            None, str(error), getattr(error, "hint", None) or "set CC to a compiler that works here"
        )


def _library(headers: Path) -> Path:
    """The compiled module, from the cache or compiled now."""
    # An extension module takes Python's own functions from the process that loads it.
    loose = ("-undefined", "dynamic_lookup") if sys.platform == "darwin" else ()
    words = (*FLAGS, *loose, f"-I{headers}", f"-I{np.get_include()}")
    return called_from(SOURCE, PRODUCT, words, ("direct calls", sys.version, np.__version__))


def called_from(source: Path, product: str, words: Sequence[str], parts: Sequence[str]) -> Path:
    """Return the path of the shared library made from a C file of psdmc that calls robots' functions. The library comes
    from the compile cache or is newly compiled.

    words  arguments for the compiler, after psdmc's own arguments
    parts  what the library depends on besides the C file; the first part names the library in messages
    """
    texts = {path.name: path.read_text(encoding="utf-8") for path in (source, ARRAYS)}
    compiler = find_compiler()
    command = [*compiler.command, *words]

    def build(folder: Path) -> None:
        for name, text in texts.items():
            (folder / name).write_text(text, encoding="utf-8", newline="\n")
        run([*command, source.name, "-o", product], parts[0], str(folder))

    key = cache_key(texts, (*parts, *command, *compiler.identity))
    return cached(key, build, [product]) / product
