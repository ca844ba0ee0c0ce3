"""Step one: determines torque constants from the current that a known load adds. Source: Denso-2022, (16) and (17)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from psdmc.calibration.identify.motor_model import Motors
from psdmc.calibration.identify.predictor import payload_torque
from psdmc.calibration.identify.residuals import quality, widening
from psdmc.calibration.identify.steps import MotorRun, StepOptions
from psdmc.calibration.logs.filter import away_from, filtered, held_out
from psdmc.calibration.logs.log import Array, Log
from psdmc.calibration.logs.log_checks import checked
from psdmc.calibration.logs.low_pass import FilterOptions
from psdmc.errors import InputError
from psdmc.model.calibrated import JointQuality, Remark, Sample, StepQuality
from psdmc.robot.mechanism import Mechanism

STEADY = 0.9
"""Share of the sweep's typical speed below which a sample belongs to a reversal."""
SMALLEST_SHARE = 20.0
"""Least ratio of a load's torque to the residuals' noise, over all samples, for the load to count as reaching a joint."""


@dataclass(frozen=True, slots=True, eq=False)
class MotorResult:
    """Torque constants of n joints. A value is NaN if the weight of the known load does not act on the joint. It is
    also NaN if there is no recording for the joint.

    torque_constant, std  (n,) value and standard deviation, N m/A (N/A for sliding joints)
    """

    torque_constant: Array
    std: Array
    warnings: tuple[str, ...]

    @property
    def identified(self) -> NDArray[np.bool_]:
        return np.isfinite(self.torque_constant)

    def motors(self, joint_names: Sequence[str], given: Mapping[str, float]) -> Motors:
        """Return the motors with these torque constants, and with given ones (N m/A by joint name) for the other joints. A
        constant is NaN if it is neither identified nor given."""
        known = np.array([given.get(name, np.nan) for name in joint_names], dtype=np.float64)
        constants = np.where(self.identified, self.torque_constant, known)
        relative = np.where(self.identified, np.abs(self.std / constants), 0.0)
        return Motors(constants, relative)


def calibrate_motors(chain: Mechanism, runs: Sequence[MotorRun], options: StepOptions) -> MotorResult:
    """Return torque constants from pairs of slow sweeps of one joint, without and with a known load. Raises InputError
    if a recording is no sweep of its joint.

    The added current is fitted as a linear function of the load's torque, and the torque constant is the inverse of the
    slope. The load's torque is known exactly, so noise in the current does not bias the slope.
    """
    n = len(chain)
    constant, std = np.full(n, np.nan), np.full(n, np.nan)
    warnings: list[str] = []
    for k, joint in enumerate(chain.joints):
        sweeps = _sweeps(chain, k, runs, options)
        if sweeps is None:
            continue
        angle, torque, current = sweeps
        out = held_out(len(angle), options.split)
        slope, error = _slope(torque[~out], current[~out])
        if not abs(slope) > SMALLEST_SHARE * error:
            reach = float(np.abs(torque).max())
            warnings.append(
                f"joint {joint.name}: torque constant unidentifiable: the load reaches it with {reach:.3g} Nm"
            )
            continue
        constant[k], std[k] = 1.0 / slope, error / slope**2
    return MotorResult(constant, std, (*warnings, *negative_warnings(chain.joint_names, constant)))


def negative_warnings(joint_names: Sequence[str], constants: Array) -> tuple[str, ...]:
    """Return a warning for each joint whose torque constant is negative. A constant (N m/A) is NaN if it is unknown."""
    return tuple(
        Remark(
            f"joint {name}: torque constant is negative: the current's sign is against the joint's",
            "negative_constant",
        )
        for name, value in zip(joint_names, constants, strict=True)
        if value < 0
    )


def judge_motors(
    chain: Mechanism, runs: Sequence[MotorRun], options: StepOptions, constants: Mapping[str, float]
) -> StepQuality:
    """Return, for each joint, how well the added current times the torque constant agrees with the torque of the known
    load.

    constants  N m/A by joint name
    """
    joints: dict[str, JointQuality] = {}
    samples: list[Sample] = []
    for k, joint in enumerate(chain.joints):
        sweeps = _sweeps(chain, k, runs, options)
        if sweeps is None or joint.name not in constants:
            continue
        angle, torque, current = sweeps
        measured = constants[joint.name] * current
        out = held_out(len(angle), options.split)
        joints[joint.name] = JointQuality(
            quality(torque[~out], measured[~out]), quality(torque[out], measured[out])
        )
        samples.append(Sample(joint.name, "position [rad]", angle, measured, torque, out))
    return StepQuality("Motor", joints, tuple(samples))


def _sweeps(
    chain: Mechanism, k: int, runs: Sequence[MotorRun], options: StepOptions
) -> tuple[Array, Array, Array] | None:
    """Angle, load torque and added current of all of a joint's runs; None where it has none."""
    own = [run for run in runs if run.joint == chain.joints[k].name]
    if not own:
        return None
    angle, torque, current = (
        np.concatenate(x) for x in zip(*(_added(chain, k, run, options) for run in own), strict=True)
    )
    return angle, torque, current


def _slope(x: Array, y: Array) -> tuple[float, float]:
    """The slope of y = slope x, and its standard deviation, widened where the residual is correlated along x."""
    power = float(x @ x)
    if power == 0 or len(x) < 3:
        return 0.0, np.inf
    slope = float(x @ y) / power
    left = (y - slope * x)[:, None]
    variance = float(np.sum(left**2)) / (len(x) - 1)
    widened = float(widening(left, np.ones(left.shape, dtype=bool))[0])
    return slope, widened * float(np.sqrt(variance / power))


def _added(chain: Mechanism, k: int, run: MotorRun, options: StepOptions) -> tuple[Array, Array, Array]:
    """Angle, load torque (N m) and the load's current (A), averaged over both directions: friction cancels."""
    unloaded, loaded = (_both_ways(chain, k, log, options.filter) for log in (run.unloaded, run.loaded))
    low = max(unloaded[0][0], loaded[0][0])
    high = min(unloaded[0][-1], loaded[0][-1])
    if not high > low:
        raise InputError(
            f"{run.loaded.name}: joint {run.joint}: loaded and unloaded sweeps do not overlap",
            "sweep the joint through the same range with and without the load",
        )
    count = min(len(unloaded[0]), len(loaded[0]))
    angle = np.linspace(low, high, count)
    current = np.interp(angle, *loaded[:2]) - np.interp(angle, *unloaded[:2])
    q = np.tile(loaded[2], (count, 1))
    q[:, k] = angle
    return angle, payload_torque(chain, q, run.load.mass, run.load.com)[:, k], current


def _both_ways(chain: Mechanism, k: int, log: Log, options: FilterOptions) -> tuple[Array, Array, Array]:
    """Angle, current averaged over both directions at that angle, and the pose of the other joints."""
    log = checked(log, chain, options.cutoff)
    if log.quantity != "current":
        raise InputError(
            f"{log.name}: torque constants need currents, the log has {log.quantity}",
            "record motor currents, or leave the motor runs out",
        )
    states = filtered(log, options)
    speed = states.qd[:, k]
    typical = float(np.median(np.abs(speed[states.use])))
    steady = states.use & (typical > 0) & away_from(np.abs(speed) <= STEADY * typical, options, states.period)
    ways = [np.flatnonzero(steady & (np.sign(speed) == sign)) for sign in (1.0, -1.0)]
    name = chain.joints[k].name
    if any(len(way) < 10 for way in ways):
        raise InputError(
            f"{log.name}: joint {name} is not swept in both directions at a constant speed",
            "run `psdmc excite` for sweeps, or check which joint the run belongs to",
        )
    branches = []
    for way in ways:
        order = way[np.argsort(states.q[way, k], kind="stable")]
        branches.append((states.q[order, k], states.effort[order, k]))
    low = max(branch[0][0] for branch in branches)
    high = min(branch[0][-1] for branch in branches)
    independent = max(10, int(2 * options.cutoff * len(ways[0]) * states.period))
    angle = np.linspace(low, high, independent)
    current = 0.5 * sum(np.interp(angle, *branch) for branch in branches)
    return angle, np.asarray(current), np.asarray(np.mean(states.q[steady], axis=0))
