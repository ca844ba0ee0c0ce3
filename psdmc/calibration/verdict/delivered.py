"""Computes how well the torques that a calibrated model file predicts agree with measured torques of logs. All
predicted torques are computed anew from the numbers in the file. The torques and errors that the fit computed are not used.

The logs may be runs of a campaign: motor, gravity, friction and inertia runs that psdmc plans. For these runs, the
torques of the bodies come from the regressor, the matrix Y in tau = Y theta_b with the base parameters theta_b of the
file. For other logs, the torques of the bodies come from the Newton-Euler algorithm instead.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from psdmc.calibration.campaign_file import read_campaign
from psdmc.calibration.columns.columns import Columns, read_columns
from psdmc.calibration.identify.four_steps import Runs
from psdmc.calibration.identify.friction import FrictionResult, JointFriction, judge_friction, prepared_runs
from psdmc.calibration.identify.gravity import judge_gravity
from psdmc.calibration.identify.inertial import Late, judge_inertial
from psdmc.calibration.identify.linear_problem import LinearOptions, friction_columns, motion_of, names_of
from psdmc.calibration.identify.motor import judge_motors
from psdmc.calibration.identify.motor_model import Motors, coupling_of
from psdmc.calibration.identify.predictor import ChainRegressor
from psdmc.calibration.identify.state_friction import PARAMETERS, friction_torque
from psdmc.calibration.identify.steps import Robot, StepOptions, judged, step_of
from psdmc.calibration.logs.filter import (
    States,
    Stretch,
    even_grid,
    held_out_of,
    independent_rows,
    stretches,
)
from psdmc.calibration.logs.log import AnyLog, Array
from psdmc.calibration.logs.log_checks import CheckOptions, checked
from psdmc.calibration.logs.parts import each_part
from psdmc.calibration.logs.smoothed_rows import smoothed_rows
from psdmc.calibration.sources import campaign_of, plain_sources
from psdmc.errors import InputError
from psdmc.friction.terms import STATE_LAW
from psdmc.model import evaluate
from psdmc.model.calibrated import WHOLE, Prediction, StepQuality, by_joint
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.model.load import load, model_of
from psdmc.model.store import save
from psdmc.progress import silent
from psdmc.reproducible import in_any_order


@dataclass(frozen=True, slots=True, eq=False)
class Delivered:
    """A calibrated model as read from its file, with all data to predict torques.

    model           the model
    prediction      filter, friction law and options of the calibration
    friction        friction values by joint and parameter name
    constants       torque constants, N m/A by joint; empty if torques were logged
    shown           torque constants that the calibration determined; those that the user gave are left out
    columns, extra  springs and further friction of the robot, and their values (m,)
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
    def step(self) -> StepOptions:
        """Return filter and validation split of the calibration step that fitted the whole torque of fast motions."""
        steps = self.prediction.steps
        return step_of(steps["all"] if "all" in steps else steps["inertial"])

    @property
    def linear(self) -> LinearOptions:
        """Return options to fit the model to new logs: the file's filter, and its friction terms if friction has no
        state."""
        law, options = self.prediction, LinearOptions(filter=self.step.filter)
        if not law.is_linear:
            return options
        return replace(
            options,
            exponents=law.exponents,
            sign_speed=law.sign_speed,
            offset=law.offset,
            coupling=law.coupling,
            columns=self.columns,
        )

    @property
    def misfit(self) -> Mapping[str, float]:
        """Return by joint name how many times larger the calibration's RMSE is in its test than in its fit, at least 1.

        More than 1 shows that the model lacks an effect, so that another motion would give other values.
        """
        kept = self.model.calibrated
        joints = {} if kept is None else {step.step: step.joints for step in kept.steps}.get(WHOLE, {})
        ratios = {
            name: own.held_out.rmse / own.fit.rmse if own.fit.rmse > 0.0 else 1.0
            for name, own in joints.items()
        }
        return {name: max(1.0, ratio) if np.isfinite(ratio) else 1.0 for name, ratio in ratios.items()}

    @property
    def motors(self) -> Motors:
        """The motors, which convert logged effort to torque."""
        names = self.model.v_names
        constants = (
            np.array([self.constants[name] for name in names]) if self.constants else np.ones(len(names))
        )
        return Motors(constants, np.zeros(len(names)))


def delivered(model: DynamicsModel) -> Delivered:
    """Return the contents of a calibrated model. Raises InputError if the model holds no calibration from which
    torques can be predicted."""
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
    """Return a function that computes the torques (rows, n) of the model's springs; None if the model has no springs.

    The function takes the states of a log and row indices. The torques pass the log's low-pass filter, like measured
    torques.
    """
    return beside(found, found.columns.of_springs)


def beside(found: Delivered, held: NDArray[np.bool_]) -> Callable[[States, NDArray[np.intp]], Array] | None:
    """Return a function that computes the torques (rows, n) of some springs and friction terms; None if there are none.

    The function takes the states of a log and row indices. The torques pass the log's low-pass filter, like measured
    torques. None of them depends on the load.

    held  (m,) True: the term is included; one entry per value in `found.extra`
    """
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
    """Return the model after it was written to a file and read back."""
    with tempfile.TemporaryDirectory(prefix="psdmc_") as folder:
        path = Path(folder) / "model.npz"
        save(model, path)
        return load(path)


def delivered_quality(
    model: DynamicsModel | str | Path,
    source: str | Path | Sequence[AnyLog | str | Path] | Runs,
    check: CheckOptions | None = None,
) -> tuple[StepQuality, ...]:
    """Return the R^2 and RMSE of a calibrated model on logs or on the runs of a campaign, from the content of its
    file.

    model   a model, or the path of its file
    source  logs, or their paths; a campaign's runs, or its path; or the path of a log description

    Raises InputError if the model holds no calibration, or if a file is missing or a log cannot be used.
    """
    found = delivered(model_of(model))
    given = [source] if isinstance(source, str | Path) else source
    if not isinstance(given, Runs):
        given = _read(found, given)
    if isinstance(given, Runs):
        return _campaign_quality(found, given)
    return (_log_quality(found, given, check or CheckOptions()),)


def _read(found: Delivered, given: Sequence[AnyLog | str | Path]) -> Sequence[AnyLog] | Runs:
    """Return the given logs; paths are read."""
    paths = [Path(each) for each in given if isinstance(each, str | Path)]
    names, law = found.model.v_names, found.prediction
    campaign = campaign_of(paths) if paths else None
    if campaign is not None:
        return read_campaign(campaign, names)
    options = LinearOptions(exponents=law.exponents, offset=law.offset)
    read = iter(plain_sources(paths, names, options, silent).logs if paths else ())
    logs = [next(read) if isinstance(each, str | Path) else each for each in given]
    return [*logs, *read]


@dataclass(frozen=True, slots=True, eq=False)
class PredictedRows:
    """Independent samples of one log: time (N,) s; joint speeds, measured torque and predicted torque (N, n) each."""

    time: Array
    qd: Array
    measured: Array
    predicted: Array


def log_parts(
    model: DynamicsModel, log: AnyLog, check: CheckOptions
) -> tuple[Array, Array, Array, NDArray[np.bool_]]:
    """Return time (N,), measured torque (N, n), predicted torque (N, n) and held-out mask (N,) for samples of a log.

    The model must have been calibrated from plain logs. The N samples are far enough apart to be independent.
    """
    found = delivered(model)
    rows = predicted_rows(found, log, check)
    return rows.time, rows.measured, rows.predicted, held_out_of(log, len(rows.time), found.step.split)


def _log_quality(found: Delivered, logs: Sequence[AnyLog], check: CheckOptions) -> StepQuality:
    chain, step = found.model.mechanism, found.step
    parts = [predicted_rows(found, log, check) for log in logs]
    columns = [[getattr(part, name) for part in parts] for name in ("time", "measured", "predicted")]
    # a single array is not copied, as it may be large
    time, measured, predicted = (own[0] if len(own) == 1 else np.concatenate(own) for own in columns)
    out = np.concatenate(
        [held_out_of(log, len(part.time), step.split) for log, part in zip(logs, parts, strict=True)]
    )
    return judged("All", chain.v_names, time, measured, predicted, out)


def predicted_rows(
    found: Delivered, log: AnyLog, check: CheckOptions, motors: Motors | None = None
) -> PredictedRows:
    """Return measured and predicted torque at independent samples of a log.

    motors  factors from logged effort to torque; None: those of the model's file
    """
    step, motors = found.step, motors or found.motors
    friction = None if found.prediction.is_linear else _with_state(found)

    def predicted(part: Stretch) -> Array:
        if friction is None:
            states = part.states
            motion = (states.q, states.qd, states.qdd)
            return smoothed_rows(
                states, part.at, lambda rows: linear_torque(found, *(values[rows] for values in motion))
            )
        return _torque_with_state(found, friction, part.states, part.at)

    log = checked(log, found.model.mechanism, step.filter.cutoff, check)
    count, first = len(independent_rows(even_grid(log), step.filter)), 0
    whole = PredictedRows(np.empty(count), *(np.empty((count, len(log.joint_names))) for _ in range(3)))
    for stretch, torque in each_part(stretches(log, step.filter, check), predicted):
        states, at = stretch.states, stretch.at
        own = slice(first, first := first + len(at))
        whole.time[own], whole.qd[own], whole.predicted[own] = states.time[at], states.qd[at], torque
        whole.measured[own] = motors.torque(states.effort)[at]
    return whole


def linear_torque(found: Delivered, q: Array, qd: Array, qdd: Array) -> Array:
    """Return the motor torque (N, n) of a calibrated file whose friction is linear in its values: rigid bodies,
    friction, springs."""
    with in_any_order():
        rigid = evaluate.torques(found.model.mechanism, found.model.equivalent_parameters(), [q, qd, qdd])
    law = found.prediction
    coupling = coupling_of(law.coupling)
    speed = qd if coupling is None else coupling.to_motors(qd)
    terms = friction_columns(law.terms, speed, law.sign_speed)
    extra = found.columns.values(motion_of(q, qd, law.sign_speed, rigid, coupling)) @ found.extra
    for name, term in zip(names_of(law.terms), terms, strict=True):
        torque = term * np.array([found.friction[joint, name] for joint in found.model.v_names])
        rigid = rigid + (torque if coupling is None else coupling.torque_of_joints(torque))
    return np.asarray(rigid + extra)


def _torque_with_state(
    found: Delivered, friction: FrictionResult, states: States, at: NDArray[np.intp]
) -> Array:
    """(rows, n) motor torque after delay and filter, of a friction law with a state, which starts at zero."""
    model = found.model
    motion = [states.q, states.qd, states.qdd]
    torque = evaluate.torques(model.mechanism, model.equivalent_parameters(), motion)
    for k, name in enumerate(model.v_names):
        if name in friction.joints:
            torque[:, k] += friction_torque(friction.joints[name].friction, states.qd[:, k], states.period)
    return Late(states, friction.delay, at)(torque)


def _campaign_quality(found: Delivered, runs: Runs) -> tuple[StepQuality, ...]:
    chain, theta = found.model.mechanism, found.theta_b
    steps = {name: step_of(step) for name, step in found.prediction.steps.items()}
    robot = Robot(chain, ChainRegressor(found.model), found.motors)
    friction = _with_state(found)
    joints = friction.joints
    alone = prepared_runs(robot, theta, runs.friction, steps["friction"])
    motor = (judge_motors(chain, runs.motor, steps["motor"], found.shown),) if runs.motor else ()
    return (
        *motor,
        judge_gravity(robot, runs.gravity, steps["gravity"], theta),
        judge_friction(alone, joints),
        *judge_inertial(robot, theta, friction, runs.inertial, steps["inertial"]),
    )


def _with_state(found: Delivered) -> FrictionResult:
    joints = {}
    for joint, run in found.prediction.runs.items():
        values = STATE_LAW.require(np.array([found.friction[joint, name] for name in PARAMETERS]))
        exact = np.zeros((len(PARAMETERS), len(PARAMETERS)))
        joints[joint] = JointFriction(joint, values, exact, (), run.inertia, run.offset, run.delay)
    return FrictionResult(joints, ())
