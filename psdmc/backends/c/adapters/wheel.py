"""The adapter that makes a Python module of the generated functions. `pip install DIR` compiles the module, which then
needs NumPy only.

A compiled extension in CPython's stable ABI reads arrays as buffers. A Python file converts arguments, checks shapes
and allocates results. The extension calls only the C functions for many states. So the result for one state has exactly
equal bits, alone or as part of a batch.
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
    """A generated C function for many states, as the Python extension module calls it.

    name    name of the generated function with its variant
    call    C text of the call, in which the arrays are a[0], a[1], ...
    fails   whether the call returns a status
    sizes   for each array, how many real numbers belong to one state; for theta_b, its whole length
    inputs  number of input arrays, which precede the output arrays
    theta   index of the array theta_b (base parameters), which is shared by all states; -1 if there is none
    """

    name: str
    call: str
    fails: bool
    sizes: tuple[int, ...]
    inputs: int
    theta: int


@dataclass(frozen=True, slots=True)
class WheelArray:
    """An input or output array of a Python function: its name, its meaning `means`, and its shape. `tail` is the shape
    for one state. `shape` is text that shows users the shape, with leading axes for many states."""

    name: str
    tail: tuple[int, ...]
    shape: str
    means: str


@dataclass(frozen=True, slots=True)
class WheelFunction:
    """One function of the Python module.

    meaning      description in one line of ASCII without quotation marks
    note         explanation of derivatives by q, in one line; empty if the outputs contain none
    result       name of the class that holds the outputs if there are several; else empty
    kernels      Python text of the two C functions, without and with the input theta_b; None for a missing function
    takes_theta  whether the package has the function with the input theta_b (base parameters)
    needs_theta  whether the package has only the function with the input theta_b
    positions    indices of the inputs that contain quaternions, which must have length one
    """

    name: str
    meaning: str
    note: str
    inputs: tuple[WheelArray, ...]
    outputs: tuple[WheelArray, ...]
    result: str
    kernels: str
    takes_theta: bool
    needs_theta: bool
    positions: tuple[int, ...]


def files(package: PackageView) -> dict[str, str]:
    """Return the text of each file of the Python package (extension, module, files for pip), by path.

    Raises InputError if Python already uses a name, such as a keyword.
    """
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
        note=_plain(signature.note),
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
