"""Adapters: files through which other programs, such as CasADi, call the generated C functions.

Users choose adapters with `emit-c --with`. Each adapter is written by one module of this folder.
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
    """Return the names of the adapters that the user chose, without duplicates, in the order of the table ADAPTERS.
    Raises InputError for an unknown name."""
    for name in names:
        if name not in ADAPTERS:
            raise InputError(f"there is no adapter {name!r}", f"choose from {', '.join(ADAPTERS)}")
    return tuple(name for name in ADAPTERS if name in names)


def with_needed(functions: Sequence[str], adapters: Sequence[str], wide: bool) -> list[str]:
    """Return the functions that a package must contain: the given functions, followed by further functions that the
    code of the adapters calls.

    wide  whether q has more entries than qd (quaternions)
    """
    found = dict.fromkeys(functions)
    for adapter in adapters:
        found |= dict.fromkeys(NEEDS[adapter](functions, wide) if adapter in NEEDS else ())
    return list(found)


def remarks(robot: Mechanism, adapters: Sequence[str], functions: Sequence[str]) -> tuple[str, ...]:
    """Return remarks for users about the chosen adapters, one clause each. An example says how CasADi treats the
    quaternions of this robot."""
    found = (REMARKS[adapter](robot, functions) for adapter in chosen(adapters) if adapter in REMARKS)
    return tuple(dict.fromkeys(reason for reason in found if reason is not None))
