"""The adapter that makes a Python module of the generated functions. `pip install DIR` compiles the module, which then
needs NumPy only.

A compiled extension in CPython's stable ABI reads arrays as buffers. A Python file converts arguments, checks shapes
and allocates results. The extension calls only the C functions for many states. So the result for one state has exactly
equal bits, alone or as part of a batch.
"""

from __future__ import annotations

import keyword
import sys

from psdmc.backends.c.adapters.batch_calls import batch_call, batch_function
from psdmc.backends.c.package import PackageView
from psdmc.backends.c.render import render
from psdmc.errors import InputError

FILES = {
    "wheel/{}_wheel.c": "wheel.c",
    "wheel/__init__.py": "wheel.py",
    "pyproject.toml": "pyproject.toml",
    "setup.py": "setup.py",
}


def files(package: PackageView) -> dict[str, str]:
    """Return the text of each file of the Python package (extension, module, files for pip), by path.

    Raises InputError if Python already uses a name, such as a keyword.
    """
    robot = package.robot
    if keyword.iskeyword(robot) or robot in {"numpy", *sys.stdlib_module_names}:
        raise InputError(f"a Python module cannot be called {robot!r}", "choose another name with --name")
    model = package.info.model_hash[:8]
    kernels = [batch_call(kernel, package.l) for kernel in package.kernels]
    view = {
        "package": package,
        "most_arrays": max(len(kernel.sizes) for kernel in kernels),
        "version": f"{package.version}+m{model}" if model else package.version,
        "kernels": kernels,
        "functions": [batch_function(function) for function in package.functions],
        "joint_names": ", ".join(ascii(joint.name) for joint in package.info.joints),
        "frame_names": ", ".join(map(ascii, package.info.frames)),
        "theta_b": [repr(parameter.value) for parameter in package.info.parameters],
    }
    made = {path.format(robot): render(f"adapters/{text}.jinja", **view) for path, text in FILES.items()}
    return {**made, "wheel/py.typed": ""}
