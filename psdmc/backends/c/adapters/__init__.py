"""Adapters: files through which other programs, such as CasADi, call the generated C functions.

Users choose adapters with `emit-c --with`. Each adapter is written by one module of this folder.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial

from psdmc.backends.c.adapters import casadi, fmu, mex, ros2, wheel
from psdmc.backends.c.make_kernel_view import undeclared
from psdmc.backends.c.package import PackageView
from psdmc.errors import InputError
from psdmc.functions import SIGNATURES
from psdmc.program.kernel import Kernel, takes_gravity
from psdmc.program.signature import Signature
from psdmc.robot.mechanism import Mechanism

CASADI = (casadi.FIRST, casadi.BY_THETA, casadi.HESSIANS)

ADAPTERS: dict[str, Callable[[PackageView], dict[str, str]]] = {
    **{name: partial(casadi.files, adapter=name) for name in CASADI},
    "wheel": wheel.files,
    "fmu": fmu.files,
    "fmu2": partial(fmu.files, version=2),
    "mex": mex.files,
    "ros2": ros2.files,
}
"""By name, the function that makes an adapter's files, path -> text. At least one of them lies in the folder <name>."""

NEEDS: dict[str, Callable[[Sequence[Signature], bool], list[str]]] = {
    casadi.FIRST: casadi.needed,
    casadi.BY_THETA: partial(casadi.needed, theta=True),
    casadi.HESSIANS: casadi.needed,
    "fmu": fmu.needed,
    "fmu2": fmu.needed,
    "ros2": ros2.needed,
}
"""By name, the function that returns which functions an adapter needs in the package besides those asked for."""

REMARKS = dict.fromkeys(CASADI, casadi.remark)
"""By name, the function that says what users should know of an adapter's functions of a robot."""


def chosen(names: Sequence[str]) -> tuple[str, ...]:
    """Return the names of the adapters that the user chose, without duplicates, in the order of the table ADAPTERS.
    Raises InputError for an unknown name."""
    for name in names:
        if name not in ADAPTERS:
            raise InputError(f"there is no adapter {name!r}", f"choose from {', '.join(ADAPTERS)}")
    return tuple(name for name in ADAPTERS if name in names)


def with_needed(
    functions: Sequence[str], adapters: Sequence[str], wide: bool, gravity_input: bool = False
) -> list[str]:
    """Return the functions that a package must contain: the given functions, followed by further functions that the
    code of the adapters calls.

    wide           whether q has more entries than qd (quaternions)
    gravity_input  whether gravity is an input of the functions that depend on it
    """
    found, known = dict.fromkeys(functions), [SIGNATURES[name] for name in functions if name in SIGNATURES]
    own = [takes_gravity(function) if gravity_input else function for function in known]
    for adapter in adapters:
        found |= dict.fromkeys(NEEDS[adapter](own, wide) if adapter in NEEDS else ())
    return list(found)


def remarks(
    robot: Mechanism, adapters: Sequence[str], functions: Sequence[str], l: int = 0
) -> tuple[str, ...]:
    """Return remarks for users about the chosen adapters, one clause each. An example says how CasADi treats the
    quaternions of this robot.

    l  number of base parameters
    """
    found = (REMARKS[adapter](robot, functions, l) for adapter in chosen(adapters) if adapter in REMARKS)
    return tuple(dict.fromkeys(reason for reason in found if reason is not None))


def with_own_kernels(package: PackageView, kernels: Mapping[str, Kernel]) -> PackageView:
    """Return the package with the functions that only its adapters call. No header declares these functions.

    kernels  the arithmetic of the package's functions, by name
    """
    alone = package.alone
    own = casadi.own_kernels(kernels, package.adapters, package.info, package.target.costs)
    functions = (undeclared(kernel, package.info.sizes, package.robot, alone.options) for kernel in own)
    return replace(package, private=tuple(functions))
