"""Determines torque constants for a calibration from plain logs: given ones, or those from logs with a known load."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from psdmc.calibration.identify.known_load import KnownLoad
from psdmc.calibration.identify.linear_options import LinearOptions
from psdmc.calibration.identify.motor import MotorResult
from psdmc.calibration.identify.motor_logs import motors_by_load
from psdmc.calibration.identify.motor_model import Motors, one_quantity, require_constants
from psdmc.calibration.identify.predictor import Regressor
from psdmc.calibration.identify.steps import judged
from psdmc.calibration.logs.log_checks import checked
from psdmc.calibration.logs.stored_log import AnyLog
from psdmc.calibration.verdict.delivered import log_parts, reread
from psdmc.calibration.verdict.record import Calibration, logs_used, with_model
from psdmc.errors import InputError
from psdmc.model.calibrated import LoadUsed, StepQuality, code_of
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.progress import Progress

NOTICED = 0.05
"""Share of a joint's torque from which the known load's part of it is judged: the verdict's share for gains."""


@dataclass(frozen=True, slots=True, eq=False)
class LoadedLogs:
    """Logs of currents that were recorded with a known load on the robot, and that load."""

    logs: Sequence[AnyLog]
    load: KnownLoad


def motors_with_load(
    model: DynamicsModel,
    regressor: Regressor,
    logs: Sequence[AnyLog],
    loaded: LoadedLogs,
    options: LinearOptions,
    given: Mapping[str, float] | None,
    progress: Progress,
) -> tuple[Motors, MotorResult]:
    """Return the torque constants of all motors from logs of currents without and with a known load.

    given  N m/A by joint name, for joints whose constant the logs do not determine

    Raises InputError if the logs hold no currents, or if a joint has neither constant.
    """
    chain = model.mechanism
    if chain.has_followers:
        raise InputError(
            "torque constants are of joints that follow no other", "lock those that do, or log torques"
        )
    if options.coupling:
        raise InputError(
            "a known load shows the torque constants of motors that drive one joint each",
            "give the constants in the description, [[joint]] or --torque-constants",
        )
    require_constants(given or {}, chain.joint_names)
    quantity = one_quantity([*logs, *loaded.logs])
    if quantity != "current":
        raise InputError(
            f"{loaded.logs[0].name}: holds {quantity}: torques need no torque constants",
            "leave --loaded and --load out; `psdmc payload` identifies an unknown load",
        )
    empty, full = (
        [checked(log, chain, options.filter.cutoff, options.check) for log in own]
        for own in (logs, loaded.logs)
    )
    found = motors_by_load(
        chain, regressor, model.l, empty, full, loaded.load, options, model.theta_b, progress
    )
    return _together(chain.joint_names, found, given or {}), found


def _together(names: Sequence[str], found: MotorResult, given: Mapping[str, float]) -> Motors:
    known = np.array([given.get(name, np.nan) for name in names], dtype=np.float64)
    constants = np.where(found.identified, found.torque_constant, known)
    missing = [k for k, value in enumerate(constants) if np.isnan(value)]
    if missing:
        seen = ",".join(f"{names[k]}={constants[k]:.6g}" for k in range(len(names)) if found.identified[k])
        reasons = [text for text in found.warnings if code_of(text) == "constant_not_found"]
        raise InputError(
            f"{'; '.join(reasons)} (found: {seen})",
            "or give --torque-constants for " + ", ".join(names[k] for k in missing),
        )
    relative = np.where(found.identified, np.abs(found.std / constants), 0.0)
    return Motors(constants, relative)


def with_loaded_logs(
    record: Calibration, loaded: LoadedLogs, found: MotorResult, options: LinearOptions
) -> Calibration:
    """Return the result of a calibration with the accuracy of the torque constants added.

    The accuracy is the column Motor of the report's accuracy table. The torques are computed from the model's file
    after the file was written and read back.
    """
    load = loaded.load
    used = LoadUsed(
        float(load.mass),
        tuple(float(value) for value in load.com),
        tuple(float(value) for value in load.inertia),
        load.frame or record.model.mechanism.tip_name,
    )
    notes = (
        ()
        if not load.is_point
        else ("the load is taken as a point: its inertia about its centre is not given",)
    )
    step = loaded_quality(record.model, loaded, options)
    return with_model(
        replace(
            record,
            steps=(step, *record.steps) if step.joints else record.steps,
            logs=(*record.logs, *logs_used(loaded.logs, "with_load")),
            load=used,
            warnings=(*found.warnings, *record.warnings),
            notes=(*record.notes, *notes),
        )
    )


def loaded_quality(model: DynamicsModel, loaded: LoadedLogs, options: LinearOptions) -> StepQuality:
    """Return how well a calibrated model predicts the additional torque of a known load, for each joint.

    The measured additional torque is the measured torque minus the model's torque without load. Joints on which the
    load's torque is small compared with the measured torque are left out.
    """
    model = reread(model)
    chain = model.mechanism
    full = [checked(log, chain, options.filter.cutoff, options.check) for log in loaded.logs]
    parts = [log_parts(model, log, options.check) for log in full]
    time, measured, without, out = (np.concatenate([part[k] for part in parts]) for k in range(4))
    added = loaded.load.torques(chain, full, options.filter, options.check, options.stretch)
    size = partial(np.std, axis=0)
    judgeable = out.any()  # beside whole logs for validation nothing of this one is held out
    noticed = np.flatnonzero(judgeable & (size(added) >= NOTICED * size(measured)))
    names = [chain.joint_names[k] for k in noticed]
    left = (measured - without)[:, noticed]
    return judged("Motor", names, time, left, added[:, noticed], np.asarray(out, dtype=bool))
