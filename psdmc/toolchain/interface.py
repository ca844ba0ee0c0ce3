"""The data with which a compiled library is called: names, sizes and prototypes. The generated package is not needed
for a call.

The compile cache keeps this data with each library. So a model that was compiled before can be called without
generating its code again.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from typing import Any

from psdmc.backends.c.header import patterns
from psdmc.backends.c.package import PackageView
from psdmc.errors import InternalError
from psdmc.program.signature import Sizes
from psdmc.robot.mechanism import contact_names

FORMAT = 9
"""Version of the text's form."""


@dataclass(frozen=True, slots=True)
class Interface:
    """The data that a caller of a compiled package needs.

    robot        prefix of the library's C symbols
    real         C name of its floating-point type; `dtype` is the name in NumPy
    n, l         numbers of joints and base parameters
    nq, nv       lengths of q, and of rates and torques
    joint_names  n, from base to tip
    q_names      names of the nq entries of q
    v_names      names of the nv entries of rates and torques
    frame_names  names of the named frames
    contacts     names and numbers of rows of the contacts
    loops        names and rows of the closed loops
    units        (start, stop) slices (start, stop) of q that must have length one, such as quaternions
    limits       n rows: lower, upper, speed, acceleration, effort; infinite if unknown
    gravity      3 numbers, m/s^2 along the axes of the base frame
    gravity_input  whether gravity is an input of the functions that depend on it
    base_frame   name of that frame in words: the base frame, or the world frame of a floating base
    theta_b      l base parameters; None if unknown
    kernels      name of each generated function in C -> shapes of the function's results for one state
    patterns     function -> (row, column) of the entries of its matrix that may differ from zero
    cdef         C declarations of the functions that are called
    """

    robot: str
    real: str
    dtype: str
    n: int
    l: int
    nq: int
    nv: int
    joint_names: tuple[str, ...]
    q_names: tuple[str, ...]
    v_names: tuple[str, ...]
    frame_names: tuple[str, ...]
    contacts: tuple[tuple[str, int], ...]
    loops: tuple[tuple[str, tuple[int, ...]], ...]
    units: tuple[tuple[int, int], ...]
    limits: tuple[tuple[float, ...], ...]
    gravity: tuple[float, ...]
    gravity_input: bool
    base_frame: str
    theta_b: tuple[float, ...] | None
    kernels: Mapping[str, tuple[tuple[int, ...], ...]]
    patterns: Mapping[str, tuple[tuple[int, int], ...]]
    cdef: str

    @property
    def sizes(self) -> Sizes:
        """Return the lengths of this robot's axes, such as nq and nv."""
        rows = tuple(rows for _, rows in self.contacts)
        closed = tuple(rows for _, rows in self.loops)
        return Sizes(self.n, self.nq, self.nv, self.l, len(self.frame_names), 0, rows, closed)

    @property
    def names(self) -> dict[str, tuple[str, ...]]:
        """Return the names of the entries along each axis: word of the axis, such as nq -> names."""
        own = {"n": self.joint_names, "nq": self.q_names, "nv": self.v_names, "frames": self.frame_names}
        return own | contact_names(self.contacts, self.loops)


def interface_of(package: PackageView) -> Interface:
    """Return the interface of the library of a package. The interface has every generated function for batches of
    states.

    If a matrix that is not positive definite must raise an error in Python, the interface also has the function for one
    state.
    """
    values = [parameter.value for parameter in package.info.parameters]
    known = tuple(value for value in values if value is not None)
    return Interface(
        robot=package.robot,
        real=package.real,
        dtype=package.options.real,
        n=package.n,
        l=package.l,
        nq=package.info.nq,
        nv=package.info.nv,
        joint_names=tuple(joint.name for joint in package.info.joints),
        q_names=package.info.q_names,
        v_names=package.info.v_names,
        frame_names=package.info.frames,
        contacts=package.info.contacts,
        loops=package.info.loops,
        units=package.info.units,
        limits=tuple((j.lower, j.upper, j.speed, j.acceleration, j.effort) for j in package.info.joints),
        gravity=package.info.gravity,
        gravity_input=package.info.gravity_input,
        base_frame=package.info.base_frame,
        theta_b=known if len(known) == len(values) else None,
        kernels={kernel.name: tuple(output.shape for output in kernel.outputs) for kernel in package.kernels},
        patterns={pattern.function: pattern.places for pattern in patterns(package.functions)},
        cdef="".join(
            f"{prototype.text};\n"
            for kernel in package.kernels
            for prototype in kernel.prototypes.values()
            if prototype.symbol == batch_symbol(package.robot, kernel.name)
            or (kernel.function.raises and prototype.symbol == single_symbol(package.robot, kernel.name))
        ),
    )


def batch_symbol(robot: str, kernel: str) -> str:
    """Return the name of the C function that computes a generated function for many states."""
    return f"{robot}_{kernel}_batch"


def single_symbol(robot: str, kernel: str) -> str:
    """Return the name of the C function that computes a generated function for one state."""
    return f"{robot}_{kernel}"


def interface_to_json(interface: Interface, library: str) -> str:
    """Return an interface, and the key of its library in the cache, as JSON text."""
    return json.dumps({"format": FORMAT, "library": library, "interface": asdict(interface)})


def interface_from_json(text: str) -> tuple[Interface, str]:
    """Return interface and key from the text that `interface_to_json` wrote. Raises InternalError for any other text."""
    try:
        whole = json.loads(text)
        if whole["format"] != FORMAT:
            raise ValueError(f"format {whole['format']}, expected {FORMAT}")
        plain = _with_tuples(whole["interface"])
        mappings = {name: dict(plain[name]) for name in ("kernels", "patterns")}
        return Interface(**{**plain, **mappings}), str(whole["library"])
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise InternalError(f"a kept interface cannot be read: {error}") from error


def _with_tuples(value: Any) -> Any:
    """A value of JSON with tuples in the place of lists."""
    if isinstance(value, dict):
        return {name: _with_tuples(each) for name, each in value.items()}
    return tuple(map(_with_tuples, value)) if isinstance(value, list) else value


@dataclass(frozen=True, slots=True)
class Origin:
    """How a compiled robot can be built again, for example in another process.

    again    importable function that returns the robot
    request  its argument, which can be pickled
    key      text that is equal for equal robots
    """

    again: Callable[[Any], Any]
    request: Any
    key: str
