"""Compile the libraries that psdmc is compared with in the benchmark, and keep the results in a cache."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from psdmc.errors import ToolchainError
from psdmc.target.presets import X86_64_V3
from psdmc.toolchain.cache import cache_key, cached
from psdmc.toolchain.compiler_command import find_compiler, run

CXX_CANDIDATES = ("c++", "g++", "clang++")


def native_flags() -> tuple[str, ...]:
    """Compiler flags that psdmc uses on this machine. The benchmark compiles all libraries with them."""
    return find_compiler().flags


def counted_flags() -> tuple[str, ...]:
    """Return the compiler flags for counting instructions. They permit AVX2 instructions but no AVX-512, which valgrind
    does not support. So counts are equal on all machines."""
    return (*find_compiler().portable, *X86_64_V3.flags)


def built(
    product: str, command: Sequence[str], sources: Mapping[str, str], depends: Sequence[str] = ()
) -> Path:
    """Run a command that makes the file `product` from source files, and return the path of this file. The sources are
    first written into a folder.

    command  argument list; it does not run if the cache has a result from equal content
    sources  text of each file by its path in the folder
    depends  what else the result depends on, such as versions of libraries

    Raise ToolchainError if the command fails or makes no such file.
    """

    def build(folder: Path) -> None:
        for path, text in sources.items():
            (folder / path).parent.mkdir(parents=True, exist_ok=True)
            (folder / path).write_text(text)
        run(command, product, str(folder))
        if not (folder / product).is_file():
            raise ToolchainError(
                f"{product}: {Path(command[0]).name} made no such file", "run the build by hand to see why"
            )

    return produced(build, sources, ("bench", product, *command, *depends)) / product


def produced(build: Callable[[Path], None], sources: Mapping[str, str], parts: Sequence[str]) -> Path:
    """Return the folder that `build` fills with compiled files; from the cache if possible. `parts` lists what the
    files depend on in addition to the sources, such as compiler flags."""
    compiler = find_compiler()
    target = [compiler.target] if any("native" in part for part in parts) else []
    return cached(cache_key(sources, (compiler.version, *target, *parts)), build)


def cxx() -> str:
    """Return the command of the C++ compiler, from $CXX or found. Raise ToolchainError if there is none."""
    chosen = os.environ.get("CXX")
    for name in [chosen] if chosen else CXX_CANDIDATES:
        if shutil.which(name):
            return name
    raise ToolchainError("no C++ compiler found", "install one (Debian: apt install g++) or set CXX")
