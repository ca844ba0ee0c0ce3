"""C code that CppADCodeGen generates. CppAD records the operations of Pinocchio's algorithms, as in Pinocchio's own
code generation, and CppADCodeGen writes these operations as C."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path

from psdmc.bench.case import Case, robot_as_numbers
from psdmc.bench.contestant import Contestant, source
from psdmc.bench.machine import built, cxx, version_of
from psdmc.bench.measure import code_sizes
from psdmc.bench.rivals.pinocchio_cpp import (
    DEFINES,
    includes,
    outputs_of,
    pinocchio_prefix,
    variant_of,
    ways_of,
)
from psdmc.errors import ToolchainError
from psdmc.toolchain.compiler_command import find_compiler

RIVAL = "CppADCodeGen"

WAYS = {
    "inverse_dynamics": ("inverse_dynamics",),
    "forward_dynamics": ("forward_dynamics",),
    "mass_matrix": ("mass_matrix",),
    **{
        f"{name}_derivatives": (f"{name}_derivatives_jacobian", f"{name}_derivatives_recursion")
        for name in ("inverse_dynamics", "forward_dynamics")
    },
}
"""Its functions; derivatives by CppAD's differentiation of rnea and aba, or by Pinocchio's recursions."""


def contestants(case: Case, flags: tuple[str, ...]) -> list[Contestant]:
    """Return CppADCodeGen's functions for one robot, compiled. Raise ToolchainError if its wheel is missing."""
    ways_by_function = ways_of(case, WAYS)
    every = [way for ways in ways_by_function.values() for way in ways]
    library = _library(written(case), every, flags)
    sizes = code_sizes(library)
    return [
        Contestant(
            RIVAL,
            function,
            library,
            way,
            outputs_of(case, function),
            variant=variant_of(way, function),
            code_bytes=sizes.get(way),
        )
        for function, ways in ways_by_function.items()
        for way in ways
    ]


def written(case: Case) -> str:
    """CppADCodeGen's C for the case."""
    every = [way for ways in ways_of(case, WAYS).values() for way in ways]
    command = [str(_writer()), "robot.txt", "generated.c", *every]
    return built("generated.c", command, {"robot.txt": robot_as_numbers(case.chain)}).read_text()


@lru_cache
def _writer() -> Path:
    """The program that writes C; compiled once for all robots, unoptimised: a minute of templates."""
    prefix = pinocchio_prefix()
    if not (prefix / "include/cppad/cg.hpp").is_file():
        raise ToolchainError(
            "the wheel 'cmeel-cppadcodegen' is not installed", "pip install cmeel-cppadcodegen"
        )
    names = ("cppadcg_writer.cpp", "pinocchio_model.hpp", "serial_joints.hpp")
    command = [cxx(), "-std=c++17", "-O0", "-DNDEBUG", *DEFINES, *includes(prefix)]
    command += [
        "cppadcg_writer.cpp",
        "-o",
        "cppadcg_writer",
        f"-L{prefix / 'lib'}",
        "-lpinocchio_default",
        "-ldl",
    ]
    command += [f"-Wl,-rpath,{prefix / 'lib'}", f"-Wl,-rpath-link,{prefix / 'lib'}"]
    depends = [version_of("pin"), version_of("cmeel-cppadcodegen")]
    return built("cppadcg_writer", command, {name: source(name) for name in names}, depends)


def _library(generated: str, every: Sequence[str], flags: tuple[str, ...]) -> Path:
    """The C as it was written, compiled as C, behind the loops."""
    given = "const double *q, const double *qd, const double *x, double *out"
    lines = ['#include "loops.hpp"', 'extern "C" {', *(f"void {way}({given});" for way in every), "}"]
    lines += [f"PSDMC_CONTESTANT({way}, []({given}) {{ {way}(q, qd, x, out); }})" for way in every]
    sources = {
        "generated.c": generated,
        "glue.cpp": "\n".join(lines) + "\n",
        "loops.hpp": source("loops.hpp"),
    }
    compiler = find_compiler().command
    command = [*compiler, *flags, "-shared", "generated.c", "glue.cpp", "-o", "cppadcg.so", "-lm"]
    return built("cppadcg.so", command, sources)
