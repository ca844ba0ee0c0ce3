"""The adapter for MATLAB, Octave and Simulink. It writes a MEX function with a help text for each generated function,
and an S-function for each generated function whose inputs and outputs are vectors.

MEX functions call the C functions for many states, whose states are columns of MATLAB's arrays. A matrix of the C
package is row-major, and MATLAB's are column-major, so the MEX functions change the order of the entries.
"""

from __future__ import annotations

from psdmc.backends.c.adapters.batch_calls import batch_call, batch_function, plain
from psdmc.backends.c.kernel_view import KernelView
from psdmc.backends.c.package import PackageView
from psdmc.backends.c.render import render
from psdmc.errors import InputError

LONGEST = 63
"""Characters of a function's name in MATLAB (namelengthmax)."""


def files(package: PackageView) -> dict[str, str]:
    """Return the text of each file for MATLAB and Simulink, by path.

    Raises InputError if a name is too long for MATLAB.
    """
    robot, info = package.robot, package.info
    functions = [batch_function(function) for function in package.functions]
    blocks = {
        name: function.kernels[0]
        for function in package.functions
        if function.kernels[0].variant == "" and _has_vectors_alone(function.kernels[0])
        for name in [f"{robot}_{function.name}_sfun"]
    }
    longest = max([*blocks, *(f"{robot}_{function.name}" for function in functions)], key=len)
    if len(longest) > LONGEST:
        raise InputError(
            f"{longest}: MATLAB allows names of at most {LONGEST} characters",
            "choose a shorter name of the robot with --name",
        )
    calls = {kernel.name: batch_call(kernel, package.l) for kernel in package.kernels}
    arrays = [array for function in functions for array in (*function.inputs, *function.outputs)]
    view = {
        "package": package,
        "most_axes": max(1, *(len(array.tail) for array in arrays)),
        "most_arrays": max(len(call.sizes) for call in calls.values()),
        "functions": functions,
        "blocks": blocks,
        "flags": " ".join((package.arithmetic_flags, *package.target.flags)),
        "joint_names": [_text(joint.name) for joint in info.joints],
        "frame_names": [_text(name) for name in info.frames],
        "theta_b": ["NaN" if each.value is None else repr(each.value) for each in info.parameters],
        "robot_name": plain(info.name),
    }
    made = {
        f"mex/{robot}_mex.h": render("adapters/mex.h.jinja", **view),
        f"mex/{robot}_build_mex.m": render("adapters/mex_build.m.jinja", **view),
        f"mex/{robot}_info.m": render("adapters/mex_info.m.jinja", **view),
    }
    for function in functions:
        own = {
            "function": function,
            "calls": [calls[name] for name in (function.baked, function.theta) if name],
        }
        for suffix in ("c", "m"):
            made[f"mex/{robot}_{function.name}.{suffix}"] = render(
                f"adapters/mex.{suffix}.jinja", **own, **view
            )
    for name, kernel in blocks.items():
        made[f"mex/{name}.c"] = render("adapters/sfun.c.jinja", package=package, name=name, kernel=kernel)
    return made


def _has_vectors_alone(kernel: KernelView) -> bool:
    return bool(kernel.inputs) and all(len(vector.shape) == 1 for vector in (*kernel.inputs, *kernel.outputs))


def _text(name: str) -> str:
    """Untrusted text as MATLAB's code for it, whatever it holds."""
    if name.isascii() and name.isprintable():
        return "'" + name.replace("'", "''") + "'"
    data = name.encode("utf-8", errors="surrogatepass")
    return f"native2unicode(uint8([{' '.join(map(str, data))}]), 'UTF-8')"
