"""C code that CasADi generates from Pinocchio's algorithms, in two variants. A call of the first computes one state; a
call of the second computes several states, one per SIMD lane."""

from __future__ import annotations

import ctypes
from functools import lru_cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from psdmc.bench.case import MOST_DIFFERENTIATED, Case, robot_as_numbers
from psdmc.bench.contestant import Contestant, Unavailable, source
from psdmc.bench.machine import built, cxx, version_of
from psdmc.bench.measure import code_sizes
from psdmc.bench.rivals.pinocchio_cpp import (
    DEFINES,
    INSTANTIATED,
    SYMBOLS,
    includes,
    incomparable,
    outputs_of,
    pinocchio_prefix,
    standard_parameters,
    variant_of,
    ways_of,
)
from psdmc.errors import ToolchainError
from psdmc.toolchain.compiler_command import find_compiler

RIVAL = "CasADi"

WAYS = {
    **{name: (name,) for name in SYMBOLS},
    "forward_dynamics": ("forward_dynamics_aba", "forward_dynamics_ldl"),
    **{
        f"{name}_derivatives": (f"{name}_derivatives_jacobian", f"{name}_derivatives_recursion")
        for name in ("inverse_dynamics", "forward_dynamics")
    },
    "forward_dynamics_vjp": ("forward_dynamics_vjp_aba", "forward_dynamics_vjp_ldl"),
}
"""Its functions; forward dynamics by articulated bodies, or from M and h by L D L^T; derivatives by CasADi's own
differentiation of rnea and of the latter, or by Pinocchio's recursions; gradients by its reverse mode."""

FOURTH = frozenset(WAYS["inverse_dynamics_vjp"] + WAYS["forward_dynamics_vjp"])
"""Ways that read a fourth input, the cotangent."""


def contestants(case: Case, flags: tuple[str, ...]) -> list[Contestant | Unavailable]:
    """Return CasADi's functions for one robot, compiled."""
    generated, counts = written(case)
    found: list[Contestant | Unavailable] = []
    builds = {"state": _scalar} if case.named else {"state": _scalar, "lanes": _by_lane}
    for layout, build in builds.items():
        try:
            found += _entered(case, build(case, generated, flags), layout == "lanes", counts)
        except ToolchainError as error:
            found.append(Unavailable(f"{RIVAL} ({layout})", error.message))
    if case.named and case.costly:
        reason = f"its C of a robot with more than {MOST_DIFFERENTIATED} rates takes too long to compile"
        found.append(Unavailable(f"{RIVAL}, {', '.join(case.costly)}", reason))
    return [*found, *incomparable(case, RIVAL)]


def _entered(
    case: Case, library: Path, by_lane: bool, counts: dict[str, tuple[int, int]]
) -> list[Contestant]:
    sizes = {} if by_lane else code_sizes(library)
    return [
        Contestant(
            RIVAL,
            function,
            library,
            way,
            outputs_of(case, function),
            variant=variant_of(way, function),
            layout="lanes" if by_lane else "state",
            lanes=ctypes.CDLL(str(library)).lanes() if by_lane else 1,
            weights=standard_parameters(case) if function == "regressor" else None,
            operations=counts[way],
            code_bytes=sizes.get(way),
        )
        for function, ways in ways_of(case, WAYS).items()
        for way in ways
    ]


def written(case: Case) -> tuple[str, dict[str, tuple[int, int]]]:
    """Return CasADi's C code for a robot, with each function's numbers of (multiplications, additions)."""
    product = _generated(case)
    lines = (line.split() for line in product.with_suffix(".txt").read_text().splitlines())
    return product.read_text(), {name: (int(mul), int(add)) for name, mul, add in lines}


def symbolic(case: Case) -> Any:
    """Return Pinocchio's articulated-body algorithm as a casadi.Function (q, qd, tau) -> qdd. It was evaluated with
    CasADi's symbols in place of numbers."""
    import casadi

    return casadi.Function.load(str(_generated(case).with_suffix(".casadi")))


def _generated(case: Case) -> Path:
    """The C file that the writer makes; its other output is beside it."""
    writer = program_on_symbols("casadi_writer.cpp", source("casadi_writer.cpp"))
    command = [str(writer), "robot.txt", "generated", *_all_ways(case)]
    return built("generated.c", command, {"robot.txt": robot_as_numbers(case.chain)})


@lru_cache
def program_on_symbols(file: str, text: str) -> Path:
    """Compile a C++ program that runs Pinocchio on CasADi's symbols, from the name and text of its file. The text may
    include pinocchio_model.hpp and serial_joints.hpp. It is compiled once for all robots, unoptimised: it runs for a tenth
    of a second."""
    casadi, prefix = _casadi(), pinocchio_prefix()
    name = Path(file).stem
    sources = {file: text} | {each: source(each) for each in ("pinocchio_model.hpp", "serial_joints.hpp")}
    command = [cxx(), "-std=c++17", "-O0", "-DNDEBUG", INSTANTIATED, *DEFINES, *includes(prefix)]
    command += ["-isystem", str(casadi / "include"), file, "-o", name]
    command += [f"-L{prefix / 'lib'}", f"-L{casadi}", "-lcasadi", "-lpinocchio_default"]
    command += [f"-Wl,-rpath,{prefix / 'lib'}", f"-Wl,-rpath,{casadi}", f"-Wl,-rpath-link,{prefix / 'lib'}"]
    depends = [version_of("pin"), version_of("casadi")]
    return built(name, command, sources, depends)


def _casadi() -> Path:
    """The folder in which the casadi wheel keeps headers and libraries."""
    found = find_spec("casadi")
    if found is None or found.origin is None:
        raise ToolchainError("the wheel 'casadi' is not installed", "pip install casadi")
    folder = Path(found.origin).parent
    if not (folder / "include/casadi/casadi.hpp").is_file():
        raise ToolchainError("this CasADi came without C++ headers", "install the wheel 'casadi'")
    return folder


def _scalar(case: Case, generated: str, flags: tuple[str, ...]) -> Path:
    """The C as CasADi wrote it, compiled as C."""
    lines = ['#include "loops.hpp"', 'extern "C" {']
    lines += [f"int {way}(const double **, double **, int *, double *, int);" for way in _all_ways(case)]
    lines += ["}"]
    lines += [
        f"PSDMC_CONTESTANT({way}, []({_given(way)}) {{ "
        f"const double *in[] = {{{', '.join(_names(way))}}}; {way}(in, &out, nullptr, nullptr, 0); }})"
        for way in _all_ways(case)
    ]
    sources = {
        "generated.c": generated,
        "glue.cpp": "\n".join(lines) + "\n",
        "loops.hpp": source("loops.hpp"),
    }
    command = [
        *find_compiler().command,
        *flags,
        "-shared",
        "generated.c",
        "glue.cpp",
        "-o",
        "casadi.so",
        "-lm",
    ]
    return built("casadi.so", command, sources)


def _by_lane(case: Case, generated: str, flags: tuple[str, ...]) -> Path:
    """Compile the C as C++, with a vector as its number type."""
    size = {way: outputs_of(case, function) for function, ways in ways_of(case, WAYS).items() for way in ways}
    lines = [
        '#include "loops.hpp"',
        '#include "casadi_lanes.hpp"',
        "namespace casadi_c {",
        '#include "generated.c"',
        "}",
    ]
    lines += ["PSDMC_EXPORT int lanes() { return PSDMC_LANES; }"]
    lines += [
        f"PSDMC_BATCH_CONTESTANT({way}, [](std::size_t count, {_given(way)}) {{ "
        f"for (std::size_t i = 0; i < count; i += PSDMC_LANES) {{ const Lanes *in[] = {{"
        f"{', '.join(f'(const Lanes *)({name} + i * {_length(case, name)})' for name in _names(way))}}}; "
        f"Lanes *to = (Lanes *)(out + i * {size[way]}); "
        f"casadi_c::{way}(in, &to, nullptr, nullptr, 0); }} }})"
        for way in _all_ways(case)
    ]
    names = ("loops.hpp", "casadi_lanes.hpp")
    sources = {"generated.c": generated, "glue.cpp": "\n".join(lines) + "\n"} | {
        name: source(name) for name in names
    }
    command = [
        cxx(),
        "-std=c++17",
        "-w",
        *flags,
        "-shared",
        "glue.cpp",
        "-o",
        "casadi_lanes.so",
        "-lmvec",
        "-lm",
    ]
    return built("casadi_lanes.so", command, sources)


def _names(way: str) -> tuple[str, ...]:
    """Return the names of a way's inputs."""
    return ("q", "qd", "x", "y") if way in FOURTH else ("q", "qd", "x")


def _given(way: str) -> str:
    return ", ".join([*(f"const double *{name}" for name in _names(way)), "double *out"])


def _length(case: Case, name: str) -> int:
    return case.chain.nq if name == "q" else case.chain.nv


def _all_ways(case: Case) -> list[str]:
    return [way for ways in ways_of(case, WAYS).values() for way in ways]
