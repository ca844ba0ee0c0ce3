"""The adapter that writes an FMU, a model for simulation tools (FMI 3.0 or 2.0, model exchange and co-simulation). The
states are q and qd, the inputs are torques, and the outputs are accelerations.

The template declares the data types of the FMI standard itself. So the package contains no file of the standard and
keeps its licence. All values are in one array of doubles, and the value reference of a variable is an index into this
array.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from html import escape
from types import MappingProxyType

from psdmc.backends.c.adapters.suited import refuse_unsuited
from psdmc.backends.c.kernel_view import KernelView
from psdmc.backends.c.package import PackageView
from psdmc.backends.c.render import c_comment, render
from psdmc.program.signature import Signature

DYNAMICS, DIRECTION = "forward_dynamics_theta", "forward_dynamics_jvp_theta"

MORE_OUTPUTS = ("kinetic_energy_theta", "potential_energy_theta", "forward_kinematics")
"""Kernels whose outputs are the FMU's, too, where the package has them."""

ALONG = {"dq": "along", "dqd": "along + n", "dtau": "along + 2 * n", "qdd": "of", "dqdd": "of + n"}
"""Local arrays in C of directional derivatives, by name of the kernel's array."""

BASE_UNITS = {
    "rad": 'rad="1"',
    "rad/s": 'rad="1" s="-1"',
    "rad/s2": 'rad="1" s="-2"',
    "m": 'm="1"',
    "m/s": 'm="1" s="-1"',
    "m/s2": 'm="1" s="-2"',
    "N.m": 'kg="1" m="2" s="-2"',
    "N": 'kg="1" m="1" s="-2"',
    "J": 'kg="1" m="2" s="-2"',
}

FILES = {
    3: {
        "fmu/{}_fmu.c": "fmu.c",
        "fmu/modelDescription.xml": "modelDescription.xml",
        "fmu/buildDescription.xml": "buildDescription.xml",
        "fmu/pack.py": "fmu_pack.py",
    },
    2: {
        "fmu2/{}_fmu2.c": "fmu.c",
        "fmu2/modelDescription.xml": "modelDescription2.xml",
        "fmu2/pack.py": "fmu_pack.py",
    },
}
"""By version of FMI, the files of an FMU and their templates. FMI 2.0's functions call those of FMI 3.0."""

OF_THE_VARIABLE = ("name", "description", "causality", "variability", "initial")
"""Attributes that FMI 2.0 has in another element than unit and start."""


@dataclass(frozen=True, slots=True)
class Block:
    """Several variables of the FMU with consecutive value references, such as all entries of q. The data are the name,
    the index `at` of the first variable, the number of variables, and XML attributes that all of them share."""

    name: str
    at: int
    size: int
    attributes: str

    @property
    def end(self) -> int:
        return self.at + self.size


@dataclass(frozen=True, slots=True)
class Variable:
    """One variable of the FMU's model description: its value reference, and its attributes as XML text."""

    reference: int
    attributes: str

    @property
    def of_fmi2(self) -> tuple[str, str]:
        """Return the attributes of FMI 2.0's elements ScalarVariable and Real. A derivative names its state by the place
        in the list of variables, counted from 1."""
        pairs = re.findall(r'(\w+)="([^"]*)"', self.attributes)
        pairs = [(key, str(int(value) + 1) if key == "derivative" else value) for key, value in pairs]
        scalar, real = (
            " ".join(f'{key}="{value}"' for key, value in pairs if (key in OF_THE_VARIABLE) is of_it)
            for of_it in (True, False)
        )
        return scalar, real


def needed(functions: Sequence[Signature], wide: bool) -> list[str]:
    """An FMU integrates forward dynamics."""
    return ["forward_dynamics"]


def files(package: PackageView, version: int = 3) -> dict[str, str]:
    """Return the text of each file of the FMU's sources, by path, for FMI 3.0 or 2.0. Raises InputError if the package
    cannot become an FMU."""
    info, robot = package.info, package.robot
    kernels = {kernel.name: kernel for kernel in package.kernels}
    refuse_unsuited(package, "an FMU", "--with fmu" if version == 3 else "--with fmu2")
    more = [kernels[name] for name in MORE_OUTPUTS if name in kernels]
    blocks = {block.name: block for block in _blocks(package, more)}
    variables = [one for block in blocks.values() for one in _variables(block, package)]
    view = {
        "package": package,
        "version": version,
        "folder": "fmu" if version == 3 else "fmu2",
        "blocks": blocks.values(),
        "outputs": [block for block in blocks.values() if 'causality="output"' in block.attributes],
        "derivatives": [blocks["der_q"], blocks["qdd"]],
        "variables": variables,
        "units": BASE_UNITS,
        "token": hashlib.sha256(repr((info.psdmc_version, info.model_hash, variables)).encode()).hexdigest(),
        "description": _xml(info.name),
        "more": [(kernel.prototypes["single"].symbol, _arguments(kernel)) for kernel in more],
        "dynamics": _arguments(kernels[DYNAMICS]),
        "gravity": info.gravity if info.gravity_input else (),
        "direction": _arguments(kernels[DIRECTION], ALONG) if DIRECTION in kernels and not more else "",
    }
    return {
        path.format(robot): render(f"adapters/{text}.jinja", **view) for path, text in FILES[version].items()
    }


def _blocks(package: PackageView, more: Sequence[KernelView]) -> Iterator[Block]:
    """All variables, in the order of their value references."""
    n, computed = package.dof, 'causality="output" initial="calculated"'
    state = 'causality="output" initial="exact" start="0"'
    parameter = 'causality="parameter" variability="tunable"'
    blocks = [
        ("time", 1, 'causality="independent" variability="continuous" description="time, s"'),
        ("q", n, state),
        ("qd", n, state),
        ("tau", n, 'causality="input" start="0"'),
        ("der_q", n, 'causality="local" initial="calculated"'),
        ("qdd", n, computed),
        ("theta_b", package.l, parameter),
        *((("gravity", 3, parameter),) if package.info.gravity_input else ()),
        ("internal_step", 1, f'{parameter} start="0.001" min="0"'),
        *((output.name, output.size, computed) for kernel in more for output in kernel.outputs),
    ]
    at = 0
    for name, size, attributes in blocks:
        yield Block(name, at, size, attributes)
        at += size


def _variables(block: Block, package: PackageView) -> Iterator[Variable]:
    """A block's variables with what each has of its own: name, what it is, unit, start, what it is the derivative of."""
    joints, n = package.info.joints, package.dof
    per_joint = {"q": "", "qd": "/s", "tau": None, "der_q": "/s", "qdd": "/s2"}
    whole = {"time": "s", "internal_step": "s", "T": "J", "U": "J"}
    for k in range(block.size):
        own = {"name": block.name if block.size == 1 and block.name in whole else f"{block.name}[{k}]"}
        if block.name in per_joint:
            joint, after = joints[k], per_joint[block.name]
            own["description"] = f"joint {joint.name}"
            own["unit"] = joint.effort_unit.replace(" ", ".") if after is None else f"{joint.unit}{after}"
        if block.name in ("der_q", "qdd"):
            own["derivative"] = str(1 + k + (n if block.name == "qdd" else 0))
        if block.name == "theta_b":
            parameter = package.info.parameters[k]
            own |= {"description": f"{parameter.equation} [{parameter.unit}]", "start": repr(parameter.value)}
        if block.name == "gravity":
            frame, start = f"the {package.info.base_frame}", repr(package.info.gravity[k])
            own |= {"description": f"gravity along {'xyz'[k]} of {frame}", "unit": "m/s2", "start": start}
        if block.name == "internal_step":
            own["description"] = "largest step of the co-simulation's integrator, s"
        if whole.get(block.name) == "J":
            own["unit"] = "J"
        text = " ".join(f'{key}="{_xml(value)}"' for key, value in own.items())
        yield Variable(block.at + k, f"{text} {block.attributes}")


def _arguments(kernel: KernelView, places: Mapping[str, str] = MappingProxyType({})) -> str:
    """C text of a call's arguments: variables of the FMU, or other places by name of the array."""
    names = [vector.name for vector in kernel.inputs] + (["theta_b"] if kernel.theta else [])
    names += [output.name for output in kernel.outputs]
    return ", ".join(places.get(name, f"v + at_{name}") for name in names)


def _xml(text: str) -> str:
    """Untrusted text as it may stand in an attribute's quotation marks."""
    return escape(c_comment(text), quote=True)
