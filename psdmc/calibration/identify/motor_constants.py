"""Checks given torque constants against the joints and against the quantities of the logs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from psdmc.calibration.identify.motor_model import Motors
from psdmc.calibration.logs.log import Quantity
from psdmc.calibration.logs.stored_log import AnyLog
from psdmc.calibration.logs.wording import first_faults, listed, quoted
from psdmc.errors import InputError

LARGEST_CONSTANT = 1e6
"""N m/A at the joint, gear included: a thousand times the largest robot's."""


def require_constants(constants: Mapping[str, float], joint_names: Sequence[str]) -> None:
    """Raise InputError if a given torque constant belongs to no joint, or is not a positive number."""
    unknown = [quoted(name) for name in constants if name not in joint_names]
    if unknown:
        raise InputError(
            f"torque constants: no joint(s) {listed(unknown)}", f"the model has {listed(joint_names)}"
        )
    odd = [
        f"joint {name}: {value:g}" for name, value in constants.items() if not 0 < value <= LARGEST_CONSTANT
    ]
    if odd:
        raise InputError(
            f"torque constants: {first_faults(odd)}: expected positive numbers, at most {LARGEST_CONSTANT:g} N m/A",
            "if a positive current gives a negative torque, change the sign of the current in the log",
        )


def one_quantity(logs: Sequence[AnyLog]) -> Quantity:
    """Return the quantity that all logs record as effort: current or torque. Raises InputError with the names of the
    logs if they record different quantities."""
    by_quantity: dict[Quantity, list[str]] = {}
    for log in logs:
        by_quantity.setdefault(log.quantity, []).append(log.name)
    if len(by_quantity) > 1:
        held = "; ".join(f"{quantity} in {listed(names, 3)}" for quantity, names in by_quantity.items())
        raise InputError(
            f"the logs hold different things: {held}",
            "calibrate with logs of one kind, or turn the currents into motor_torque_nm columns",
        )
    return next(iter(by_quantity))


def motors_of_logs(
    joint_names: Sequence[str], logs: Sequence[AnyLog], constants: Mapping[str, float] | None
) -> Motors:
    """Return the motors that convert the effort in plain logs to torques.

    constants   N m/A by joint name, for logs of currents; None for logs of torques

    Raises InputError if constants are given for torques or missing for currents, or if the logs have different
    quantities.
    """
    require_constants(constants or {}, joint_names)
    quantity = one_quantity(logs)
    if quantity != "current":
        refuse_constants(constants, logs[0])
        return Motors.torques(len(joint_names))
    if not constants:
        raise InputError(
            f"{logs[0].name}: holds currents, and no torque constants are known",
            "give --torque-constants, a second log with a known load (--loaded, --load), or run a campaign",
        )
    missing = [name for name in joint_names if name not in constants]
    if missing:
        raise InputError(
            f"no torque constant for joint(s) {listed(missing)}", "give --torque-constants for them"
        )
    return Motors(np.array([constants[name] for name in joint_names]), np.zeros(len(joint_names)))


def refuse_constants(constants: Mapping[str, float] | None, log: AnyLog) -> None:
    """Raise InputError if torque constants are given although a log holds torques."""
    if constants:
        raise InputError(
            f"{log.name}: holds {log.quantity}, which torque constants are not for",
            "leave --torque-constants out; where the columns are currents, call them current_a.<joint>",
        )
