"""The data that a verdict is based on: independent samples of the exciting motion, as the log has them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from psdmc.calibration.identify.coupling import Coupling
from psdmc.calibration.identify.motor_model import Motors
from psdmc.calibration.identify.predictor import Regressor, payload_torque
from psdmc.calibration.identify.steps import Load
from psdmc.calibration.logs.filter import States, stretches
from psdmc.calibration.logs.log import Array
from psdmc.calibration.logs.log_checks import checked
from psdmc.calibration.logs.low_pass import FilterOptions
from psdmc.calibration.logs.stored_log import AnyLog
from psdmc.model.dynamics_model import DynamicsModel

SIGN_SPEED = 0.03
"""rad/s over which Coulomb friction changes sign, as in the linear fit."""
MOST_ROWS = 4000
"""Samples that a verdict uses; longer logs are thinned further, evenly."""


Torque = Callable[[States, NDArray[np.intp]], Array]
"""(rows, n) N m (N) at rows of a log's states."""


@dataclass(frozen=True, slots=True, eq=False)
class Motion:
    """A run to judge by: its log and the known load at the tip."""

    log: AnyLog
    tool: Load | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Evidence:
    """Independent samples, one per half period of the cut-off. N samples, n joints.

    model       as it was before it was calibrated: its theta_b is the file's, or None
    regressor   of the model
    q, qd, qdd  (N, n)
    sign        (N, n)  smooth sign of the motors' speed, filtered like the torque: Coulomb friction's column
    torque      (N, n)  of the motors, N m (N), filtered, without what the tool weighs and springs take
    noise       (n,)    RMS of the sensor noise that passes the filter, from what lies above its cut-off
    coupling    of the motors that drive several joints together; None: motor k drives joint k
    """

    model: DynamicsModel
    regressor: Regressor
    q: Array
    qd: Array
    qdd: Array
    sign: Array
    torque: Array
    noise: Array
    coupling: Coupling | None = None

    def __len__(self) -> int:
        return len(self.q)

    @property
    def n(self) -> int:
        return int(self.q.shape[1])

    def columns(self) -> Array:
        """(N, n, l) the regressor in these states."""
        return self.regressor.regressor(self.q, self.qd, self.qdd)

    def file_torque(self) -> Array | None:
        """(N, n) torque by the file's own theta_b, without friction; None where it states none."""
        theta_b = self.model.theta_b
        return None if theta_b is None else np.asarray(self.columns() @ theta_b)

    def thinned(self, most: int) -> Evidence:
        """At most about so many samples, evenly spread."""
        return self._at(slice(None, None, max(1, -(-len(self) // most))))

    def _at(self, rows: slice) -> Evidence:
        kept = {name: getattr(self, name)[rows] for name in ("q", "qd", "qdd", "sign", "torque")}
        return replace(self, **kept)

    def turned(self, signs: Array, order: Sequence[int]) -> Evidence:
        """The samples as if joint k's position were `signs[k]` times column `order[k]` of the log."""
        columns = list(order)
        moved = {name: signs * getattr(self, name)[:, columns] for name in ("q", "qd", "qdd", "sign")}
        if self.coupling is not None:
            moved["sign"] = np.tanh(self.coupling.to_motors(moved["qd"]) / SIGN_SPEED)
        return replace(self, **moved)

    def of_motors(self) -> Evidence:
        """The same samples by motors: their torques, speeds, accelerations and columns; positions stay the joints'."""
        return self if self.coupling is None else _of_motors(self, self.coupling)


@dataclass(frozen=True, slots=True, eq=False)
class _MotorEvidence(Evidence):
    """Samples by motors; `whole` holds those of the joints."""

    whole: Array = field(default_factory=lambda: np.zeros((0, 0, 0)))

    def columns(self) -> Array:
        return self.whole


def _of_motors(joints: Evidence, coupling: Coupling) -> Evidence:
    return _MotorEvidence(
        joints.model,
        joints.regressor,
        joints.q,
        coupling.to_motors(joints.qd),
        coupling.to_motors(joints.qdd),
        joints.sign,
        coupling.torque_of_motors(joints.torque),
        joints.noise,
        whole=np.einsum("tjl,jk->tkl", joints.columns(), coupling.matrix),
    )


def evidence_of(
    model: DynamicsModel,
    regressor: Regressor,
    motions: Sequence[Motion],
    motors: Motors,
    options: FilterOptions,
    coupling: Coupling | None = None,
    springs: Torque | None = None,
) -> Evidence:
    """Samples of all motions, one after the other; InputError where a log cannot be used.

    springs   their torque (rows, n) at rows of states; it is taken off, as what a tool weighs. None: no springs
    """
    parts = [_samples(model, motion, motors, options, coupling, springs) for motion in motions]
    q, qd, qdd, sign, torque = (np.concatenate(x) for x in zip(*(part[:5] for part in parts), strict=True))
    noise = np.sqrt(np.mean([part[5] ** 2 for part in parts], axis=0))
    return Evidence(model, regressor, q, qd, qdd, sign, torque, noise, coupling).thinned(MOST_ROWS)


def _samples(
    model: DynamicsModel,
    motion: Motion,
    motors: Motors,
    options: FilterOptions,
    coupling: Coupling | None,
    springs: Torque | None,
) -> tuple[Array, Array, Array, Array, Array, Array]:
    """For one motion: q, qd, qdd, sign and torque of its samples, and the RMS noise that passes the filter if noise has
    the same density below the cut-off as above."""
    log = checked(motion.log, model.mechanism, options.cutoff)
    parts, above, count = [], np.zeros(model.n), 0
    for stretch in stretches(log, options):
        states, at = stretch.states, stretch.at
        speed = states.qd if coupling is None else coupling.to_motors(states.qd)
        sign = states.low_pass(np.tanh(speed / SIGN_SPEED))
        torque = motors.torque(states.effort)[at]
        if motion.tool is not None:
            torque = torque - payload_torque(model.mechanism, states.q[at], motion.tool.mass, motion.tool.com)
        if springs is not None:
            torque = torque - springs(states, at)
        own = slice(at[0], at[-1] + 1)
        above += np.sum((states.raw[own] - states.effort[own]) ** 2, axis=0)
        count += at[-1] + 1 - at[0]
        parts.append((states.q[at], states.qd[at], states.qdd[at], sign[at], torque))
    q, qd, qdd, sign, torque = (np.concatenate(values) for values in zip(*parts, strict=True))
    share = options.cutoff / (0.5 / states.period - options.cutoff)
    noise = motors.torque(np.sqrt(share * above / count))
    return q, qd, qdd, sign, torque, np.abs(noise)
