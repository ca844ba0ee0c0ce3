"""Determines torque constants for a calibration from plain logs: given ones, or those from logs with a known load."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from psdmc.calibration.identify.estimate import Estimate, Prior, torque_sizes
from psdmc.calibration.identify.least_squares import Block, estimate_rows, residual_of, with_rows
from psdmc.calibration.identify.linear_fit import linear_prior
from psdmc.calibration.identify.linear_problem import LinearOptions, LinearProblem, linear_problem
from psdmc.calibration.identify.motor import MotorResult, negative_warnings
from psdmc.calibration.identify.motor_model import Motors, one_quantity, require_constants
from psdmc.calibration.identify.predictor import Regressor
from psdmc.calibration.identify.residuals import noise_warnings
from psdmc.calibration.identify.steps import judged
from psdmc.calibration.known_load import REMEDIES, KnownLoad, unreached
from psdmc.calibration.logs.filter import stretches
from psdmc.calibration.logs.foreign_bytes import listed
from psdmc.calibration.logs.log import AnyLog, Array
from psdmc.calibration.logs.log_checks import checked
from psdmc.calibration.verdict.delivered import log_parts, reread
from psdmc.calibration.verdict.record import Calibration, logs_used, with_model
from psdmc.errors import InputError
from psdmc.model.calibrated import LoadUsed, Remark, StepQuality, code_of
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.progress import Progress
from psdmc.robot.mechanism import Mechanism

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
    if chain.has_mimic_joints:
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
    names, motors = chain.joint_names, found.motors(chain.joint_names, given or {})
    missing = [k for k, value in enumerate(motors.torque_constant) if np.isnan(value)]
    if missing:
        constants = motors.torque_constant
        seen = ",".join(f"{names[k]}={constants[k]:.6g}" for k in range(len(names)) if found.identified[k])
        reasons = [text for text in found.warnings if code_of(text) == "constant_not_found"]
        raise InputError(
            f"{'; '.join(reasons)} (found: {seen})",
            "or give --torque-constants for " + ", ".join(names[k] for k in missing),
        )
    return motors, found


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


# Torque constants from logs of currents
#
# Determines torque constants from ordinary exciting logs, recorded without and with a known load.
#
# The current i_k of joint k fulfils
#
#     K_k i_k = Y_k theta_b + F_k phi + s w_k        s = 1 with the load, 0 without
#
# K_k is the torque constant, and F_k phi is the friction. Y_k theta_b is the torque of the rigid bodies
# (regressor times base parameters). w_k is the torque of the known load, which sets the scale. Without it,
# K, theta_b and phi would have an arbitrary common factor.
#
# All joints form one problem, because they share theta_b. So a joint on which the load's weight hardly acts
# is determined through shared inertias. The noise is in the current, so the residual, in torque, is
#
#     r_k = K_k i_k - (Y_k theta_b + F_k phi + s w_k) (1 - kappa_k)
#
# kappa_k is the relative error of K_k. The residual is linearised in kappa about the torque of the last
# iteration. So the fit takes Gauss-Newton steps of a fit of currents, which noise does not bias. Gautier
# and Briot (Global identification of joint drive gains and dynamic parameters of robots, 2014) use total
# least squares instead.
#
# Friction and offset have separate columns with the load, because bearings are pressed harder then.


ROUNDS = 40
"""Gauss-Newton steps at most; three or four are usual."""
SETTLED = 1e-7
"""Relative change of every torque constant that ends them."""
LARGEST_STEP = 1.0
"""Of a step after the first, in the constant's logarithm."""
WORST = 0.05
"""Relative standard deviation from which a torque constant is not found: the motor sweeps' limit, too."""
MOST_POSES = 400
"""Of a log, in which the load's weight is looked at."""


@dataclass(frozen=True, slots=True, eq=False)
class LoadedRows:
    """The rows of the fit of torque constants, with separate friction for logs with the load and a column for each
    constant.

    problem    rows of all logs, without the additional columns
    with_load  (N samples,) whether a sample was recorded with the load
    torque     (N, n joints) N m, current times torque constant of the last iteration
    """

    problem: LinearProblem
    with_load: NDArray[np.bool_]
    torque: Array

    def prior(self, plain: Prior) -> Prior:
        """Return the values of all unknowns before the fit, with a plausible size of each. The unknowns are base
        parameters, friction without the load, friction with the load, and relative errors of torque constants. The
        errors start from zero.

        plain  values before the fit of base parameters and friction
        """
        l, n = self.problem.l, self.torque.shape[1]
        values, scale = plain.values, plain.scale
        return Prior(
            np.concatenate([values, values[l:], np.zeros(n)]), np.concatenate([scale, scale[l:], np.ones(n)])
        )

    def __iter__(self) -> Iterator[Block]:
        n = self.torque.shape[1]
        for block, own in with_rows(self.problem.rows):
            gains = -self.torque[own, :, None] * np.eye(n)
            noise = None if block.noise is None else self._apart(block.noise, own, np.zeros_like(gains))
            yield Block(self._apart(block.columns, own, gains), noise)

    def _apart(self, columns: Array, own: slice, gains: Array) -> Array:
        l, loaded = self.problem.l, self.with_load[own, None, None]
        rigid, rubbed = columns[:, :, :l], columns[:, :, l:]
        return np.concatenate([rigid, rubbed * ~loaded, rubbed * loaded, gains], axis=2)


def motors_by_load(
    chain: Mechanism,
    model: Regressor,
    l: int,
    empty: Sequence[AnyLog],
    loaded: Sequence[AnyLog],
    load: KnownLoad,
    options: LinearOptions,
    theta_b: Array | None,
    progress: Progress,
) -> MotorResult:
    """Return torque constants from checked logs of currents, without and with a known load. A constant that the logs do
    not determine is NaN, with a warning.

    theta_b  (l,) the l base parameters of the robot file. They remain in directions (linear combinations) that the logs
             do not determine; None: zero

    Raises InputError if the load acts on no joint, or if all constants are negative.
    """
    logs = [*empty, *loaded]
    options = replace(
        options, columns=options.columns.without_load()
    )  # what the load adds to friction has columns
    problem, _ = linear_problem(chain, model, l, logs, options, Motors.torques(len(chain)), progress)
    added = load.torques(chain, loaded, options.filter, options.check, options.stretch)
    count = len(problem.torque) - len(added)
    known = np.concatenate([np.zeros((count, len(chain))), added])
    progress("torque constants: solving")
    constants, solved = _settled(
        chain, model, problem, known, np.arange(len(known)) >= count, options, theta_b
    )
    std = solved.std[-len(chain) :]
    found = std < WORST
    _require_some(listed([log.name for log in loaded], 3), constants, found)
    warnings = [note for log in loaded for note in log.notes]
    warnings += noise_warnings("motors", chain.joint_names, solved)
    if not found.all():
        warnings += _missing(chain, found, added, loaded, load, options)
    warnings += negative_warnings(chain.joint_names, np.where(found, constants, np.nan))
    return MotorResult(
        np.where(found, constants, np.nan), np.where(found, np.abs(constants) * std, np.nan), tuple(warnings)
    )


def _settled(
    chain: Mechanism,
    model: Regressor,
    problem: LinearProblem,
    known: Array,
    with_load: NDArray[np.bool_],
    options: LinearOptions,
    theta_b: Array | None,
) -> tuple[Array, Estimate]:
    """(n,) N m/A, and the last step, whose last n standard deviations are relative ones of the constants.

    known  (N, n) N m, the load's torque
    """
    n, current = len(chain), problem.torque
    kept = np.repeat(~problem.held_out[:, None], n, axis=1)
    # first the size of the load's torque over that of the current: right within a factor of a hundred or so
    sizes, currents = torque_sizes(known[with_load]), torque_sizes(current)
    constants = np.asarray(sizes / np.where(currents > 0.0, currents, 1.0))
    rows = LoadedRows(problem, with_load, current * constants)
    for step in range(ROUNDS):
        prior = rows.prior(
            linear_prior(chain, model, replace(problem, torque=current * constants), options, theta_b)
        )
        measured = current * constants - known
        solved = estimate_rows(rows, measured, options.fit, None, kept, prior)
        kappa = solved.values[-n:]
        if np.abs(kappa).max() < SETTLED:
            break
        # before the first step the torque is the current's own, whose sign may be wrong
        change = np.exp(np.clip(kappa, -LARGEST_STEP, LARGEST_STEP)) if step else 1.0 + kappa
        constants = constants * change
        without_gains = np.concatenate([solved.values[:-n], np.zeros(n)])
        rows = LoadedRows(problem, with_load, measured + known - residual_of(rows, measured, without_gains))
    return constants, solved


def _require_some(logs: str, constants: Array, found: NDArray[np.bool_]) -> None:
    """InputError where the load is not seen at all, or with the wrong sign everywhere."""
    if not found.any():
        raise InputError(
            f"{logs}: the load does not show in the currents of any joint",
            "check that it was mounted, and its numbers; use a heavier one, farther out, or move faster",
        )
    if (constants[found] < 0.0).all():
        raise InputError(
            f"{logs}: the load lowers the currents where it should raise them, at every joint",
            "are the logs with and without the load exchanged? else turn the currents' signs in both",
        )


def _missing(
    chain: Mechanism,
    found: NDArray[np.bool_],
    added: Array,
    loaded: Sequence[AnyLog],
    load: KnownLoad,
    options: LinearOptions,
) -> list[str]:
    """A sentence for each joint without a constant: why, and what to mount or how to move."""
    poses = []
    for log in loaded:
        parts = stretches(log, options.filter, options.check, options.stretch)
        whole = np.concatenate([part.states.q[part.at] for part in parts])
        poses.append(whole[:: max(1, len(whole) // MOST_POSES)])
    reasons = unreached(chain, np.concatenate(poses), load)
    sentences: list[str] = []
    for k, joint in enumerate(chain.joints):
        if found[k]:
            continue
        unit = "N" if joint.type.length_order else "N m"
        felt = f"the load adds at most {np.abs(added[:, k]).max():.3g} {unit}"
        reason = reasons.get(joint.name)
        remedy = (
            REMEDIES[reason] if reason else "mount more, farther from the axis, or move faster and longer"
        )
        why = f"{reason}, and {felt}" if reason else felt
        sentences.append(
            Remark(f"joint {joint.name}: torque constant not found: {why}; {remedy}", "constant_not_found")
        )
    return sentences
