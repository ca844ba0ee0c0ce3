"""A finished model against Pinocchio's own reading of the robot's source: nothing of the derivation is
used."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from psdmc.dynamics.parameters import BODY_PARAMETERS, inertia_of, standard_parameters
from psdmc.errors import InputError
from psdmc.model import evaluate
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.robot.chain import PARAMETERS_PER_LINK
from psdmc.robot.load import LoadedRobot, load_robot_text
from psdmc.robot.reference import Reference, reference

Array = NDArray[np.float64]

STATES = 200
SEED = 14_630
RANGES = (np.pi, 3.0, 5.0)
"""q (rad or m), qd and qdd are drawn from plus or minus these."""

TORQUE_LIMIT = 1e-10
"""Largest relative error that passes: a hundred times what rounding leaves, a million times less than any
mistake."""

CONDITION_LIMIT = 1e-12
"""Forward dynamics passes within this times the mass matrix's condition number, and within TORQUE_LIMIT
always."""


NO_TORQUE = 1e-9
"""Share of the largest torque below which a joint's torque is rounding."""


@dataclass(frozen=True, slots=True)
class CheckRow:
    """One comparison.

    name     what was compared
    against  with which function of Pinocchio
    error    largest difference, relative to the largest magnitude (per joint where there is one per joint)
    limit    largest error that passes; None where the figure is for information
    """

    name: str
    against: str
    error: float
    limit: float | None

    @property
    def passed(self) -> bool:
        return self.limit is None or self.error <= self.limit


def source_of(model: DynamicsModel) -> LoadedRobot:
    """The robot that the model was derived from, read again from the source embedded in it."""
    kept = model.provenance
    if not {"source_text", "source_format", "options"} <= set(kept):
        raise InputError(f"the model of '{model.chain.name}' holds no source", "give the robot's file")
    name = str(kept.get("source_name", "robot"))
    return load_robot_text(kept["source_text"], kept["source_format"], source_name=name, **kept["options"])


def check_model(model: DynamicsModel, source: LoadedRobot | None = None) -> tuple[CheckRow, ...]:
    """Every function of the model against Pinocchio's; `source` None: the source embedded in the model.

    A model with other parameters than its source is compared under its own where its chain has them (a
    payload), and under random physical ones where no standard parameters are known (unknown or calibrated
    theta_b). InputError where the source is another robot.
    """
    loaded = source_of(model) if source is None else source
    if loaded.chain.joint_names != model.chain.joint_names:
        raise InputError(
            f"{loaded.source_name} has joints {', '.join(loaded.chain.joint_names)}, the model has "
            + ", ".join(model.joint_names),
            "give the file, base and tip that the model was derived from",
        )
    theta, parameters = _parameters(model, loaded)
    robot = reference(loaded, parameters=parameters)
    rows = _compared(model, theta, robot)
    if loaded.snap_report:
        rows += (_snapping(loaded, robot, parameters),)
    return rows


def _parameters(model: DynamicsModel, loaded: LoadedRobot) -> tuple[Array, Array | None]:
    """theta_b, and the standard parameters that Pinocchio must be given; None where its own are meant."""
    if model.theta_b is not None:
        theta = np.asarray(model.theta_b)
        for known in (loaded.chain.parameters, model.chain.parameters):
            if _gives(theta, model.B, known):
                return theta, None if known is loaded.chain.parameters else known
    x = random_parameters(model)
    return model.B @ x, x.reshape(model.n, PARAMETERS_PER_LINK)


def _gives(theta: Array, B: Array, parameters: Array) -> bool:
    """Whether standard parameters (n, 11) are known and have these base parameters."""
    if np.isnan(parameters).any():
        return False
    return bool(np.allclose(B @ parameters.reshape(-1), theta, rtol=1e-9, atol=1e-12))


def random_parameters(model: DynamicsModel) -> Array:
    """(11 n,) standard parameters of physical bodies, as far as the model's assumptions admit them."""
    rng = np.random.default_rng(SEED)
    x = np.zeros((model.n, PARAMETERS_PER_LINK))
    for link in x:
        mass, centre = rng.uniform(1.0, 5.0), rng.uniform(-0.1, 0.1, size=3)
        shape = rng.normal(scale=0.1, size=(3, 3))
        second = mass * (shape @ shape.T + np.outer(centre, centre))
        link[:BODY_PARAMETERS] = standard_parameters(mass, mass * centre, inertia_of(second))
        link[BODY_PARAMETERS] = rng.uniform(0.1, 0.5)
    span = model.chain.parameter_span
    leads = np.argmax(span != 0.0, axis=0)
    admitted: Array = span @ x.reshape(-1)[leads]
    return admitted


def _compared(model: DynamicsModel, theta: Array, robot: Reference) -> tuple[CheckRow, ...]:
    rng = np.random.default_rng(SEED)
    q, qd, qdd = (limit * rng.uniform(-1.0, 1.0, size=(STATES, model.n)) for limit in RANGES)
    rest = np.zeros_like(q)
    tau = evaluate.torques_for(model, theta, q, qd, qdd)
    mass = np.stack(
        [evaluate.torques_for(model, theta, q, rest, rest + unit) for unit in np.eye(model.n)], axis=-1
    )
    gravity = evaluate.torques_for(model, theta, q, rest, rest)
    mass = mass - gravity[..., None]
    rows = evaluate.regressor(model, q, qd, qdd)
    pairs = (
        ("inverse dynamics", "rnea", tau, robot.inverse_dynamics(q, qd, qdd)),
        ("regressor times theta_b", "rnea", rows @ theta, robot.inverse_dynamics(q, qd, qdd)),
        ("mass matrix", "crba", mass, robot.mass_matrix(q)),
        (
            "nonlinear effects",
            "nonLinearEffects",
            evaluate.torques_for(model, theta, q, qd, rest),
            robot.nonlinear_effects(q, qd),
        ),
        ("gravity", "computeGeneralizedGravity", gravity, robot.gravity(q)),
    )
    checked = [CheckRow(name, against, _error(a, b), TORQUE_LIMIT) for name, against, a, b in pairs]
    condition = float(np.linalg.cond(robot.mass_matrix(q)).max())
    error = _error(robot.forward_dynamics(q, qd, tau), qdd)
    limit = max(TORQUE_LIMIT, CONDITION_LIMIT * condition)
    return (*checked, CheckRow("forward dynamics of these torques", "aba", error, limit))


def _snapping(loaded: LoadedRobot, robot: Reference, parameters: Array | None) -> CheckRow:
    """What snapping changed, against the file's own rotations."""
    rng = np.random.default_rng(SEED)
    n = len(loaded.chain)
    q, qd, qdd = (limit * rng.uniform(-1.0, 1.0, size=(STATES, n)) for limit in RANGES)
    as_written = reference(loaded, snapped=False, parameters=parameters)
    error = _error(robot.inverse_dynamics(q, qd, qdd), as_written.inverse_dynamics(q, qd, qdd))
    return CheckRow("effect of snapped rotations", "rnea on the file as written", error, None)


def _error(values: Array, expected: Array) -> float:
    """Largest difference relative to the largest magnitude, joint by joint; a matrix as one.

    A joint that does less than NO_TORQUE of the largest torque, such as one with a vertical axis under
    gravity, is measured against that largest one.
    """
    overall = max(float(np.abs(expected).max(initial=0.0)), np.finfo(float).tiny)
    if expected.ndim == 3:
        return float(np.abs(values - expected).max()) / overall
    largest = np.abs(expected).max(axis=0)
    scale = np.where(largest > NO_TORQUE * overall, largest, overall)
    return float((np.abs(values - expected).max(axis=0) / scale).max())
