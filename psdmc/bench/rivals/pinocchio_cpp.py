"""Pinocchio in C++ in two builds. One is linked to the library of the Python wheel, as users have it; the other is
compiled from the headers alone for this processor."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from importlib.util import find_spec
from pathlib import Path
from typing import Literal

import numpy as np

from psdmc.bench.case import Case, robot_as_numbers
from psdmc.bench.contestant import Contestant, Unavailable, source
from psdmc.bench.machine import built, cxx, version_of
from psdmc.bench.states import output_sizes
from psdmc.dynamics.parameters import joint_frame_map
from psdmc.errors import ToolchainError
from psdmc.robot.mechanism import DRIVE, Array
from psdmc.target.presets import NATIVE
from psdmc.target.target import GCC_ONLY

Way = Literal["library", "header-only"]

SYMBOLS = {
    "inverse_dynamics": ("inverse_dynamics",),
    "forward_dynamics": ("forward_dynamics_local", "forward_dynamics_world"),
    "mass_matrix": ("mass_matrix_local", "mass_matrix_world"),
    "mass_matrix_inverse": ("mass_matrix_inverse",),
    "nonlinear_effects": ("nonlinear_effects",),
    "gravity": ("gravity",),
    "regressor": ("regressor",),
    "inverse_dynamics_derivatives": ("inverse_dynamics_derivatives",),
    "forward_dynamics_derivatives": ("forward_dynamics_derivatives",),
    "inverse_dynamics_vjp": ("inverse_dynamics_vjp",),
    "forward_dynamics_vjp": ("forward_dynamics_vjp",),
}

DEFINES = (
    "-DBOOST_MPL_LIMIT_LIST_SIZE=30",
    "-DBOOST_MPL_LIMIT_VECTOR_SIZE=30",
    "-DBOOST_MPL_CFG_NO_PREPROCESSED_HEADERS",
    "-DBOOST_FUSION_INVOKE_MAX_ARITY=12",
)
"""How the wheel's library was compiled: Pinocchio's variant of joints outgrows Boost's defaults."""


INSTANTIATED = "-DPINOCCHIO_ENABLE_TEMPLATE_INSTANTIATION"
"""Use the library's own instantiations, as its users do: compiles in seconds, runs as shipped."""


def library(case: Case, flags: tuple[str, ...]) -> list[Contestant | Unavailable]:
    """Return Pinocchio's functions for one robot, linked to the library in the wheel, as most users have it."""
    return contestants(case, "Pinocchio", compiled("library", flags))


def header_only(case: Case, flags: tuple[str, ...]) -> list[Contestant | Unavailable]:
    """Return Pinocchio's functions for one robot, compiled from its headers with all instructions of this processor."""
    return contestants(case, "Pinocchio header-only", compiled("header-only", flags))


def contestants(case: Case, rival: str, compiled_library: Path) -> list[Contestant | Unavailable]:
    """Pinocchio's algorithms for one robot."""
    robot = robot_as_numbers(case.chain)
    found: list[Contestant | Unavailable] = [
        Contestant(
            rival,
            function,
            compiled_library,
            symbol,
            outputs_of(case, function),
            variant=variant_of(symbol, function),
            robot=robot,
            weights=standard_parameters(case) if function == "regressor" else None,
        )
        for function in case.functions
        if is_comparable(case, function)
        for symbol in SYMBOLS[function]
    ]
    return [*found, *incomparable(case, rival)]


def ways_of(case: Case, ways: Mapping[str, tuple[str, ...]]) -> dict[str, tuple[str, ...]]:
    """Return, by function, the algorithms of a library that compute what psdmc computes for this robot.

    ways  the algorithms of the library by function

    Some tools differentiate C code by the entries of q, but psdmc differentiates by rates. Both derivatives differ for
    joints with several coordinates, such as a floating base. For such a robot, the algorithms of these tools are left
    out.
    """
    return {
        function: tuple(way for way in ways[function] if not (case.is_wide and way.endswith(BY_COORDINATES)))
        for function in case.functions
        if function in ways and is_comparable(case, function) and function not in case.costly
    }


BY_COORDINATES = ("_jacobian", "_vjp", "_vjp_aba", "_vjp_ldl")
"""Endings of ways that differentiate by the entries of q."""


def variant_of(symbol: str, function: str) -> str:
    """Return an algorithm's name for tables: the part of the C name that psdmc's function does not have."""
    return symbol.removeprefix(function).strip("_").upper()


def outputs_of(case: Case, function: str) -> int:
    """Return the number of output values per state for a function of another library. It equals the number for psdmc
    except for regressors, which have ten columns for each body instead of one for each base parameter."""
    return 10 * case.n * case.chain.nv if function == "regressor" else sum(output_sizes(function, case.sizes))


def is_comparable(case: Case, function: str) -> bool:
    """Return whether another library's function computes the same result as psdmc's for this robot. A regressor does
    not if the robot has drive inertia."""
    return function != "regressor" or not case.has_drive_inertia


def incomparable(case: Case, rival: str) -> list[Unavailable]:
    """Return a library's functions that compute something else for this robot, with the reason."""
    if not case.has_drive_inertia:
        return []
    return [Unavailable(f"{rival}, regressor", "it has no columns for drive inertia, which this robot has")]


def compiled(way: Way, flags: tuple[str, ...]) -> Path:
    """Compile the C++ functions that call Pinocchio to a shared library. Raise ToolchainError with what is missing."""
    prefix = pinocchio_prefix()
    link = _library_flags(prefix) if way == "library" else ()
    # The shipped library is plain x86-64, and Eigen's alignment follows the instruction set: they cannot be mixed.
    # Flags for psdmc's scalar code (GCC_ONLY) would slow Eigen by a sixth.
    machine = tuple(flag.partition("=")[0] for flag in NATIVE.host_flags)
    left_out = GCC_ONLY if way == "header-only" else (*GCC_ONLY, *machine)
    used = tuple(flag for flag in flags if not flag.startswith(left_out))
    product = f"pinocchio_{way.replace('-', '_')}.so"
    names = ("pinocchio_cpp.cpp", "pinocchio_model.hpp", "loops.hpp")
    command = [cxx(), "-std=c++17", *used, "-DNDEBUG", "-shared", *DEFINES, *includes(prefix)]
    command += ["pinocchio_cpp.cpp", "-o", product, *link]
    return built(product, command, {name: source(name) for name in names}, [version_of("pin")])


@lru_cache
def pinocchio_prefix() -> Path:
    """Return the folder of Pinocchio's headers and libraries. Raise ToolchainError if they, or Eigen's, are missing."""
    found = find_spec("pinocchio")
    if found is None or found.origin is None:
        raise ToolchainError("the wheel 'pin' is not installed", "pip install pin")
    prefix = next((p for p in Path(found.origin).parents if p.name == "cmeel.prefix"), None)
    if prefix is None or not (prefix / "include/pinocchio").is_dir():
        raise ToolchainError(
            "this Pinocchio came without C++ headers; the wheel 'pin' has them", "pip install pin"
        )
    if not (prefix / "include/eigen3/Eigen/Core").is_file():
        raise ToolchainError(
            "Eigen's headers are missing; pip install 'psdmc[bench]' brings them", "pip install cmeel-eigen"
        )
    return prefix


def includes(prefix: Path) -> tuple[str, ...]:
    """Return the compiler options for the headers of the wheels that are installed at `prefix`."""
    return ("-isystem", str(prefix / "include"), "-isystem", str(prefix / "include/eigen3"))


def _library_flags(prefix: Path) -> tuple[str, ...]:
    folder = prefix / "lib"
    return (
        INSTANTIATED,
        f"-L{folder}",
        "-lpinocchio_default",
        f"-Wl,-rpath,{folder}",
        f"-Wl,-rpath-link,{folder}",
    )


def standard_parameters(case: Case) -> Array:
    """Return the vector (10 n,) of standard parameters of the n bodies, each about its joint frame. Pinocchio's
    regressor times this vector gives the torques."""
    pairs = zip(case.chain.joints, case.chain.parameters, strict=True)
    return np.concatenate([joint_frame_map(joint.link_frame) @ row[:DRIVE] for joint, row in pairs])
