"""How well a calibrated model file predicts logs. All figures are computed from the file's content, none from the fit.

The regressor is not used where one log was fitted: torques come from Newton-Euler on the file's theta_b.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from psdmc.calibration.campaign_file import read_campaign
from psdmc.calibration.columns.columns import Columns, read_columns
from psdmc.calibration.identify.coupling import coupling_of
from psdmc.calibration.identify.extra import motion_of
from psdmc.calibration.identify.four_steps import Runs
from psdmc.calibration.identify.friction import FrictionResult, judge_friction, prepared_runs
from psdmc.calibration.identify.friction_fit import JointFriction
from psdmc.calibration.identify.gravity import judge_gravity
from psdmc.calibration.identify.inertial import judge_inertial
from psdmc.calibration.identify.linear_options import LinearOptions
from psdmc.calibration.identify.linear_problem import friction_columns, names_of
from psdmc.calibration.identify.motor import judge_motors
from psdmc.calibration.identify.motor_model import Motors
from psdmc.calibration.identify.predictor import ChainRegressor
from psdmc.calibration.identify.state_friction import PARAMETERS
from psdmc.calibration.identify.steps import StepOptions, judged, step_of
from psdmc.calibration.logs.filter import States, held_out_of, smoothed_rows, stretches
from psdmc.calibration.logs.log import Array
from psdmc.calibration.logs.log_checks import CheckOptions, checked
from psdmc.calibration.logs.stored_log import AnyLog
from psdmc.calibration.sources import campaign_of, plain_sources
from psdmc.errors import InputError
from psdmc.friction.state import STATE_LAW
from psdmc.model import recursive
from psdmc.model.calibrated import Prediction, StepQuality, by_joint
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.model.load import load, model_of
from psdmc.model.store import save
from psdmc.progress import silent


@dataclass(frozen=True, slots=True, eq=False)
class Delivered:
    """A calibrated model as read from its file.

    friction         by joint and parameter name
    constants        N m/A by joint, empty where torques were logged
    shown            those of them that a step found; given ones are not judged by it
    columns, extra   springs and further friction, and their values (m,)
    """

    model: DynamicsModel
    prediction: Prediction
    friction: Mapping[tuple[str, str], float]
    constants: Mapping[str, float]
    shown: Mapping[str, float]
    columns: Columns = field(default_factory=Columns)
    extra: Array = field(default_factory=lambda: np.zeros(0))

    @property
    def theta_b(self) -> Array:
        return self.model.known_theta_b()

    @property
    def motors(self) -> Motors:
        """The motors, which turn logged effort into torque."""
        names = self.model.joint_names
        constants = (
            np.array([self.constants[name] for name in names]) if self.constants else np.ones(len(names))
        )
        return Motors(constants, np.zeros(len(names)))


def delivered(model: DynamicsModel) -> Delivered:
    """The contents of a calibrated model; InputError where it was not calibrated by this psdmc or a newer one."""
    kept = model.calibrated
    if model.theta_b is None or kept is None or kept.prediction is None:
        raise InputError(
            f"the model of '{model.mechanism.name}' holds no calibration that torques can be predicted from",
            "run `psdmc calibrate` first",
        )
    prediction = kept.prediction
    columns = read_columns(prediction.columns, model.mechanism, model.mechanism.name, prediction.offset)
    friction, springs = by_joint(kept.friction), by_joint(kept.springs)
    extra = [
        (springs if sprung else friction)[unknown.owner, unknown.name]
        for unknown, sprung in zip(columns.unknowns, columns.of_springs.tolist(), strict=True)
    ]
    constants = {row.joint: row.value for row in kept.motors}
    shown = {row.joint: row.value for row in kept.motors if row.seen}
    return Delivered(
        model, prediction, friction, constants, shown, columns, np.array(extra, dtype=np.float64)
    )


def sprung(found: Delivered) -> Callable[[States, NDArray[np.intp]], Array] | None:
    """(rows, n) torque of the springs alone, filtered like a log's, as a function of states and rows; None where there are
    none."""
    return beside(found, found.columns.of_springs)


def beside(found: Delivered, held: NDArray[np.bool_]) -> Callable[[States, NDArray[np.intp]], Array] | None:
    """The same of some of the extra columns (m,), none of which depends on the load."""
    if not held.any():
        return None
    values = np.where(held, found.extra, 0.0)

    def torque(states: States, at: NDArray[np.intp]) -> Array:
        def rows(own: slice) -> Array:
            law = found.prediction
            q, qd = states.q[own], states.qd[own]
            motion = motion_of(q, qd, law.sign_speed, coupling=coupling_of(law.coupling))
            return np.asarray(found.columns.values(motion) @ values)

        return smoothed_rows(states, at, rows)

    return torque


def reread(model: DynamicsModel) -> DynamicsModel:
    """The model after it was written to a file and read back."""
    with tempfile.TemporaryDirectory(prefix="psdmc_") as folder:
        path = Path(folder) / "model.npz"
        save(model, path)
        return load(path)


def delivered_quality(
    model: DynamicsModel | str | Path,
    source: str | Path | Sequence[AnyLog | str | Path] | Runs,
    check: CheckOptions | None = None,
) -> tuple[StepQuality, ...]:
    """R^2 and RMSE of a calibrated model on logs, or on a campaign's runs, from the content of its file.

    model   or the path of its file
    source  logs, or their paths; a campaign's runs, or its path; or the path of a log description

    InputError where the model holds no calibration, or a file is missing or a log cannot be used.
    """
    found = delivered(model_of(model))
    given = [source] if isinstance(source, str | Path) else source
    if not isinstance(given, Runs):
        given = _read(found, given)
    if isinstance(given, Runs):
        return _campaign_quality(found, given)
    return (_log_quality(found, given, check or CheckOptions()),)


def _read(found: Delivered, given: Sequence[AnyLog | str | Path]) -> Sequence[AnyLog] | Runs:
    """What was given, with paths read."""
    paths = [Path(each) for each in given if isinstance(each, str | Path)]
    names, law = found.model.joint_names, found.prediction
    campaign = campaign_of(paths) if paths else None
    if campaign is not None:
        return read_campaign(campaign, names)
    options = LinearOptions(exponents=law.exponents, offset=law.offset)
    read = iter(plain_sources(paths, names, options, silent).logs if paths else ())
    logs = [next(read) if isinstance(each, str | Path) else each for each in given]
    return [*logs, *read]


def log_parts(
    model: DynamicsModel, log: AnyLog, check: CheckOptions
) -> tuple[Array, Array, Array, NDArray[np.bool_]]:
    """Of one log's independent samples, by a model that plain logs calibrated: time (N,), measured torque and the model's
    (N, n), and which are held out (N,)."""
    found = delivered(model)
    step = step_of(found.prediction.steps["all"])
    time, measured, predicted = _log_parts(found, log, step, check)
    return time, measured, predicted, held_out_of(log, len(time), step.split)


def _log_quality(found: Delivered, logs: Sequence[AnyLog], check: CheckOptions) -> StepQuality:
    chain, step = found.model.mechanism, step_of(found.prediction.steps["all"])
    parts = [_log_parts(found, log, step, check) for log in logs]
    time, measured, predicted = (np.concatenate([part[k] for part in parts]) for k in range(3))
    out = np.concatenate(
        [held_out_of(log, len(part[0]), step.split) for log, part in zip(logs, parts, strict=True)]
    )
    return judged("All", chain.joint_names, time, measured, predicted, out)


def _log_parts(
    found: Delivered, log: AnyLog, step: StepOptions, check: CheckOptions
) -> tuple[Array, Array, Array]:
    """Time, measured and predicted torque of one log's independent samples."""
    parts = []
    for stretch in stretches(
        checked(log, found.model.mechanism, step.filter.cutoff, check), step.filter, check
    ):
        states, at = stretch.states, stretch.at
        predicted = smoothed_rows(states, at, partial(_torque, found, states))
        parts.append((states.time[at], found.motors.torque(states.effort)[at], predicted))
    time, measured, predicted = (np.concatenate(values) for values in zip(*parts, strict=True))
    return time, measured, predicted


def _torque(found: Delivered, states: States, rows: slice) -> Array:
    """(rows, n) motor torque before the filter: rigid bodies, friction, springs."""
    q, qd, qdd = states.q[rows], states.qd[rows], states.qdd[rows]
    rigid = recursive.torques(found.model.mechanism, found.model.equivalent_parameters(), [q, qd, qdd])
    law = found.prediction
    coupling = coupling_of(law.coupling)
    speed = qd if coupling is None else coupling.to_motors(qd)
    terms = friction_columns(law.terms, speed, law.sign_speed)
    extra = found.columns.values(motion_of(q, qd, law.sign_speed, rigid, coupling)) @ found.extra
    for name, term in zip(names_of(law.terms), terms, strict=True):
        torque = term * np.array([found.friction[joint, name] for joint in found.model.joint_names])
        rigid = rigid + (torque if coupling is None else coupling.torque_of_joints(torque))
    return np.asarray(rigid + extra)


def _campaign_quality(found: Delivered, runs: Runs) -> tuple[StepQuality, ...]:
    chain, motors, theta = found.model.mechanism, found.motors, found.theta_b
    steps = {name: step_of(step) for name, step in found.prediction.steps.items()}
    regressor = ChainRegressor(found.model)
    friction = _with_state(found)
    joints = friction.joints
    alone = prepared_runs(chain, regressor, motors, theta, runs.friction, steps["friction"])
    motor = (judge_motors(chain, runs.motor, steps["motor"], found.shown),) if runs.motor else ()
    return (
        *motor,
        judge_gravity(chain, regressor, motors, runs.gravity, steps["gravity"], theta),
        judge_friction(alone, joints),
        *judge_inertial(chain, regressor, motors, theta, friction, runs.inertial, steps["inertial"]),
    )


def _with_state(found: Delivered) -> FrictionResult:
    joints = {}
    for joint, run in found.prediction.runs.items():
        values = STATE_LAW.require(np.array([found.friction[joint, name] for name in PARAMETERS]))
        exact = np.zeros((len(PARAMETERS), len(PARAMETERS)))
        joints[joint] = JointFriction(joint, values, exact, (), run.inertia, run.offset, run.delay)
    return FrictionResult(joints, ())
