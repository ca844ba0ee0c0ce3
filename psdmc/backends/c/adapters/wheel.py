"""A Python module of the emitted functions: `pip install DIR` compiles it, and it then needs NumPy alone.

An extension in CPython's stable ABI reads arrays as buffers. A module in Python converts arguments, checks shapes and
allocates results. Only functions for many states are called: one state then has the same bits alone and in a batch.
"""

from __future__ import annotations

import keyword
import sys
from collections.abc import Sequence
from dataclasses import dataclass

from psdmc.backends.c.function_view import FunctionView
from psdmc.backends.c.kernel_view import KernelView
from psdmc.backends.c.names import c_comment
from psdmc.backends.c.package import PackageView
from psdmc.backends.c.render import render
from psdmc.errors import InputError
from psdmc.program.signature import Q, Quantity

FILES = {
    "wheel/{}_wheel.c": "wheel.c",
    "wheel/__init__.py": "wheel.py",
    "pyproject.toml": "pyproject.toml",
    "setup.py": "setup.py",
}


@dataclass(frozen=True, slots=True)
class WheelKernel:
    """A C function for many states, as the extension calls it.

    name, call  of the kernel; C text of the call with arrays a[0], a[1], ...
    fails       whether the call returns a status
    sizes       reals per state of each array; of theta_b all reals
    inputs      number of arrays that are read, which come first
    theta       place of theta_b, whose reals are the same for all states; -1 if it is none of the arrays
    """

    name: str
    call: str
    fails: bool
    sizes: tuple[int, ...]
    inputs: int
    theta: int


@dataclass(frozen=True, slots=True)
class WheelArray:
    """An array of a Python function: its trailing axes, also as a caller sees them after batch axes, and its meaning."""

    name: str
    tail: tuple[int, ...]
    shape: str
    means: str


@dataclass(frozen=True, slots=True)
class WheelFunction:
    """A function of the Python module.

    meaning      a line of ASCII without quotation marks
    result       class of several results; empty for one
    kernels      Python text of the extension's functions without and with theta_b; None for one that does not exist
    takes_theta  whether there is one with theta_b
    positions    numbers of the inputs whose quaternions must have length one
    """

    name: str
    meaning: str
    inputs: tuple[WheelArray, ...]
    outputs: tuple[WheelArray, ...]
    result: str
    kernels: str
    takes_theta: bool
    needs_theta: bool
    positions: tuple[int, ...]


def files(package: PackageView) -> dict[str, str]:
    """Path -> text of the extension, the module and what pip reads. InputError for a name that Python takes itself."""
    robot = package.robot
    if keyword.iskeyword(robot) or robot in {"numpy", *sys.stdlib_module_names}:
        raise InputError(f"a Python module cannot be called {robot!r}", "choose another name with --name")
    model = package.info.model_hash[:8]
    view = {
        "package": package,
        "version": f"{package.version}+m{model}" if model else package.version,
        "kernels": [_kernel(kernel, package.l) for kernel in package.kernels],
        "functions": [_function(function) for function in package.functions],
        "joint_names": ", ".join(ascii(joint.name) for joint in package.info.joints),
        "frame_names": ", ".join(map(ascii, package.info.frames)),
        "theta_b": [repr(parameter.value) for parameter in package.info.parameters],
    }
    made = {path.format(robot): render(f"adapters/{text}.jinja", **view) for path, text in FILES.items()}
    return {**made, "wheel/py.typed": ""}


def _kernel(kernel: KernelView, l: int) -> WheelKernel:
    inputs = [*(vector.size for vector in kernel.inputs), *([l] if kernel.theta else [])]
    sizes = (*inputs, *(vector.size for vector in kernel.outputs))
    batch = kernel.prototypes["batch"]
    arrays = ", ".join(f"a[{k}]" for k in range(len(sizes)))
    return WheelKernel(
        kernel.name,
        f"{batch.symbol}(count, {arrays})",
        batch.returns != "void",
        sizes,
        len(inputs),
        len(kernel.inputs) if kernel.theta else -1,
    )


def _function(function: FunctionView) -> WheelFunction:
    signature, (first, *_) = function.signature, function.kernels
    baked, theta = (
        next((k.name for k in function.kernels if k.theta is wants), None) for wants in (False, True)
    )
    shapes = [vector.shape for vector in first.outputs]
    return WheelFunction(
        name=function.name,
        meaning=_plain(function.meaning),
        inputs=_arrays(signature.inputs, [vector.shape for vector in first.inputs]),
        outputs=_arrays(signature.outputs, shapes, bool(signature.inputs)),
        result="".join(map(str.capitalize, function.name.split("_"))) if len(shapes) > 1 else "",
        kernels=", ".join(f"_c.{name}" if name else "None" for name in (baked, theta)),
        takes_theta=theta is not None,
        needs_theta=baked is None,
        positions=tuple(
            k for k, q in enumerate(signature.inputs) if q.axes == Q.axes and not signature.normalizes
        ),
    )


def _arrays(
    quantities: Sequence[Quantity], shapes: Sequence[tuple[int, ...]], batched: bool = True
) -> tuple[WheelArray, ...]:
    lead = ("...",) if batched else ()
    return tuple(
        WheelArray(q.name, shape, f"({', '.join(map(str, (*lead, *shape)))})", _plain(q.means))
        for q, shape in zip(quantities, shapes, strict=True)
    )


def _plain(text: str) -> str:
    """Text that may stand in a docstring, whatever it holds."""
    return c_comment(text).replace('"', "'")
