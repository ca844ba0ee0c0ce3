"""Fits the ten inertial parameters of a load to logs of a robot that carries the load. The model of the robot without
the load is known. Friction is fitted again. The nearest load that is physically possible is found, too."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from psdmc.calibration.identify.estimate import Estimate, Prior, base_parameter_scale, torque_sizes
from psdmc.calibration.identify.least_squares import estimate_rows
from psdmc.calibration.identify.linear_options import LinearOptions
from psdmc.calibration.identify.linear_problem import LinearProblem, linear_problem
from psdmc.calibration.identify.linear_rows import Block
from psdmc.calibration.identify.motor_model import Motors
from psdmc.calibration.identify.physical import NotPhysical
from psdmc.calibration.identify.predictor import Regressor
from psdmc.calibration.logs.filter import States, stretches
from psdmc.calibration.logs.log import AnyLog, Array
from psdmc.calibration.logs.smoothed_rows import smoothed_rows
from psdmc.dynamics.parameters import inertia_matrix, inertia_of, second_moments
from psdmc.errors import InputError
from psdmc.links.pseudo_inertias import pseudo_inertia, require_cvxpy
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.progress import Progress

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

    onto_theta  (l, 10) change of the l base parameters per unit of each load parameter (psdmc.model.payload.load_map)
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
    blocks = _considering(problem, known[:, :, used])
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


def _considering(problem: LinearProblem, consider: Array) -> list[Block]:
    """The problem's blocks with what theta_b's uncertainty does to their torques."""
    blocks, first = [], 0
    for block in problem.rows:
        own = consider[first : first + len(block)]
        blocks.append(Block(block.columns, block.noise, own if own.shape[2] else None))
        first += len(block)
    return blocks


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
