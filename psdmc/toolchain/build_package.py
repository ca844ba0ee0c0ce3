"""An emitted package, built by its own build files and put through its own test."""

from __future__ import annotations

import shutil
from pathlib import Path

from psdmc.errors import InputError, ToolchainError
from psdmc.toolchain.compiler_command import find_compiler, run


def build_package(directory: str | Path) -> str:
    """Build under DIR/build, run the self-test, and return what the tools printed.

    CMake where there is one, else make. InputError where DIR holds no package; ToolchainError where a tool is
    missing or fails.
    """
    root = Path(directory)
    if not (root / "manifest.json").is_file() or not (root / "CMakeLists.txt").is_file():
        raise InputError(f"{root}: no emitted package (no manifest.json)", "make one with psdmc emit-c")
    compiler = find_compiler().command
    if shutil.which("cmake"):
        return _with_cmake(root)
    if shutil.which("make"):
        return _with_make(root, compiler)
    raise ToolchainError("neither cmake nor make was found", "install one (Debian: apt install cmake)")


def _with_cmake(root: Path) -> str:
    """CMake honours CC on its own."""
    build = str(root / "build")
    steps = [
        ["cmake", "-S", str(root), "-B", build, "-DCMAKE_BUILD_TYPE=Release"],
        ["cmake", "--build", build, "--parallel"],
        ["ctest", "--test-dir", build, "--output-on-failure", "--verbose"],
    ]
    return "".join(run(step, str(root)) for step in steps)


def _with_make(root: Path, compiler: tuple[str, ...]) -> str:
    return run(["make", "-C", str(root), f"CC={' '.join(compiler)}", "all", "check"], str(root))
