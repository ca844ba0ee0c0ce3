"""The robot in words: the lines that open the header."""

from __future__ import annotations

import math

from psdmc.emit.info import JointInfo, PackageInfo
from psdmc.emit.options import EmitOptions


def description(info: PackageInfo, options: EmitOptions) -> tuple[str, ...]:
    """Joints, limits, gravity, parameters, model and options, one line each; untrusted names still
    unescaped."""
    gx, gy, gz = info.gravity
    lines = [
        f"Robot: {info.name}, from {info.base} to {info.tip}",
        f"Model: {info.model_hash or 'not hashed'}",
        f"Options: {', '.join(f'{key}={value}' for key, value in option_items(info, options).items())}",
        "Units: SI. Positions rad (m), rates rad/s (m/s), torques N m (N) for revolute (prismatic) joints.",
        f"Gravity: ({gx:g}, {gy:g}, {gz:g}) m/s^2 in the base frame",
        "",
        "Joints, from base to tip:",
        *(f"  {i}  {joint_line(joint)}" for i, joint in enumerate(info.joints)),
        "",
        "theta_b, base parameters in standard parameters about the file's link frames:",
        *(f"  {i}  {parameter.equation}  [{parameter.unit}]" for i, parameter in enumerate(info.parameters)),
        "",
        "Arrays: n reals per vector; matrices row-major. Inputs may overlap each other. An output may overlap any",
        "input of a call for one state. In a batch it may be the very array of an input whose rows are equally long,",
        "and must not overlap an input (theta_b is one) in any other way.",
        "  _batch      one state per row",
        "  _batch_soa  blocks of LANES states, [block][variable][lane]; the last block is whole, too",
        "  _theta      with the base parameters theta_b given at run time (_theta_batch: one theta_b for all rows)",
        "forward_dynamics returns 0, or 1 + the joint whose pivot is not positive, or (batch) 1 + the first",
        "row that has one; the accelerations of such a state are NaN.",
    ]
    return tuple(lines)


def option_items(info: PackageInfo, options: EmitOptions) -> dict[str, str]:
    return {"real": options.real, "trig": options.trig, **info.options}


def joint_line(joint: JointInfo) -> str:
    """A joint and its limits; those that are unknown are left out."""
    parts = [f"{joint.name} ({joint.kind})"]
    if math.isfinite(joint.lower) or math.isfinite(joint.upper):
        parts.append(f"{joint.lower:.9g} to {joint.upper:.9g} {joint.unit}")
    for value, unit in (
        (joint.speed, f"{joint.unit}/s"),
        (joint.acceleration, f"{joint.unit}/s^2"),
        (joint.effort, joint.effort_unit),
    ):
        if math.isfinite(value):
            parts.append(f"{value:.9g} {unit}")
    return ", ".join(parts)
