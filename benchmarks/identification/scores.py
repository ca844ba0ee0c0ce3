"""Scores of identified parameters against the true robot: base parameters, and torques on a motion that no program saw.

An estimate has Pinocchio's ten parameters of each link, in any of the ways that give the same torques, or psdmc's base
parameters. Both become the true robot's base parameters in psdmc's basis. The map between them is the least-squares
solution on random states, so it needs no convention of either side.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pinocchio as pin
from shared_robot import COULOMB, DRIVE_INERTIA, JOINTS, VISCOUS

import psdmc

Array = npt.NDArray[np.float64]

STATES = 400
"""Random states of the map: more than enough for 46 base parameters."""
LINK = 10


@dataclass(frozen=True, slots=True)
class Estimate:
    """Identified values. `sign_speed` is V of tanh(speed / V) in Coulomb friction, in rad/s; 0: a sign."""

    theta_b: Array
    coulomb: Array
    viscous: Array
    offset: Array
    sign_speed: float = 0.0


@dataclass(frozen=True, slots=True)
class Score:
    """What an estimate is worth.

    base      norm of the error of the base parameters over the norm of the true ones
    median    median of the relative errors of those base parameters that are not tiny
    friction  largest relative error of Coulomb and viscous friction; NaN where the true friction is another law
    torque    (n,) N m RMS, error on the held-out motion, against the true torques without noise
    moving    as torque, of the rows in which the joint is faster than SLOW
    """

    base: float
    median: float
    friction: float
    torque: tuple[float, ...]
    moving: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class Truth:
    """The true robot: psdmc's model, its base parameters, and the map to them from Pinocchio's parameters and drive
    inertias."""

    model: Any
    theta_b: Array
    from_standard: Array


def truth_of(urdf: Path) -> Truth:
    """The true robot of a URDF, with the drive inertias of the comparison."""
    model = psdmc.derive(urdf, drive_inertia=list(DRIVE_INERTIA), expand=False)
    if model.joint_names != JOINTS:
        raise SystemExit(f"{urdf}: joints {model.joint_names}, expected {JOINTS}")
    chain = pin.buildModelFromUrdf(str(urdf))
    rng = np.random.default_rng(0)
    q, qd, qdd = (rng.uniform(-3.0, 3.0, (STATES, len(JOINTS))) for _ in range(3))
    own = np.vstack([model.regressor(*state) for state in zip(q, qd, qdd, strict=True)])
    links = np.vstack(
        [
            np.hstack([pin.computeJointTorqueRegressor(chain, chain.createData(), a, b, c), np.diag(c)])
            for a, b, c in zip(q, qd, qdd, strict=True)
        ]
    )
    mapped = np.linalg.lstsq(own, links, rcond=None)[0]
    standard = [chain.inertias[k].toDynamicParameters() for k in range(1, chain.njoints)]
    return Truth(model, mapped @ np.concatenate([*standard, DRIVE_INERTIA]), mapped)


def estimate_of_file(path: Path, truth: Truth) -> Estimate:
    """The estimate that run_figaroh.py or flobaroid.py wrote."""
    found = json.loads(path.read_text(encoding="utf-8"))
    numbers = {name: np.array(values, dtype=np.float64) for name, values in found.items()}
    theta_b = truth.from_standard @ np.concatenate([numbers["standard"], numbers["drive_inertia"]])
    return Estimate(theta_b, numbers["coulomb"], numbers["viscous"], numbers["offset"])


def estimate_of_model(path: Path, truth: Truth) -> Estimate:
    """The estimate in a model that `psdmc calibrate` wrote."""
    model = psdmc.load(path)
    if model.l != truth.model.l:
        raise SystemExit(f"{path}: {model.l} base parameters, expected {truth.model.l}")
    found = model.calibrated
    assert found is not None
    assert found.prediction is not None
    assert model.theta_b is not None
    rows = {(row.joint, row.name): row.value for row in found.friction}
    names = sorted({name for _, name in rows})
    if names != ["coulomb", "offset", "viscous"]:
        raise SystemExit(f"{path}: friction {names}, expected coulomb, offset and viscous")
    values = {name: np.array([rows[joint, name] for joint in JOINTS]) for name in names}
    mapped = _to_true_basis(model, truth) @ model.theta_b
    return Estimate(mapped, sign_speed=found.prediction.sign_speed, **values)


def _to_true_basis(model: Any, truth: Truth) -> Array:
    """(l, l) map of a model's base parameters to the true model's: the identity where both have the same basis."""
    rng = np.random.default_rng(1)
    states = [rng.uniform(-3.0, 3.0, (3, len(JOINTS))) for _ in range(STATES // 4)]
    own, true = (np.vstack([m.regressor(*state) for state in states]) for m in (model, truth.model))
    return np.asarray(np.linalg.lstsq(true, own, rcond=None)[0])


@dataclass(frozen=True, slots=True)
class HeldOut:
    """A motion that no program saw: regressor (N, n, l) of the true robot, rates and true torques (N, n)."""

    regressor: Array
    qd: Array
    torque: Array


def held_out_of(truth: Truth, motion: tuple[Array, Array, Array], torque: Array) -> HeldOut:
    """Every EVERY-th row of a motion, with the true torques of all rows."""
    q, qd, qdd = (x[::EVERY] for x in motion)
    return HeldOut(truth.model.regressor(q, qd, qdd), qd, torque[::EVERY])


def predicted(estimate: Estimate, held: HeldOut) -> Array:
    """(N, n) torques of an estimate."""
    V = estimate.sign_speed
    sign = np.sign(held.qd) if V == 0.0 else np.tanh(held.qd / V)
    friction = estimate.coulomb * sign + estimate.viscous * held.qd + estimate.offset
    return np.asarray(held.regressor @ estimate.theta_b + friction)


def score(estimate: Estimate, truth: Truth, held: HeldOut, *, lugre: bool = False) -> Score:
    """The score of an estimate."""
    error = estimate.theta_b - truth.theta_b
    large = np.abs(truth.theta_b) > SMALL * np.abs(truth.theta_b).max()
    wrong = (predicted(estimate, held) - held.torque) ** 2
    moving = np.abs(held.qd) > SLOW
    pairs = ((estimate.coulomb, COULOMB), (estimate.viscous, VISCOUS))
    friction = max(float(np.max(np.abs(found / np.array(true) - 1.0))) for found, true in pairs)
    return Score(
        float(np.linalg.norm(error) / np.linalg.norm(truth.theta_b)),
        float(np.median(np.abs(error[large] / truth.theta_b[large]))),
        float("nan") if lugre else friction,
        tuple(float(x) for x in np.sqrt(np.mean(wrong, axis=0))),
        tuple(float(x) for x in np.sqrt(np.sum(wrong * moving, axis=0) / np.sum(moving, axis=0))),
    )


EVERY = 8
"""Rows of a held-out motion, of which one is scored: 31 rows per second."""
SLOW = 0.1
"""rad/s below which a joint is near a reversal: there, the error is that of the sign of the friction."""
SMALL = 1e-3
"""Of the largest base parameter: smaller ones are mostly zeros with rounding, whose relative errors mean nothing."""
