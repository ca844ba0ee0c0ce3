"""Decides whether the effort columns of a log description give currents or torques."""

from __future__ import annotations

from collections.abc import Sequence

from psdmc.calibration.description.columns_found import Found
from psdmc.calibration.description.description import LogDescription
from psdmc.calibration.description.table_joints import JOINTS
from psdmc.calibration.description.table_quantities import EFFORT, refused
from psdmc.calibration.logs.log import Quantity
from psdmc.calibration.logs.wording import listed, quoted


def held_quantity(efforts: Sequence[tuple[str, Found]], coupled: bool) -> Quantity:
    """Return the quantity (current, motor torque or joint torque) that a log holds in memory, from the effort columns
    of its joints.

    Currents remain currents if all joints have currents and no joint is driven by several motors. Otherwise, currents
    are converted to torques. Raises InputError if torques of two kinds would mix, or if a torque constant is missing.
    """
    _require_motor_torques(efforts)
    held = {found.quantity for _, found in efforts}
    if held == {"current"} and not coupled:
        _require_known_gears(efforts)
        return "current"
    torques = sorted(held - {"current"})
    if "current" in held and "joint_torque" in held:
        both = ", ".join(f"{quoted(name)} {found.quantity}" for name, found in efforts)
        raise refused(f"effort: {both}: currents make motor torques, expected one quantity")
    if len(torques) > 1:
        both = ", ".join(f"{quoted(name)} {found.quantity}" for name, found in efforts)
        raise refused(f"effort: joints hold {both}, expected one quantity")
    lacking = [
        quoted(name)
        for name, found in efforts
        if found.quantity == "current" and found.entry.torque_constant is None
    ]
    if lacking:
        why = "motors are coupled" if coupled else "other joints hold torques"
        raise refused(
            f"effort: torque_constant missing for joint(s) {listed(lacking)}: {why}, expected N m/A"
        )
    return "joint_torque" if torques == ["joint_torque"] else "motor_torque"


def _require_motor_torques(efforts: Sequence[tuple[str, Found]]) -> None:
    """A current is of a motor, whose torque has friction in it."""
    odd = [
        quoted(name)
        for name, found in efforts
        if found.quantity == "current" and found.entry.quantity == "joint_torque"
    ]
    if odd:
        raise refused(
            f"effort: quantity 'joint_torque' of joint(s) {listed(odd)}, whose unit is A or mA: expected "
            "'motor_torque', which it is unless said"
        )


def _require_known_gears(efforts: Sequence[tuple[str, Found]]) -> None:
    odd = [
        quoted(name)
        for name, found in efforts
        if found.entry.gear_ratio is not None and found.entry.torque_constant is None
    ]
    if odd:
        raise refused(
            f"effort: gear_ratio without torque_constant for joint(s) {listed(odd)}, expected both, or neither "
            "and --torque-constants of joint and gear together"
        )


def torque_factor(found: Found, quantity: Quantity) -> float:
    """Return the factor by which an effort column is multiplied. It is the torque per ampere at the joint if the column
    holds currents and `quantity` is a torque; else 1."""
    if found.quantity != "current" or quantity == "current":
        return 1.0
    return (found.entry.torque_constant or 1.0) * (found.entry.gear_ratio or 1.0)


def torque_constants(description: LogDescription, joint_names: Sequence[str]) -> dict[str, float]:
    """Return the torque constants, N m/A at the joint (after the gear), that the description gives, by joint."""
    said = {joint.name: joint.effort for joint in description.part(JOINTS)}
    usual = description.part(EFFORT)
    entries = {name: said[name].over(usual) if name in said else usual for name in joint_names}
    return {
        name: entry.torque_constant * (entry.gear_ratio or 1.0)
        for name, entry in entries.items()
        if entry.torque_constant is not None
    }
