"""Prepares the friction run of one joint, a recording in which this joint alone moves, and predicts the motor torque."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from psdmc.calibration.identify.predictor import gravity_regressor, payload_torque
from psdmc.calibration.identify.state_friction import friction_torque
from psdmc.calibration.identify.steps import FrictionRun, Robot, StepOptions
from psdmc.calibration.logs.filter import States, filtered, held_out, thinned
from psdmc.calibration.logs.log import Array
from psdmc.calibration.logs.log_checks import checked
from psdmc.calibration.logs.low_pass import LowPass
from psdmc.errors import InputError
from psdmc.friction.state import STATE_LAW
from psdmc.robot.mechanism import Mechanism

MOST_KEPT = 12
"""Friction torques of one run that are held: those of a Jacobian and of the point that it belongs to."""


@dataclass(frozen=True, slots=True, eq=False)
class JointRun:
    """The recording of the friction run of one joint, filtered and with its gravity torque.

    fit, out  samples that are fitted, and samples that are held out for validation
    kept      the latest simulated friction torques, by the bytes of the seven unknowns with which they were simulated
    """

    time: Array
    period: float
    qd: Array
    qdd: Array
    gravity: Array
    measured: Array
    low_pass: LowPass
    every: NDArray[np.intp]
    fit: NDArray[np.intp]
    out: NDArray[np.intp]
    kept: dict[bytes, Array] = field(default_factory=dict, repr=False)

    def rigid(self, inertia: float, offset: float, delay: float) -> Array:
        return self.delayed(self.gravity + inertia * self.qdd + offset, delay)

    def torque(self, p: Array) -> Array:
        """Return the predicted motor torque at all samples of the run, before the low-pass filter.

        p  (10,) the unknowns in the order of friction_fit.UNKNOWNS
        """
        return self.delayed(self.friction(p) + self.gravity + p[7] * self.qdd + p[8], p[9])

    def friction(self, p: Array) -> Array:
        """Return the predicted friction torque at all samples of the run. It depends on the first seven of the unknowns
        p only. The simulation is skipped if its result for equal values is stored."""
        key = p[:7].tobytes()
        if key not in self.kept:
            if len(self.kept) >= MOST_KEPT:
                self.kept.clear()
            self.kept[key] = friction_torque(STATE_LAW.from_unknowns(p[:7]), self.qd, self.period)
        return self.kept[key]

    def delayed(self, torque: Array, delay: float) -> Array:
        """Return a torque that is shifted in time: the result at time t is the given torque at time t + delay, by
        interpolation."""
        return torque if delay == 0 else np.interp(self.time + delay, self.time, torque)

    def residual(self, p: Array, rows: NDArray[np.intp]) -> Array:
        return np.asarray((self.low_pass(self.torque(p)) - self.measured)[rows])


def prepared(robot: Robot, theta_gravity: Array, run: FrictionRun, k: int, options: StepOptions) -> JointRun:
    """Return the friction run of joint k with the torques of gravity and of the known load. Raises InputError if other
    joints move, too."""
    states = filtered(checked(run.log, robot.chain, options.filter.cutoff), options.filter)
    _require_alone(run, robot.chain, k, states)
    gravity = (gravity_regressor(robot.regressor, states.q) @ theta_gravity)[:, k]
    if run.tool is not None:
        gravity = gravity + payload_torque(robot.chain, states.q, run.tool.mass, run.tool.com)[:, k]
    rows = thinned(states, options.filter)
    out = held_out(len(rows), options.split)
    return JointRun(
        time=states.time,
        period=states.period,
        qd=states.qd[:, k],
        qdd=states.qdd[:, k],
        gravity=gravity,
        measured=robot.motors.torque(states.effort)[:, k],
        low_pass=states.low_pass,
        every=rows,
        fit=rows[~out],
        out=rows[out],
    )


def _require_alone(run: FrictionRun, chain: Mechanism, k: int, states: States) -> None:
    rms = np.sqrt(np.mean(states.qd**2, axis=0))
    if rms[k] == 0:
        raise InputError(
            f"{run.log.name}: joint {run.joint} does not move, so the log does not show its friction",
            "move that joint in its friction runs",
        )
    others = [name for j, name in enumerate(chain.joint_names) if j != k and rms[j] > 0.05 * rms[k]]
    if others:
        raise InputError(
            f"{run.log.name}: joint(s) {', '.join(others)} move in the friction run of joint {run.joint}",
            "friction needs one joint at a time: `psdmc excite` plans such runs",
        )
