"""A compiled package's C functions, called as they are: any variant, on raw arrays."""

from __future__ import annotations

import subprocess
from collections.abc import Mapping, Sequence
from pathlib import Path

import cffi
import numpy as np

from psdmc.backends.c.back_end import library_files
from psdmc.backends.c.package import PackageView
from psdmc.program.interpret import interpret
from psdmc.program.kernel import Kernel
from psdmc.program.signature import Sizes


def write_sources(package: PackageView, folder: Path) -> Path:
    for path, text in library_files(package).items():
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / path).write_text(text)
    return folder


def shared_library(package: PackageView, folder: Path, flags: Sequence[str], compiler: str = "gcc") -> Path:
    write_sources(package, folder)
    sources = [str(folder / source) for source in package.sources]
    library = folder / "library.so"
    words = [compiler, "-std=c99", *flags, "-fPIC", "-shared", f"-I{folder}/include", *sources, "-lm"]
    subprocess.run([*words, "-o", str(library)], check=True)
    return library


def declarations(package: PackageView) -> str:
    """C declarations for cffi of all that a package exports: tables and functions, without macros."""
    sizes = package.size_macros | {"DOF": package.dof, "BASE_PARAMETERS": package.l}
    sizes |= {"FRAMES": len(package.info.frames)}
    lines = list(package.table_declarations)
    for name, value in sizes.items():
        lines = [line.replace(f"[{package.robot}_{name}]", f"[{value}]") for line in lines]
    for kernel in package.kernels:
        lines += [prototype.text for prototype in kernel.prototypes.values()]
    lines += [prototype.text for prototype in package.payload.prototypes] if package.payload else []
    lines += [package.bodies.prototype.text] if package.bodies else []
    lines += [package.friction.prototype.text] if package.friction else []
    return "".join(f"{line};\n" for line in lines)


class Direct:
    """`call(symbol suffix, arguments)`; arrays become pointers, everything else goes through."""

    def __init__(self, package: PackageView, library: Path) -> None:
        self.ffi = cffi.FFI()
        self.ffi.cdef(declarations(package))
        self.library = self.ffi.dlopen(str(library))
        self.package = package

    def __call__(self, name: str, *arguments: object) -> object:
        return getattr(self.library, f"{self.package.robot}_{name}")(*map(self._plain, arguments))

    def _plain(self, argument: object) -> object:
        if isinstance(argument, np.ndarray):
            return self.ffi.from_buffer(f"{self.package.real} *", argument)
        return argument


def states(
    kernel: Kernel, count: int, n: int, l: int, seed: int = 7, frames: int = 1
) -> dict[str, np.ndarray]:
    """Random inputs of a kernel, rows of n; theta_b (l,) where it takes one."""
    random = np.random.default_rng(seed)
    sizes = Sizes.of_chain(n, l, frames)
    given = {q.name: random.normal(size=(count, sizes.size(q))) for q in kernel.function.inputs}
    if kernel.theta:
        given["theta_b"] = random.normal(size=l)
    return given


def expected(kernel: Kernel, given: Mapping[str, np.ndarray], n: int, l: int) -> np.ndarray:
    """The interpreted PROGRAM's first output, one row per state; NaN where a pivot is not positive."""
    (first, *_) = all_expected(kernel, given, n, l).values()
    return first


def all_expected(
    kernel: Kernel, given: Mapping[str, np.ndarray], n: int, l: int, frames: int = 1
) -> dict[str, np.ndarray]:
    """Every output of the interpreted PROGRAM, rows of states; NaN where what must be positive is not."""
    function = kernel.function
    values = interpret(kernel.single, given, function.sizes(Sizes.of_chain(n, l, frames)))
    if function.pivots:
        failed = ~(values.pop(function.pivots.name) > 0).all(axis=-1)
        for rows in values.values():
            rows[failed] = np.nan
    return values


def error(found: np.ndarray, reference: np.ndarray) -> float:
    """Largest difference relative to the largest reference value; NaN must meet NaN."""
    assert np.array_equal(np.isnan(found), np.isnan(reference))
    return float(
        np.nanmax(np.abs(found - reference), initial=0.0) / np.nanmax(np.abs(reference), initial=1e-300)
    )
