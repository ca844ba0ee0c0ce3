"""The data that calling a compiled library needs: names, sizes and prototypes, without the package that it was made
from.

It is kept beside libraries in the compile cache: a model that was compiled before is called without being lowered,
rendered or parsed again.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from typing import Any

from psdmc.backends.c.package import PackageView
from psdmc.backends.c.patterns import patterns
from psdmc.errors import InternalError
from psdmc.program.signature import Sizes
from psdmc.robot.mechanism import contact_names

FORMAT = 7
"""Version of the text's form."""


@dataclass(frozen=True, slots=True)
class Interface:
    """A compiled package as its caller needs it.

    robot        prefix of its symbols
    real         C's name of its floating-point type; `dtype` is NumPy's
    n, l         joints, base parameters
    nq, nv       lengths of q, and of rates and torques
    joint_names  n, from base to tip
    q_names      nq names of q's entries, and
    v_names      nv names of rates' and torques'
    frame_names  the named frames
    contacts     names and rows of the contacts
    units        parts of q, from an entry to before another, whose length must be one
    limits       n rows: lower, upper, speed, acceleration, effort; infinite where unknown
    gravity      3, m/s^2 in
    base_frame   the base frame, or the world frame of a floating base: its words
    theta_b      l base parameters; None while unknown
    kernels      name -> trailing axes of each of its results
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
    units: tuple[tuple[int, int], ...]
    limits: tuple[tuple[float, ...], ...]
    gravity: tuple[float, ...]
    base_frame: str
    theta_b: tuple[float, ...] | None
    kernels: Mapping[str, tuple[tuple[int, ...], ...]]
    patterns: Mapping[str, tuple[tuple[int, int], ...]]
    cdef: str

    @property
    def sizes(self) -> Sizes:
        """Return the sizes that the words of signatures mean for this robot."""
        rows = tuple(rows for _, rows in self.contacts)
        return Sizes(self.n, self.nq, self.nv, self.l, len(self.frame_names), rows_of_contacts=rows)

    @property
    def names(self) -> dict[str, tuple[str, ...]]:
        """Names along the axes of arrays, by the axes' words."""
        own = {"n": self.joint_names, "nq": self.q_names, "nv": self.v_names, "frames": self.frame_names}
        return own | contact_names(self.contacts)


def interface_of(package: PackageView) -> Interface:
    """The interface of a package's library: the batch function of each kernel, and where Python raises errors that name a
    pivot the one for one state."""
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
        units=package.info.units,
        limits=tuple((j.lower, j.upper, j.speed, j.acceleration, j.effort) for j in package.info.joints),
        gravity=package.info.gravity,
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
    """The C function that computes a kernel for many states."""
    return f"{robot}_{kernel}_batch"


def single_symbol(robot: str, kernel: str) -> str:
    """The C function that computes a kernel for one state."""
    return f"{robot}_{kernel}"


def interface_to_json(interface: Interface, library: str) -> str:
    """JSON text of an interface and of the key of its library in the cache."""
    return json.dumps({"format": FORMAT, "library": library, "interface": asdict(interface)})


def interface_from_json(text: str) -> tuple[Interface, str]:
    """Interface and key from `interface_to_json`'s text; InternalError where the text is another's."""
    try:
        whole = json.loads(text)
        if whole["format"] != FORMAT:
            raise ValueError(f"format {whole['format']}, expected {FORMAT}")
        plain = whole["interface"]
        joints, frames = tuple(plain.pop("joint_names")), tuple(plain.pop("frame_names"))
        coordinates, rates = tuple(plain.pop("q_names")), tuple(plain.pop("v_names"))
        contacts = tuple((str(name), int(rows)) for name, rows in plain.pop("contacts"))
        units = tuple((int(start), int(stop)) for start, stop in plain.pop("units"))
        kernels = {name: tuple(map(tuple, tails)) for name, tails in plain.pop("kernels").items()}
        places = {
            name: tuple((row, column) for row, column in own) for name, own in plain.pop("patterns").items()
        }
        limits, gravity = tuple(map(tuple, plain.pop("limits"))), tuple(plain.pop("gravity"))
        values = plain.pop("theta_b")
        found = Interface(
            joint_names=joints,
            q_names=coordinates,
            v_names=rates,
            frame_names=frames,
            contacts=contacts,
            units=units,
            limits=limits,
            gravity=gravity,
            theta_b=None if values is None else tuple(values),
            kernels=kernels,
            patterns=places,
            **plain,
        )
        return found, str(whole["library"])
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise InternalError(f"a kept interface cannot be read: {error}") from error


@dataclass(frozen=True, slots=True)
class Origin:
    """How a compiled robot is had again.

    again    importable by name; returns the robot
    request  its argument, which can be pickled
    key      the same for equal robots
    """

    again: Callable[[Any], Any]
    request: Any
    key: str
