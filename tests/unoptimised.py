"""Builds without optimisation, for tests that are about C and not about a compiler: a fifth of gcc's time."""

from __future__ import annotations

import shlex
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import pytest

from psdmc.backends.c.package import PackageView
from psdmc.target.presets import NATIVE
from psdmc.target.target import Target
from psdmc.toolchain import compile as toolchain
from psdmc.toolchain.compiler_command import Compiler, find_compiler


def unoptimised_compiler(target: Target = NATIVE) -> Compiler:
    """The compiler at hand with its flags, the last of which undoes -O3; instructions stay this machine's."""
    found = find_compiler(target)
    return replace(found, flags=(*found.flags, "-O0"))


@contextmanager
def without_optimisation() -> Iterator[None]:
    """Libraries compiled in this process inside are not optimised."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(toolchain, "find_compiler", unoptimised_compiler)
        yield


def compiled(package: PackageView, optimised: bool) -> Path:
    """The shared library of a package."""
    if optimised:
        return toolchain.compile_library(package)
    with without_optimisation():
        return toolchain.compile_library(package)


def wrapper(folder: Path) -> Path:
    """A program to name in CC, which the package's own build files then call, and which is `cc` where its folder comes first
    in PATH: the compiler without optimisation."""
    script = folder / "cc"
    program, *options = find_compiler().command
    words = [str(shutil.which(program)), *options]
    script.write_text(f'#!/bin/sh\nexec {shlex.join(words)} "$@" -O0\n', encoding="utf-8")
    script.chmod(0o755)
    return script
