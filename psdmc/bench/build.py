"""Compile what the benchmark needs besides psdmc's own packages; results are kept by content."""

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
    """psdmc's own flags on this machine, for every contestant that is compiled here."""
    return find_compiler().flags


def counted_flags() -> tuple[str, ...]:
    """psdmc's own flags for counting instructions: valgrind has no AVX-512, and every x86-64 machine counts the same."""
    return (*find_compiler().portable, *X86_64_V3.flags)


def built(
    product: str, command: Sequence[str], sources: Mapping[str, str], depends: Sequence[str] = ()
) -> Path:
    """Path of the file `product` that `command` makes in a folder that holds `sources`.

    command  argument list; runs only where no earlier result came from the same content
    sources  path inside the folder to text
    depends  what else the result depends on, such as versions of libraries

    ToolchainError where the command fails or makes no such file.
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
    """The folder that `build` fills, from the cache or filled now; `parts` are what it depends on besides sources."""
    compiler = find_compiler()
    target = [compiler.target] if any("native" in part for part in parts) else []
    return cached(cache_key(sources, (compiler.version, *target, *parts)), build)


def cxx() -> str:
    """The C++ compiler: $CXX or what the machine has; ToolchainError where there is none."""
    chosen = os.environ.get("CXX")
    for name in [chosen] if chosen else CXX_CANDIDATES:
        if shutil.which(name):
            return name
    raise ToolchainError("no C++ compiler found", "install one (Debian: apt install g++) or set CXX")
