"""Adapters: files by which other programs call the emitted functions, chosen by `emit-c --with`; one module each."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from psdmc.backends.c.adapters import casadi
from psdmc.backends.c.package import PackageView
from psdmc.errors import InputError
from psdmc.robot.mechanism import Mechanism

ADAPTERS: dict[str, Callable[[PackageView], dict[str, str]]] = {
    "casadi": casadi.files,
    "casadi_theta": casadi.files_by_theta,
}
"""By name, the function that makes an adapter's files, path -> text. At least one of them lies in the folder <name>."""

NEEDS = {"casadi": casadi.needed, "casadi_theta": casadi.needed_by_theta}
"""By name, the function that returns which functions an adapter needs in the package besides those asked for."""

REMARKS = {"casadi": casadi.remark, "casadi_theta": casadi.remark}
"""By name, the function that says what users should know of an adapter's functions of a robot."""


def chosen(names: Sequence[str]) -> tuple[str, ...]:
    """The names, each once, in the order of ADAPTERS; InputError where one is unknown."""
    for name in names:
        if name not in ADAPTERS:
            raise InputError(f"there is no adapter {name!r}", f"choose from {', '.join(ADAPTERS)}")
    return tuple(name for name in ADAPTERS if name in names)


def with_needed(functions: Sequence[str], adapters: Sequence[str], wide: bool) -> list[str]:
    """The functions, followed by those that the adapters need besides."""
    found = dict.fromkeys(functions)
    for adapter in adapters:
        found |= dict.fromkeys(NEEDS[adapter](functions, wide))
    return list(found)


def remarks(robot: Mechanism, adapters: Sequence[str], functions: Sequence[str]) -> tuple[str, ...]:
    """What users should know of these adapters' functions of a robot, one clause each."""
    found = (REMARKS[adapter](robot, functions) for adapter in chosen(adapters))
    return tuple(dict.fromkeys(reason for reason in found if reason is not None))
