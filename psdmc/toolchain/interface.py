"""What calling a compiled library takes: names, sizes and prototypes, without the package that it was made from.

It is kept beside libraries in the compile cache: a model that was compiled before is called without being lowered,
rendered or parsed again.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

from psdmc.emit.package import PackageView
from psdmc.errors import InternalError
from psdmc.program.functions import BY_NAME

FORMAT = 1
"""Grows where the text's form changes."""


@dataclass(frozen=True, slots=True)
class Interface:
    """A compiled package as its caller sees it.

    robot        prefix of its symbols
    real         C's name of its floating-point type; `dtype` is NumPy's
    n, l         joints, base parameters
    joint_names  n, from base to tip
    kernels      name -> trailing axes of its result
    cdef         C declarations of the functions that are called
    """

    robot: str
    real: str
    dtype: str
    n: int
    l: int
    joint_names: tuple[str, ...]
    kernels: Mapping[str, tuple[int, ...]]
    cdef: str


def interface_of(package: PackageView) -> Interface:
    """The interface of a package's library: the batch function of each kernel."""
    return Interface(
        robot=package.robot,
        real=package.real,
        dtype=package.options.real,
        n=package.n,
        l=package.l,
        joint_names=tuple(joint.name for joint in package.info.joints),
        kernels={name: _tail(package, name) for name in package.kernel_names},
        cdef="".join(
            f"{prototype.text};\n"
            for kernel in package.kernels
            for prototype in kernel.prototypes.values()
            if prototype.symbol == batch_symbol(package.robot, kernel.name)
        ),
    )


def batch_symbol(robot: str, kernel: str) -> str:
    """The C function that computes a kernel for many states."""
    return f"{robot}_{kernel}_batch"


def _tail(package: PackageView, name: str) -> tuple[int, ...]:
    function = BY_NAME[name.removesuffix("_theta")]
    lengths = {"n": package.n, "l": package.l, "6": 6}
    return tuple(lengths[axis] for axis in (function.rows, function.columns) if axis != "1")


def interface_to_json(interface: Interface, library: str) -> str:
    """The text of an interface and of the key of the library in the cache that it belongs to."""
    return json.dumps({"format": FORMAT, "library": library, "interface": asdict(interface)})


def interface_from_json(text: str) -> tuple[Interface, str]:
    """Interface and key of `interface_to_json`; InternalError where the text is not of its making."""
    try:
        whole = json.loads(text)
        if whole["format"] != FORMAT:
            raise ValueError(f"format {whole['format']}, expected {FORMAT}")
        return _from_plain(whole["interface"]), str(whole["library"])
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise InternalError(f"a kept interface cannot be read: {error}") from error


def _from_plain(plain: dict[str, Any]) -> Interface:
    names = tuple(plain.pop("joint_names"))
    kernels = {name: tuple(tail) for name, tail in plain.pop("kernels").items()}
    return Interface(joint_names=names, kernels=kernels, **plain)
