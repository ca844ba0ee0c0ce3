"""The description of the robot at the top of a generated package."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from itertools import accumulate

from psdmc.backends.info import EmitOptions, JointInfo, PackageInfo
from psdmc.program.signature import Signature
from psdmc.robot.mechanism import BASE_FRAME, POINT, ROW_NAMES
from psdmc.target.presets import NATIVE
from psdmc.target.target import Target


def facts(info: PackageInfo, options: EmitOptions) -> tuple[str, ...]:
    """Return the facts about a robot as lines of text: joints, limits, gravity, base parameters, model and options.
    Names from the robot file are not escaped yet."""
    gx, gy, gz = info.gravity
    return (
        f"Robot: {info.name}, {_extent(info)}",
        f"Model: {info.model_hash or 'not hashed'}",
        f"Options: {', '.join(f'{key}={value}' for key, value in option_items(info, options).items())}",
        *_target(options.target),
        "Units: SI. Positions rad (m), rates rad/s (m/s), torques N m (N) for revolute (prismatic) joints.",
        f"Gravity: ({gx:g}, {gy:g}, {gz:g}) m/s^2 in the {info.base_frame}",
        *((_GRAVITY_INPUT,) if info.gravity_input else ()),
        "",
        "Joints, each behind those that carry it:" if info.is_tree else "Joints, from base to tip:",
        *(f"  {i}  {line}" for i, line in enumerate(_joints(info))),
        *(f"     {sentence}" for sentence in info.mimic_joints),
        "",
        "theta_b, base parameters in standard parameters about the file's link frames:",
        *(f"  {i}  {parameter.equation}  [{parameter.unit}]" for i, parameter in enumerate(info.parameters)),
        "",
    )


_GRAVITY_INPUT = (
    "Functions that depend on gravity read it from the input gravity[3], m/s^2 in this frame, one per state."
)


def axis_lines(info: PackageInfo, signatures: Iterable[Signature], with_frames: bool) -> tuple[str, ...]:
    """Return lines of text that list the named frames, contacts and closed loops by number. Contacts and loops are left
    out if no function has arrays over them, and frames unless `with_frames`."""
    numbered = (f"  {i}  {name}" for i, name in enumerate(info.frames))
    frames = ("", "Frames, in the order of every array over them:", *numbered) if with_frames else ()
    return (*frames, *(_contact_lines(info) if uses_contacts(signatures) else ()))


def _contact_lines(info: PackageInfo) -> tuple[str, ...]:
    """The contacts by number, with their rows, and the closed loops."""
    ends = accumulate(rows for _, rows in info.contacts)
    numbered = (
        f"  {i}  {name}, {'a point' if rows == POINT else 'a surface'}: rows {end - rows} to {end - 1}"
        for i, ((name, rows), end) in enumerate(zip(info.contacts, ends, strict=True))
    )
    return ("", "Contacts, in the order of every array over them:", *numbered, *_loop_lines(info))


def _loop_lines(info: PackageInfo) -> tuple[str, ...]:
    """The closed loops by number, with their rows; none without loops."""
    if not info.loops:
        return ()
    first = info.sizes.contact_rows
    numbered = (
        f"  {i}  {name}: {', '.join(ROW_NAMES[row] for row in rows)}"
        for i, (name, rows) in enumerate(info.loops)
    )
    return (
        "",
        f"Closed loops, with their rows along the axes of the first frame. In forces, they begin at entry {first}. They are",
        "always active: active has no entry for them, and error none, as it is computed. Returned numbers of contacts",
        f"from {info.sizes.contacts} on are theirs, and loops count as contacts there. kp and kd apply to them, and so does",
        "mu. All functions without contacts or loops compute the spanning tree, in which the loops are open.",
        *numbered,
    )


def _extent(info: PackageInfo) -> str:
    if info.base_frame != BASE_FRAME:
        return f"a floating base in the world ({info.base})"
    return f"a tree on {info.base}" if info.is_tree else f"from {info.base} to {info.tip}"


def _target(target: Target) -> tuple[str, ...]:
    """A chosen target, and how compilers build for it; empty for the default."""
    if target == NATIVE:
        return ()
    flags = f"; compile with {' '.join(target.flags)}" if target.flags else ""
    return (f"Target: {target.name}, {target.about}{flags}",)


def uses_frames(signatures: Iterable[Signature]) -> bool:
    """Return whether one of the functions has an input or output for the named frames of the robot."""
    return any("frames" in q.axes for s in signatures for q in (*s.inputs, *s.outputs))


def uses_contacts(signatures: Iterable[Signature]) -> bool:
    """Return whether one of the functions has an input or output for the contacts of the robot."""
    return any({"contact_rows", "loop_rows"} & {*q.axes} for s in signatures for q in (*s.inputs, *s.outputs))


def option_items(info: PackageInfo, options: EmitOptions) -> dict[str, str]:
    """Return the package's options that the user chose, by name; the target only if it is not the default."""
    target = {} if options.target == NATIVE else {"target": options.target.name}
    return {"real": options.real, "trig": options.trig, **info.options, **target}


def _joints(info: PackageInfo) -> Iterator[str]:
    """A line for each joint, with its places in q and rates where these are not its number."""
    if not info.is_wide:
        yield from map(joint_line, info.joints)
        return
    q, v = 0, 0
    for joint in info.joints:
        yield f"{joint_line(joint)}; {_places('q', q, joint.nq)}, {_places('rates', v, joint.nv)}"
        q, v = q + joint.nq, v + joint.nv


def _places(vector: str, first: int, count: int) -> str:
    return f"{vector}[{first}]" if count == 1 else f"{vector}[{first}..{first + count - 1}]"


def joint_line(joint: JointInfo) -> str:
    """Return one line of text about a joint with its limits; unknown limits are left out."""
    parts = [f"{joint.name} ({joint.kind}{': ' if joint.coordinates else ''}{joint.coordinates})"]
    if math.isfinite(joint.lower) or math.isfinite(joint.upper):
        parts.append(f"{joint.lower:.9g} to {joint.upper:.9g} {joint.unit}")
    for value, unit in (
        (joint.speed, f"{joint.unit}/s"),
        (joint.acceleration, f"{joint.unit}/s^2"),
        (joint.effort, joint.effort_unit),
    ):
        if math.isfinite(value):
            parts.append(f"{value:.9g} {unit}")
    if joint.parent:
        parts.append(f"on link {joint.parent}")
    return ", ".join(parts)
