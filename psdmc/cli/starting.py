"""The commands for new users: `new` writes a robot file; `doctor` lists packages, programs and folders, what needs them,
and how to install missing ones."""

from __future__ import annotations

import platform
import re
import shutil
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from psdmc.cli.console import say_next, say_next_line
from psdmc.errors import PsdmcError
from psdmc.version import psdmc_version

MISSING_STATUS = 4
"""Something that psdmc cannot do without is missing: change the machine."""


def new(
    robot: Annotated[
        Path, typer.Argument(metavar="ROBOT.toml", help="file to write, which does not exist yet")
    ],
) -> None:
    """Write a commented DH table of an arm of three joints, to be changed into your robot's."""
    from psdmc.robot.dh import write_new_robot

    write_new_robot(robot)
    print(f"{robot}: written, a table of three joints; change it into your robot's")
    say_next("derive", robot)


def doctor() -> None:
    """Say what is installed, which compilers, which optional parts, and what each is needed for."""
    from psdmc.cli.tables import Table, print_line, print_table

    parts = findings()
    absent = {True: "MISSING", False: "not installed"}
    rows = []
    for part in parts:
        purpose = f" ({part.purpose})" if part.purpose else ""
        rows.append((part.part, f"{part.found or absent[part.needed]}{purpose}"))
    print_table(Table(("part", "what is found (and what needs it)"), rows, prose=True))
    lacking = missing(parts)
    for part in parts:
        if not part.found:
            print_line(f"{'error' if part.needed else 'hint'}: {part.part}: {part.remedy}")
    if lacking:
        raise typer.Exit(MISSING_STATUS)
    say_next_line("psdmc new robot.toml, or psdmc show with a robot file of yours")


NEEDED = (
    ("numpy", "arrays"),
    ("scipy", "derivation, calibration"),
    ("pin", "Pinocchio: reading robot files, checking models"),
    ("jinja2", "templates of C and of pages"),
    ("cffi", "calling compiled code"),
    ("setuptools", "building what cffi calls"),
    ("typer", "the command line"),
    ("rich", "progress on a terminal"),
    ("matplotlib", "plots of reports"),
    ("defusedxml", "reading XML safely"),
)
"""Packages that psdmc cannot do without, as pyproject.toml names them, and what each is for."""

OPTIONAL = (
    ("mujoco", "mjcf", "MJCF files; a second reader in psdmc check; a rival in psdmc bench"),
    ("xacro", "xacro", "xacro files"),
    ("plotly", "view", "psdmc view"),
    ("casadi", "bench", "emit-c --with casadi, in your own program; a rival in psdmc bench"),
    ("fmpy", "fmu", "simulation of FMUs that emit-c --with fmu makes"),
    ("cmeel-cppadcodegen", "bench", "a rival in psdmc bench"),
    ("cmeel-eigen", "bench", "headers for the rival Pinocchio in psdmc bench"),
    ("pandas", "notebook", "base_parameters.to_frame() in Python"),
    ("sympy", "notebook", "torques as SymPy expressions in Python"),
    ("dask", "cluster", "functions of compiled robots over Dask's arrays"),
    ("distributed", "cluster", "the same on a cluster; psdmc sample --scheduler"),
    ("xarray", "cluster", "functions of compiled robots over named dimensions"),
    ("crocoddyl", "examples", "the example of trajectory optimisation"),
    ("osqp", "examples", "the example of a trotting quadruped: its quadratic programme"),
    ("example-robot-data", "examples", "the same: its robot"),
    ("cvxpy", "calibrate", "psdmc calibrate: physical consistency"),
    ("clarabel", "calibrate", "psdmc calibrate: its solver"),
    ("cma", "calibrate", "friction in psdmc calibrate"),
    ("rosbags", "calibrate", "logs in ROS bags"),
    ("lz4", "calibrate", "compressed ROS bags"),
    ("backports.zstd", "calibrate", "compressed ROS bags, before Python 3.14"),
    ("pyarrow", "sample", "psdmc sample; logs in Parquet files"),
    ("jax", "jax", "psdmc.jax"),
    ("torch", "torch", "psdmc.torch"),
    ("nvidia-cuda-nvrtc-cu12", "cuda", "psdmc.compile for an NVIDIA GPU"),
    ("nvidia-cuda-nvcc-cu12", "cuda", "registers of CUDA packages"),
)
"""Packages, the extra of psdmc that brings each, and the commands or files that need it."""

PROGRAMS = (
    ("cmake", "psdmc build", "apt install cmake"),
    ("make", "psdmc build without CMake", "apt install make"),
    ("g++", "the rival Pinocchio in psdmc bench", "apt install g++"),
    ("valgrind", "psdmc bench --counts", "apt install valgrind"),
)
"""Programs besides the C compiler, what needs each, and how Debian installs it."""


@dataclass(frozen=True, slots=True)
class Ground:
    """A package, program or folder that psdmc uses.

    found    its version or place; '' if it is missing
    needed   whether psdmc cannot run without it
    purpose  which parts of psdmc need it
    remedy   how to install it
    """

    part: str
    found: str
    needed: bool
    purpose: str
    remedy: str


def findings() -> tuple[Ground, ...]:
    """Return all packages, programs and folders that psdmc uses, those first that it cannot run without."""
    return (
        Ground("psdmc", psdmc_version(), True, "", ""),
        Ground(
            "python", f"{platform.python_version()}, {platform.system()} {platform.machine()}", True, "", ""
        ),
        _compiler(),
        _cache(),
        _direct_calls(),
        *(_package(name, "", purpose) for name, purpose in NEEDED),
        *(Ground(name, shutil.which(name) or "", False, use, remedy) for name, use, remedy in PROGRAMS),
        *(_package(name, extra, purpose) for name, extra, purpose in OPTIONAL),
    )


def missing(parts: Sequence[Ground]) -> tuple[Ground, ...]:
    """Return those packages and programs that psdmc cannot run without and that are not installed."""
    return tuple(part for part in parts if part.needed and not part.found)


def _package(name: str, extra: str, purpose: str) -> Ground:
    import importlib.metadata

    try:
        found = importlib.metadata.version(name)
    except importlib.metadata.PackageNotFoundError:
        found = ""
    remedy = f"pip install 'psdmc[{extra}]'" if extra else f"pip install {name}"
    return Ground(name, found, not extra, purpose, remedy)


def _compiler() -> Ground:
    """The C compiler that psdmc takes, tried on a file, or why it takes none."""
    from psdmc.toolchain.compiler_command import find_compiler

    purpose = "psdmc.compile, psdmc build, psdmc bench"
    try:
        compiler = find_compiler()
    except PsdmcError as error:
        return Ground("C compiler", "", True, f"{purpose}: {error.message}", error.hint or "install gcc")
    number = re.search(r"\d+(\.\d+)+", compiler.version)
    return Ground("C compiler", " ".join([*compiler.command, number[0] if number else ""]), True, purpose, "")


def _direct_calls() -> Ground:
    """Whether compiled robots are called without a detour through Python, or why not."""
    purpose = "one state from Python in less than a microsecond"
    try:
        from psdmc.toolchain.direct_calls import direct_calls
    except ModuleNotFoundError as error:
        return Ground("direct calls", "", False, f"{purpose}: no {error.name}", f"install {error.name}")
    found = direct_calls()
    if found.make is None:
        return Ground("direct calls", "", False, f"{purpose}: {found.reason}", found.remedy)
    return Ground("direct calls", "yes", False, purpose, "")


def _cache() -> Ground:
    """The folder of the compile cache, or why it cannot be used."""
    from psdmc.toolchain.cache_room import cache_contents

    purpose = "keeping compiled libraries"
    try:
        kept = cache_contents()
    except PsdmcError as error:
        return Ground("cache", "", True, f"{purpose}: {error.message}", error.hint or "set PSDMC_CACHE_DIR")
    return Ground("cache", f"{kept.place}", True, purpose, "")
