"""Constant tables of the package: joint names and limits, gravity, base parameters."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

from psdmc.emit.info import PackageInfo
from psdmc.emit.names import c_string


@dataclass(frozen=True, slots=True)
class Table:
    """One constant array: its C declaration without `extern`, and its entries as C text."""

    declaration: str
    entries: tuple[str, ...]


def tables(info: PackageInfo, robot: str, real: str) -> tuple[Table, ...]:
    """All tables of a package, in the header's order."""

    def numbers(name: str, size: str, values: Iterable[float | None]) -> Table:
        entries = tuple(number(value, real) for value in values)
        return Table(f"const {real} {robot}_{name}[{size}]", entries)

    def texts(name: str, size: str, values: Iterable[str]) -> Table:
        return Table(f"const char *const {robot}_{name}[{size}]", tuple(map(c_string, values)))

    joints, parameters = info.joints, info.parameters
    dof, count = f"{robot}_DOF", f"{robot}_BASE_PARAMETERS"
    return (
        texts("joint_names", dof, (joint.name for joint in joints)),
        texts("joint_units", dof, (joint.unit for joint in joints)),
        numbers("position_lower", dof, (joint.lower for joint in joints)),
        numbers("position_upper", dof, (joint.upper for joint in joints)),
        numbers("speed_limit", dof, (joint.speed for joint in joints)),
        numbers("acceleration_limit", dof, (joint.acceleration for joint in joints)),
        numbers("effort_limit", dof, (joint.effort for joint in joints)),
        numbers("gravity_acceleration", "3", info.gravity),
        numbers("theta_b", count, (parameter.value for parameter in parameters)),
        texts("base_parameter_equations", count, (parameter.equation for parameter in parameters)),
        texts("base_parameter_units", count, (parameter.unit for parameter in parameters)),
    )


def number(value: float | None, real: str) -> str:
    """A real constant; None (unknown) is NaN."""
    if value is None or math.isnan(value):
        return f"({real})NAN"
    if math.isinf(value):
        return f"({real})INFINITY" if value > 0 else f"-({real})INFINITY"
    return f"{float(value)!r}{'' if real == 'double' else 'f'}"
