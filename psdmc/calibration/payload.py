"""The function `psdmc.identify_payload`, which finds a load from logs of a robot whose model without the load is known.

It fits the ten inertial parameters of the load, and friction again. The result is the nearest load that is physically
possible.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from psdmc.calibration.columns.columns import Columns
from psdmc.calibration.description.description import FitChoice
from psdmc.calibration.identify.estimate import Estimate, Prior, base_parameter_scale, torque_sizes
from psdmc.calibration.identify.least_squares import Block, estimate_rows, with_rows
from psdmc.calibration.identify.linear_problem import LinearOptions, LinearProblem, linear_problem, names_of
from psdmc.calibration.identify.motor_model import Motors, motors_of_logs, one_quantity
from psdmc.calibration.identify.physical import NotPhysical
from psdmc.calibration.identify.predictor import ChainRegressor, Regressor
from psdmc.calibration.identify.residuals import qualities
from psdmc.calibration.identify.visibility import Visibility, visibility
from psdmc.calibration.known_load import PayloadFound, load_numbers
from psdmc.calibration.logs.filter import States, stretches
from psdmc.calibration.logs.log import AnyLog, Array
from psdmc.calibration.logs.log_checks import checked
from psdmc.calibration.logs.smoothed_rows import smoothed_rows
from psdmc.calibration.sources import LogNaming, log_sources
from psdmc.calibration.verdict.delivered import beside, delivered
from psdmc.calibration.verdict.verdict_limits import VerdictOptions
from psdmc.dynamics.parameters import inertia_matrix, inertia_of, second_moments
from psdmc.errors import InputError
from psdmc.links.pseudo_inertias import pseudo_inertia, require_cvxpy
from psdmc.model.bodies import carrying_frame, load_map
from psdmc.model.calibrated import SHOWN, JointFigures, Verdict, code_of
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.model.grounds import Ground
from psdmc.progress import Progress, silent
from psdmc.robot.inertia import six_of, standard_parameters
from psdmc.robot.mechanism import require_axes, require_no_loops

LOAD = 10
LOAD_NAMES = ("mass", "m x", "m y", "m z", "Ixx", "Ixy", "Iyy", "Ixz", "Iyz", "Izz")
"""Of the vector's first ten: mass, first moment and inertia about the origin of the frame that carries the load."""


@dataclass(frozen=True, slots=True, eq=False)
class LoadRegressor:
    """The torque of each joint per unit of the ten parameters of a load, an array (..., n joints, 10). It is the
    regressor of the model times the map from the load to base parameters.

    map  (l, 10) change of the l base parameters per unit of each parameter of the load
    """

    model: Regressor
    map: Array

    def regressor(self, q: Array, qd: Array, qdd: Array) -> Array:
        return np.asarray(self.model.regressor(q, qd, qdd) @ self.map)


@dataclass(frozen=True, slots=True, eq=False)
class LoadFit:
    """The result of the fit of a load, one vector: ten inertial parameters of the load, then each joint's friction and
    constant torque (offset).

    estimate   without physical constraints; its standard deviations include those of the model's base parameters
    problem    the rows of the least-squares problem
    rigid      (N samples, n joints) torque of the model without the load and without friction
    prior      values before the fit: no load, and the model's friction
    """

    estimate: Estimate
    problem: LinearProblem
    rigid: Array
    prior: Prior

    @property
    def names(self) -> tuple[str, ...]:
        return (*LOAD_NAMES, *self.problem.names)

    @property
    def never_negative(self) -> NDArray[np.bool_]:
        return self.problem.never_negative

    def predicted(self, values: Array) -> Array:
        """Return the predicted torques (N, n) for a vector of the load's parameters and each joint's friction and offset."""
        return np.concatenate([block.columns @ values for block in self.problem.rows]) + self.rigid


def fit_load(
    model: DynamicsModel,
    regressor: Regressor,
    onto_theta: Array,
    logs: Sequence[AnyLog],
    options: LinearOptions,
    motors: Motors,
    friction: Array | None,
    theta_std: Array,
    progress: Progress,
    beside: Callable[[States, NDArray[np.intp]], Array] | None = None,
) -> LoadFit:
    """Return the load and the friction that explain the difference between measured torques and the torques of the
    model without the load.

    onto_theta  (l, 10) change of the l base parameters per unit of each load parameter (psdmc.model.bodies.load_map)
    friction    (n joints, f values) the model's own friction, in the order of friction_names; None: unknown
    theta_std   (l,) standard deviations of the model's base parameters, taken as independent; zero if unknown
    beside      function that returns the torques (rows, n) of springs and further friction at some rows; None: none
    """
    chain = model.mechanism
    load = LoadRegressor(regressor, onto_theta)
    problem, _ = linear_problem(chain, load, LOAD, logs, options, motors, progress)
    known = _known_columns(regressor, logs, options)
    rigid = known @ model.known_theta_b()
    if beside is not None:
        each = (stretches(log, options.filter, options.check, options.stretch) for log in logs)
        rigid = rigid + np.concatenate([beside(part.states, part.at) for parts in each for part in parts])
    used = np.flatnonzero(theta_std > 0.0)
    consider = known[:, :, used]  # what theta_b's uncertainty does to the torques
    blocks = [
        Block(block.columns, block.noise, consider[own] if len(used) else None)
        for block, own in with_rows(problem.rows)
    ]
    sizes = torque_sizes(problem.torque[~problem.held_out])
    width = len(problem.friction)
    own = np.zeros((chain.nv, width)) if friction is None else friction
    prior = Prior(
        np.concatenate([np.zeros(LOAD), own.reshape(-1)]),
        np.concatenate([base_parameter_scale(chain, load, sizes, None), np.repeat(sizes, width)]),
    )
    kept = np.repeat(~problem.held_out[:, None], chain.nv, axis=1)
    covariance = np.diag(theta_std[used] ** 2) if len(used) else None
    solved = estimate_rows(blocks, problem.torque - rigid, options.fit, covariance, kept, prior)
    return LoadFit(solved, problem, rigid, prior)


def _known_columns(regressor: Regressor, logs: Sequence[AnyLog], options: LinearOptions) -> Array:
    """(N, n, l) the model's own regressor at the problem's samples, filtered like the torque; InputError where no joint
    moves by more than its sensor's noise."""
    found, moves = [], False
    for log in logs:
        for stretch in stretches(log, options.filter, options.check, options.stretch):
            states = stretch.states
            moves = moves or not states.still.all()

            def rows(own: slice, states=states) -> Array:  # type: ignore[no-untyped-def]
                return regressor.regressor(states.q[own], states.qd[own], states.qdd[own])

            found.append(smoothed_rows(states, stretch.at, rows))
    if not moves:
        names = ", ".join(log.name for log in logs)
        raise InputError(
            f"{names}: no joint moves by more than its sensor's noise: a load does not show",
            "record a motion that turns the load about several axes",
        )
    return np.concatenate(found)


def nearest_load(values: Array, whitening: Array, never_negative: NDArray[np.bool_]) -> Array:
    """Return the physically possible values of a load, with friction, that are nearest to an estimate.

    The first ten entries of `values` are mass, first moments and inertia of the load. The load may be a point or a rod.
    The cost of a candidate v is |W (v - values)|^2, W the whitening matrix. Entries that are marked in `never_negative`
    are friction values. Raises NotPhysical if the solver fails.
    """
    cp = require_cvxpy()
    size = 1.0 / np.linalg.norm(whitening, axis=0)
    step = cp.Variable(len(values))  # in standard deviations from the estimate
    v = values + cp.multiply(size, step)
    body = cp.bmat(pseudo_inertia([v[k] for k in range(LOAD)]))
    held = np.flatnonzero(never_negative)
    constraints = [body >> 0, *([v[held] >= 0.0] if len(held) else [])]
    loss = cp.sum_squares(np.linalg.qr(whitening, mode="r") @ cp.multiply(size, step))
    problem = cp.Problem(cp.Minimize(loss), constraints)
    with warnings.catch_warnings():  # cvxpy warns of reduced accuracy; the result is a body whatever that is
        warnings.simplefilter("ignore", UserWarning)
        try:
            problem.solve(solver=cp.CLARABEL)
        except cp.error.SolverError:
            raise NotPhysical("physical consistency of the load: clarabel failed") from None
    if step.value is None:
        raise NotPhysical(f"physical consistency of the load: no solution ({problem.status})")
    found = values + size * np.asarray(step.value)
    return np.asarray(np.where(never_negative, np.maximum(found, 0.0), found))


def about_centre(load: Array) -> tuple[float, Array, Array]:
    """Return mass (kg), centre of mass (3,) and inertia about the centre of mass (3, 3) of a load from its ten
    parameters.

    The ten parameters are mass, first moments and inertia about the frame's origin. Second moments that rounding made
    negative become zero. The centre and the inertia of a load without mass are zero.
    """
    mass = float(load[0])
    if not mass > 0.0:
        return 0.0, np.zeros(3), np.zeros((3, 3))
    com = load[1:4] / mass
    second = second_moments(inertia_matrix(load)) - mass * np.outer(com, com)
    values, axes = np.linalg.eigh(second)
    return mass, com, inertia_of((axes * np.maximum(values, 0.0)) @ axes.T)


SURE = 3.0
"""Standard deviations from zero at which a mass is there, or is negative."""


def identify_payload(
    model: DynamicsModel,
    logs: str | Path | Sequence[str | Path],
    frame: str | None = None,
    options: LinearOptions | None = None,
    torque_constants: Mapping[str, float] | None = None,
    regressor: Regressor | None = None,
    progress: Progress = silent,
    naming: LogNaming | None = None,
) -> PayloadFound:
    """Find the mass, centre of mass and inertia of a rigid load from logs.

    Returns an object with the values and a verdict, which says whether they can be used.

    model             model of the robot without the load. Its base parameters are not changed. If the model is not
                      calibrated, psdmc finds the friction from the logs, too
    logs              paths of logs that were recorded with the load, or the path of a log description (TOML)
    frame             named frame in which psdmc gives the centre of mass and inertia; None: the tip frame
    options           filter and friction law of the fit; None: those of the log description, or of the model's calibration
    torque_constants  torque per current of each joint, for logs of motor currents: a dictionary from joint names to N m/A
                      at the joint (after the gear); None: those of the model
    regressor         result of psdmc.compile(model), which makes the fit faster; None: psdmc computes with NumPy
    progress          function, such as print, that psdmc calls with the name of each stage
    naming            topic, and joint names in the logs that differ from those of the model; None: no name differs

    Raises InputError if psdmc cannot use a log, if no joint moves in the logs, or if the model's theta_b is unknown.
    """
    require_axes(model.mechanism, "payload identification")
    require_no_loops(model.mechanism, "payload identification")
    if model.mechanism.has_mimic_joints:
        raise InputError("payload identification is of joints that follow no other", "lock those that do")
    require_cvxpy()
    model.known_theta_b()
    known, own, friction, constants = _of_calibration(model)
    settings = options or own
    place = carrying_frame(model.mechanism, frame)
    paths = [logs] if isinstance(logs, str | Path) else list(logs)
    if not paths:
        raise InputError("no log to identify a load from", "give a log that was recorded with it")
    progress("reading logs")
    opened, naming = [Path(path) for path in paths], naming or LogNaming()
    naming.require_bag(opened)
    read = log_sources(opened, (), model.joint_names, settings, FitChoice(), naming, progress)
    settings = read.linear
    checked_logs = [
        checked(log, model.mechanism, settings.filter.cutoff, settings.check) for log in read.logs
    ]
    known_constants = read.constants or constants
    given = torque_constants or (known_constants if one_quantity(checked_logs) == "current" else None)
    motors = motors_of_logs(model.joint_names, checked_logs, given)
    progress("fitting the load")
    same_law = friction is not None and friction.shape[1] == len(names_of(settings.terms))
    found = fit_load(
        model,
        regressor or ChainRegressor(model),
        load_map(model.mechanism, model.B, place),
        checked_logs,
        settings,
        motors,
        friction if same_law else None,
        known,
        progress,
        _beside(model),
    )
    return _result(model, place.name, found, checked_logs, known)


def _of_calibration(
    model: DynamicsModel,
) -> tuple[Array, LinearOptions, Array | None, Mapping[str, float] | None]:
    """Read the model's calibration: theta_b's standard deviations, the fit's options, friction (n, f), torque constants."""
    kept = model.calibrated
    if kept is None:
        return np.zeros(model.l), LinearOptions(), None, None
    found = delivered(model)
    std = np.where(np.isfinite(kept.std), kept.std, 0.0)
    options = replace(found.linear, columns=Columns())
    if not found.prediction.is_linear:
        return std, options, None, found.constants or None
    names = names_of(options.terms)
    friction = np.array([[found.friction[joint, name] for name in names] for joint in model.joint_names])
    return std, options, friction, found.constants or None


def _beside(model: DynamicsModel) -> Callable[[States, NDArray[np.intp]], Array] | None:
    """The torque of what the model's calibration found beside rigid bodies and plain friction."""
    if model.calibrated is None:
        return None
    found = delivered(model)
    if found.columns.by_load:
        raise InputError(
            f"{model.mechanism.name}: it has load-dependent friction, which the log cannot separate from a load",
            "calibrate the robot without `load` in [friction]",
        )
    return beside(found, np.ones(len(found.columns), dtype=bool))


def _result(
    model: DynamicsModel, frame: str, found: LoadFit, logs: Sequence[AnyLog], known: Array
) -> PayloadFound:
    solved = found.estimate
    vector = nearest_load(solved.values, solved.whitening, found.never_negative)
    mass, com, inertia = about_centre(vector[:LOAD])
    if mass < SURE * float(solved.std[0]):  # what a load that is not there is made of says nothing
        com, inertia = np.zeros(3), np.zeros((3, 3))
    six = six_of(inertia)
    whole = standard_parameters(mass, com, six)
    delivered_vector = np.concatenate([whole, vector[LOAD:]])
    seen = visibility(
        found.names,
        delivered_vector,
        solved.std,
        solved.unseen,
        ["no load"] * LOAD + ["the model's"] * (len(vector) - LOAD),
    )
    stds = _standard_deviations(solved, delivered_vector[:LOAD], seen)
    words = dict(zip(LOAD_NAMES, seen.words, strict=False))
    std = solved.std[:LOAD]
    moved = np.abs(vector[:LOAD] - solved.values[:LOAD]) / np.where(
        np.isfinite(std) & (std > 0.0), std, np.inf
    )
    return PayloadFound(
        robot=model.mechanism.name,
        frame=frame,
        mass=mass,
        com=com,
        inertia=six,
        mass_std=float(stds[0]),
        com_std=stds[1:4],
        inertia_std=stds[4:],
        visible=words,
        verdict=_verdict(found, delivered_vector, words, model),
        notes=_notes(model, words, logs, known, moved),
    )


def _standard_deviations(solved: Estimate, load: Array, seen: Visibility) -> Array:
    """(10,) of mass, com and inertia about it, by their slopes in the linear parameters; infinite where a slope leads to a
    parameter that the logs do not fix."""
    own = solved.total_covariance[:LOAD, :LOAD] + solved.prior_covariance[:LOAD, :LOAD]
    fixed = seen.determined[:LOAD]
    result = np.full(LOAD, np.inf)
    result[0] = float(np.sqrt(own[0, 0])) if fixed[0] else np.inf
    if not load[0] > 0.0 or not load[0] > SURE * result[0]:
        return result
    slopes = np.empty((LOAD, LOAD))
    for k in range(LOAD):
        step = STEP * max(abs(load[k]), STEP * load[0])
        ahead, behind = load.copy(), load.copy()
        ahead[k] += step
        behind[k] -= step
        slopes[:, k] = (load_numbers(ahead) - load_numbers(behind)) / (2.0 * step)
    for k in range(1, LOAD):
        leads = np.abs(slopes[k]) > LEADS * np.abs(slopes[k]).max()
        if fixed[leads].all():
            result[k] = float(np.sqrt(max(slopes[k] @ own @ slopes[k], 0.0)))
    return result


STEP = 1e-4
"""Share of a parameter by which it is changed for a slope."""
LEADS = 1e-9
"""Share of the largest slope below which a number does not depend on a parameter."""


def _verdict(found: LoadFit, vector: Array, words: Mapping[str, str], model: DynamicsModel) -> Verdict:
    """Usable where the log shows the mass, a mass is not negative, and the torque is followed on held-out data."""
    limits, solved, problem = VerdictOptions(), found.estimate, found.problem
    predicted, out = found.predicted(vector), problem.held_out
    held = qualities(problem.torque[out], predicted[out])
    samples = int((~out).sum()) * len(model.mechanism) / max(solved.rank, 1)
    reasons, doubts = [], []
    if samples < limits.fewest_samples:
        reasons.append(Ground("load_starved", {"samples": samples, "limit": limits.fewest_samples}))
    elif samples < limits.few_samples:
        doubts.append(Ground("load_few_samples", {"samples": samples}))
    mass, std = float(solved.values[0]), float(solved.std[0])
    if code_of(words["mass"]) not in SHOWN:
        reasons.append(Ground("mass_hidden", {"seen": words["mass"]}))
    elif mass < -SURE * std:
        reasons.append(Ground("mass_negative", {"mass": mass, "std": std}))
    elif mass < SURE * std:
        doubts.append(Ground("no_mass", {"mass": mass, "std": std}))
    for joint, both in zip(model.joint_names, held, strict=True):
        if both.r2 < limits.fair_r2:
            low = Ground("load_low_r2", {"joint": joint, "r2": both.r2})
            (reasons if both.r2 < limits.poor_r2 else doubts).append(low)
    hidden = [name for name in LOAD_NAMES[1:] if code_of(words[name]) not in SHOWN]
    if hidden:
        doubts.append(Ground("load_hidden", {"names": hidden}))
    nothing = float("nan")
    joints = tuple(
        JointFigures(joint, both.r2, both.rmse, nothing, nothing, False, nothing, nothing, nothing, nothing)
        for joint, both in zip(model.joint_names, held, strict=True)
    )
    return Verdict(tuple(reasons), tuple(doubts), (), joints, samples)


def _notes(
    model: DynamicsModel, words: Mapping[str, str], logs: Sequence[AnyLog], known: Array, moved: Array
) -> tuple[str, ...]:
    notes = [note for log in logs for note in log.notes]
    if model.calibrated is None:
        notes.append(
            "the model is not calibrated: standard deviations take its theta_b as exact, and its friction as unknown"
        )
    elif not known.all():
        notes.append(
            f"{int((known == 0.0).sum())} of {model.l} base parameters of the model are not fixed by its own "
            "calibration: what is wrong with them is not in the standard deviations"
        )
    kept = {name: word for name, word in words.items() if code_of(word) not in SHOWN}
    notes += [f"{name} about the frame's origin: {word}" for name, word in kept.items()]
    if moved.max(initial=0.0) > 1.0:
        notes.append(f"to be a body the load was moved by up to {moved.max():.2g} standard deviations")
    return tuple(notes)
