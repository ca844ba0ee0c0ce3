"""Adapters: files through which other programs, such as CasADi, call the generated C functions.

Users choose adapters with `emit-c --with`. Each adapter is one module of this folder.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from psdmc.backends.c.adapters import casadi, fmu, wheel
from psdmc.backends.c.package import PackageView
from psdmc.errors import InputError
from psdmc.robot.mechanism import Mechanism

ADAPTERS: dict[str, Callable[[PackageView], dict[str, str]]] = {
    "casadi": casadi.files,
    "casadi_theta": casadi.files_by_theta,
    "wheel": wheel.files,
    "fmu": fmu.files,
}
"""By name, the function that makes an adapter's files, path -> text. At least one of them lies in the folder <name>."""

NEEDS = {"casadi": casadi.needed, "casadi_theta": casadi.needed_by_theta, "fmu": fmu.needed}
"""By name, the function that returns which functions an adapter needs in the package besides those asked for."""

REMARKS = {"casadi": casadi.remark, "casadi_theta": casadi.remark}
"""By name, the function that says what users should know of an adapter's functions of a robot."""


def chosen(names: Sequence[str]) -> tuple[str, ...]:
    """Return the chosen adapters' names without duplicates, in the order of ADAPTERS. Raises InputError for an unknown
    name."""
    for name in names:
        if name not in ADAPTERS:
            raise InputError(f"there is no adapter {name!r}", f"choose from {', '.join(ADAPTERS)}")
    return tuple(name for name in ADAPTERS if name in names)


def with_needed(functions: Sequence[str], adapters: Sequence[str], wide: bool) -> list[str]:
    """Return the given functions, followed by further functions that the chosen adapters call."""
    found = dict.fromkeys(functions)
    for adapter in adapters:
        found |= dict.fromkeys(NEEDS[adapter](functions, wide) if adapter in NEEDS else ())
    return list(found)


def remarks(robot: Mechanism, adapters: Sequence[str], functions: Sequence[str]) -> tuple[str, ...]:
    """Return the remarks of these adapters for users, one clause each, such as how CasADi treats quaternions."""
    found = (REMARKS[adapter](robot, functions) for adapter in chosen(adapters) if adapter in REMARKS)
    return tuple(dict.fromkeys(reason for reason in found if reason is not None))
