"""psdmc's own C packages. The benchmark calls their functions in the loops that call the functions of other libraries."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from functools import lru_cache
from itertools import accumulate
from pathlib import Path

from psdmc.backends.c.back_end import library_files
from psdmc.backends.c.package import PackageView, package_view
from psdmc.backends.info import EmitOptions, package_info
from psdmc.bench.case import BENCHED, MOST_DIFFERENTIATED, Case
from psdmc.bench.contestant import Contestant, Unavailable, source
from psdmc.bench.machine import built, cxx, produced
from psdmc.bench.measure import code_bytes, code_sizes
from psdmc.functions import RECIPES
from psdmc.lower.kernels import Lowering, lower
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.program.cost import cost
from psdmc.program.kernel import Kernel
from psdmc.program.limb_stages import whole_cost
from psdmc.program.signature import Signature, Sizes
from psdmc.recipes.recipe import Polynomials
from psdmc.toolchain.compiler_command import find_compiler, run

FUNCTIONS = BENCHED
"""The functions that the benchmark measures; see Case.functions."""

EXPANDED = tuple(
    name for name in FUNCTIONS if RECIPES[name].polynomials in (Polynomials.TORQUE, Polynomials.SOLVED)
)
"""The functions whose times PSDM-2021 and Denso-2022 published."""


LIBRARY = "library.so"
"""The package's own library, in a folder of its own."""

EXPANDED_LIMIT = 30_000
"""Monomials p up to which the expanded form is measured: beyond, lowering and compiling it takes many minutes."""


def factored(case: Case, flags: tuple[str, ...]) -> list[Contestant | Unavailable]:
    """The factored lowering, which users get."""
    found = contestants(case, "factored", case.functions, flags)
    reason = f"not measured where a robot has more than {MOST_DIFFERENTIATED} rates, this has {case.chain.nv}"
    return [*found, *([Unavailable(", ".join(case.left_out), reason)] if case.left_out else [])]


def expanded(case: Case, flags: tuple[str, ...]) -> list[Contestant | Unavailable]:
    """The expanded lowering, PSDM-2021's form."""
    if case.model.p is None:
        return [Unavailable("psdmc expanded", "this model was derived without E and P")]
    if case.model.p > EXPANDED_LIMIT:
        reason = f"p = {case.model.p:,} monomials: not lowered and compiled beyond {EXPANDED_LIMIT:,}, it takes too long"
        return [Unavailable("psdmc expanded", reason)]
    return [*contestants(case, "expanded", EXPANDED, flags)]


def contestants(
    case: Case, lowering: Lowering, functions: Sequence[str], flags: tuple[str, ...]
) -> list[Contestant]:
    """Return psdmc's functions for one robot in three memory layouts. The layouts are one state per call, many states
    one after the other (rows), and blocks with one state per SIMD lane."""
    kernels = kernels_of(case.model, lowering, tuple(functions))
    package = package_view(package_info(case.model, name="bench"), kernels, EmitOptions())
    library = compiled(package, flags)
    sizes = code_sizes(_library(library_files(package), package.sources, package.robot, flags) / LIBRARY)
    ways = (
        _ways(case, f"psdmc {lowering}", k, library, package.lanes, _code(package.robot, k.name, sizes))
        for k in kernels.values()
    )
    return [way for group in ways for way in group]


@lru_cache(maxsize=2)
def kernels_of(model: DynamicsModel, lowering: Lowering, functions: tuple[str, ...]) -> dict[str, Kernel]:
    """Return the kernels (variants of generated functions) of a robot. They are computed once for all compiler flags,
    because this takes longer than compiling."""
    return lower(model, lowering, functions, theta_variants=False)


def _code(robot: str, kernel: str, sizes: Mapping[str, int]) -> int | None:
    """Bytes of the function for one state and of the parts that a long one consists of."""
    own = re.compile(rf"{robot}_{kernel}|{kernel}_part_\d+")
    return code_bytes(sizes, lambda name: own.fullmatch(name) is not None)


def _ways(
    case: Case, rival: str, kernel: Kernel, library: Path, lanes: int, code: int | None
) -> list[Contestant]:
    name = kernel.name
    sections = _sections(kernel.function, case.sizes)
    size = sum(sections)
    weights = case.model.theta_b if RECIPES[name].times_theta else None
    single = cost(kernel.single) if kernel.limbs is None else whole_cost(kernel.limbs)
    batch = cost(kernel.batch)
    one = Contestant(
        rival, name, library, name, size,
        weights=weights, operations=(single.mul, single.add + single.div), code_bytes=code,
    )  # fmt: skip
    many = (batch.mul, batch.add + batch.div)
    rows = Contestant(
        rival, name, library, f"{name}_batch", size,
        layout="rows", sections=sections, weights=weights, operations=many,
    )  # fmt: skip
    by_lane = Contestant(
        rival, name, library, f"{name}_batch_soa", size,
        layout="lanes", lanes=lanes, sections=sections, weights=weights, operations=many,
    )  # fmt: skip
    return [one, rows, by_lane]


def compiled(package: PackageView, flags: tuple[str, ...]) -> Path:
    """Compile the C package and the loops into a shared library. Raise ToolchainError if that fails."""
    files = library_files(package)
    robot = package.robot
    home = _library(files, package.sources, robot, flags)
    header = next(path for path in files if path.startswith("include/") and path.endswith(".h"))
    sources = {"loops.hpp": source("loops.hpp"), "glue.cpp": glue(package), "library.h": files[header]}
    command = [cxx(), "-std=c++17", *flags, "-shared", "-I.", "glue.cpp", str(home / LIBRARY)]
    return built("contestant.so", [*command, "-o", "contestant.so"], sources)


def _library(files: dict[str, str], sources: tuple[str, ...], robot: str, flags: tuple[str, ...]) -> Path:
    """Folder of the package's own library, compiled file by file as toolchain/compile.py does."""
    command = (
        *find_compiler().command,
        "-std=c99",
        *flags,
        "-shared",
        "-Iinclude",
        *sources,
        "-o",
        LIBRARY,
    )

    def build(folder: Path) -> None:
        for path, text in files.items():
            (folder / path).parent.mkdir(parents=True, exist_ok=True)
            (folder / path).write_text(text)
        run((*command, "-lm"), robot, str(folder))

    return produced(build, files, ("bench", *command))


def glue(package: PackageView) -> str:
    """Return C++ code with one timing loop for each function of a package, in each memory layout."""
    lines = ['#include "loops.hpp"', '#include "library.h"']
    for view in package.functions:
        symbol, given = f"{package.robot}_{view.name}", _given(view.signature)
        sizes = _sections(view.signature, package.info.sizes)
        one, many = (", ".join(_arguments(view.signature, sizes, each)) for each in ("", "count * "))
        lines += [f"PSDMC_CONTESTANT({view.name}, []({given}) {{ {symbol}({one}); }})"]
        lines += [
            f"PSDMC_BATCH_CONTESTANT({view.name}{suffix}, [](size_t count, {given}) {{ {symbol}{suffix}(count, {many}); }})"
            for suffix in ("_batch", "_batch_soa")
        ]
    return "\n".join(lines) + "\n"


INPUTS = ("q", "qd", "x", "y")
"""A contestant's inputs; all have the first three."""


def _given(function: Signature) -> str:
    names = INPUTS[: max(3, len(function.inputs))]
    return ", ".join([*(f"const double *{name}" for name in names), "double *out"])


def _arguments(function: Signature, sizes: Sequence[int], each: str) -> list[str]:
    """The function's arguments: its inputs, and every output at its place in one array."""
    starts = [0, *accumulate(sizes[:-1])]
    outputs = [f"out + {each}{start}" if start else "out" for start in starts]
    return [*INPUTS[: len(function.inputs)], *outputs]


def _sections(function: Signature, sizes: Sizes) -> tuple[int, ...]:
    """Reals per state of each output."""
    return tuple(sizes.size(output) for output in function.outputs)
