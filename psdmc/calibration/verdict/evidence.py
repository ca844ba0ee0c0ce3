"""The data on which a verdict is based: independent samples of the exciting motion, taken from the log."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from itertools import accumulate

import numpy as np
from numpy.typing import NDArray
from scipy import interpolate

from psdmc.calibration.identify.motor_model import Coupling, Motors
from psdmc.calibration.identify.predictor import Regressor, payload_torque
from psdmc.calibration.identify.steps import Load
from psdmc.calibration.logs.filter import States, Stretch, even_grid, independent_rows, stretches
from psdmc.calibration.logs.log import AnyLog, Array
from psdmc.calibration.logs.log_checks import CheckOptions, checked
from psdmc.calibration.logs.log_survey import Saturated, surveyed
from psdmc.calibration.logs.low_pass import FilterOptions, LowPass
from psdmc.calibration.logs.parts import each_part
from psdmc.model.dynamics_model import DynamicsModel

SIGN_SPEED = 0.03
"""rad/s over which Coulomb friction changes sign, as in the linear fit."""
MOST_ROWS = 4000
"""Samples that a verdict uses; longer logs are thinned further, evenly."""
MOST_SHIFTED = 12_000
"""Samples of single joints whose torque is also taken at other times."""
REACH = 0.5
"""s, the longest delay that is looked for, either way."""
PER_CYCLE = 16
"""Delays that are tried in a period of the filter's cut-off; between them the residual is a parabola."""
KERNEL_CYCLES = 4
"""Periods of the cut-off, either way, that a filtered value is computed from: the rest of the filter weighs 1 %."""


Torque = Callable[[States, NDArray[np.intp]], Array]
"""(rows, n) N m (N) at rows of a log's states."""


@dataclass(frozen=True, slots=True, eq=False)
class Motion:
    """A run on which the verdict is based: its log and the known load at the tip."""

    log: AnyLog
    tool: Load | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Shifted:
    """Independent samples of a log with torques from earlier and later times, to find a delay; N samples, n joints.

    lags         (D,) s, D delays, evenly spaced about zero
    q, qd, qdd   (N, n) states
    speed, sign  (N, n) speed of the motors, and its smooth sign as in Evidence
    torque       (N, n, D) torque at the time of the state plus each of the D delays
    speeds       (N, K, n) speed of the motors at K times, evenly spaced about that of the state
    kernel       (K,) weights that give the filtered value at the middle time from values at these times
    """

    log: str
    lags: Array
    q: Array
    qd: Array
    qdd: Array
    speed: Array
    sign: Array
    torque: Array
    speeds: Array
    kernel: Array


@dataclass(frozen=True, slots=True, eq=False)
class Evidence:
    """Independent samples of logs, from which a verdict on a calibration follows; N samples, n joints.

    Samples are half a period of the filter's cut-off apart.

    model       the model before the calibration: its base parameters theta_b are those of the robot file, or None
    regressor   object that computes the regressor of the model
    q, qd, qdd  (N, n) states
    sign        (N, n) smooth sign of the motors' speed, filtered like the torque: the regressor column of Coulomb
                friction
    torque      (N, n) motor torque, N m (N), filtered; torques of the known load and of springs are subtracted
    noise       (n,) RMS of the sensor noise that passes the filter, estimated from noise above its cut-off
    coupling    matrix of a robot whose motors each drive several joints; None: motor k drives joint k
    shifted     for each log, some samples with torques from earlier and later times, to find a delay
    saturated   efforts that stay at an extreme value
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
    shifted: tuple[Shifted, ...] = ()
    saturated: tuple[Saturated, ...] = ()

    def __len__(self) -> int:
        return len(self.q)

    @property
    def n(self) -> int:
        return int(self.q.shape[1])

    def columns(self) -> Array:
        """Return the regressor (N, n, l) at the N samples, for n joints and l base parameters."""
        return self.regressor.regressor(self.q, self.qd, self.qdd)

    def file_torque(self) -> Array | None:
        """Return the torques (N, n) from the robot file's own theta_b, without friction; None if the file does not
        give it."""
        theta_b = self.model.theta_b
        return None if theta_b is None else np.asarray(self.columns() @ theta_b)

    def thinned(self, most: int) -> Evidence:
        """Return about `most` samples or fewer, evenly spread."""
        rows = slice(None, None, max(1, -(-len(self) // most)))
        kept = {name: getattr(self, name)[rows] for name in ("q", "qd", "qdd", "sign", "torque")}
        return replace(self, **kept)

    def turned(self, signs: Array, order: Sequence[int]) -> Evidence:
        """Return the samples with joint columns exchanged and reversed: position k becomes signs[k] times column
        order[k].

        This tests whether the columns of a log were exchanged or have a wrong sign.
        """
        columns = list(order)
        moved = {name: signs * getattr(self, name)[:, columns] for name in ("q", "qd", "qdd", "sign")}
        if self.coupling is not None:
            moved["sign"] = np.tanh(self.coupling.to_motors(moved["qd"]) / SIGN_SPEED)
        return replace(self, **moved)

    def of_motors(self) -> Evidence:
        """Return the samples for motors instead of joints: torques, speeds, accelerations and regressor. Positions are
        the joints'.

        For robots whose motors each drive one joint, the samples stay unchanged.
        """
        coupling = self.coupling
        if coupling is None:
            return self
        return _MotorEvidence(
            self.model,
            self.regressor,
            self.q,
            coupling.to_motors(self.qd),
            coupling.to_motors(self.qdd),
            self.sign,
            coupling.torque_of_motors(self.torque),
            self.noise,
            whole=np.einsum("tjl,jk->tkl", self.columns(), coupling.matrix),
        )


@dataclass(frozen=True, slots=True, eq=False)
class _MotorEvidence(Evidence):
    """Samples by motors; `whole` holds those of the joints."""

    whole: Array = field(default_factory=lambda: np.zeros((0, 0, 0)))

    def columns(self) -> Array:
        return self.whole


def evidence_of(
    model: DynamicsModel,
    regressor: Regressor,
    motions: Sequence[Motion],
    motors: Motors,
    options: FilterOptions,
    coupling: Coupling | None = None,
    springs: Torque | None = None,
) -> Evidence:
    """Return independent samples of the logs of all motions, one log after another. Raises InputError if a log cannot
    be used.

    motors   factors from logged effort to torque
    springs  function from the states of a log and row indices to the springs' torques (rows, n); None: no springs
    """
    most = max(1, MOST_SHIFTED // model.nv // len(motions))
    logs = [checked(motion.log, model.mechanism, options.cutoff) for motion in motions]
    counts = [len(independent_rows(even_grid(log), options)) for log in logs]
    step, firsts = max(1, -(-sum(counts) // MOST_ROWS)), accumulate(counts, initial=0)
    parts = [
        _samples(
            model,
            log,
            motion.tool,
            motors,
            options,
            coupling,
            springs,
            most,
            slice(-first % step, None, step),
        )
        for log, motion, first in zip(logs, motions, firsts, strict=False)
    ]
    q, qd, qdd, sign, torque = (np.concatenate(x) for x in zip(*(part[:5] for part in parts), strict=True))
    noise = np.sqrt(np.mean([part[5] ** 2 for part in parts], axis=0))
    shifted = tuple(part[6] for part in parts)
    share = CheckOptions().saturated_share
    units = dict(
        zip(model.v_names, (j.type.effort_unit for j in model.mechanism.leading_joints), strict=True)
    )
    piled = tuple(
        found
        if coupling is not None
        else replace(found, unit="A" if log.quantity == "current" else units[found.joint])
        for log in logs
        for found in surveyed(log, share).saturated
    )
    return Evidence(model, regressor, q, qd, qdd, sign, torque, noise, coupling, shifted, piled)


def delays_tried(cutoff: float) -> Array:
    """Return the delays (D,) that are tried, s."""
    step = 1.0 / (PER_CYCLE * cutoff)
    count = int(np.ceil(REACH / step))
    return np.asarray(step * np.arange(-count, count + 1), dtype=np.float64)


def kernel_of(options: FilterOptions) -> tuple[Array, Array]:
    """Return K times (s) about zero, and the weights (K,) of a signal at these times in its filtered value."""
    step, half = 1.0 / (PER_CYCLE * options.cutoff), KERNEL_CYCLES * PER_CYCLE
    impulse = np.zeros(6 * half + 1)
    impulse[3 * half] = 1.0
    kernel = LowPass.design(options, step)(impulse)[2 * half : 4 * half + 1]
    times = step * np.arange(-half, half + 1, dtype=np.float64)
    return times, np.asarray(kernel / kernel.sum(), dtype=np.float64)


def _samples(
    model: DynamicsModel,
    log: AnyLog,
    tool: Load | None,
    motors: Motors,
    options: FilterOptions,
    coupling: Coupling | None,
    springs: Torque | None,
    most: int,
    wanted: slice,
) -> tuple[Array, Array, Array, Array, Array, Array, Shifted]:
    """Return q, qd, qdd, sign and torque of the wanted samples, the filtered RMS noise, and samples with torques of other
    times. The log is a checked one. The noise is that of a density which is the same below the cut-off as above.
    The samples with other times are at most about `most`."""
    lags = delays_tried(options.cutoff)
    window, kernel = kernel_of(options)
    every = max(1, round(2.0 * options.cutoff * log.duration / most))

    # The workers of a cluster get what this function reads: neither the log nor the model.
    mechanism, nv = model.mechanism, model.nv

    def sampled(stretch: Stretch) -> tuple[tuple[Array, ...], tuple[Array, ...], Array]:
        """Return the samples of a part, those with torques of other times, and the squares of what the filter
        removed."""
        states, at = stretch.states, stretch.at
        speed = states.qd if coupling is None else coupling.to_motors(states.qd)
        sign = states.low_pass(np.tanh(speed / SIGN_SPEED))
        other = np.zeros((len(at), nv))
        if tool is not None:
            other = other + payload_torque(mechanism, states.q[at], tool.mass, tool.com)
        if springs is not None:
            other = other + springs(states, at)
        torque = motors.torque(states.effort)[at] - other
        some, later = _at_other_times(states, at, lags, every)
        rows = at[some]
        shifted = (motors.torque(later) - other[some, None]).transpose(0, 2, 1)
        near = np.clip(states.time[rows, None] + window, states.time[0], states.time[-1])
        speeds = interpolate.CubicSpline(states.time, speed)(near)
        moved = states.q[rows], states.qd[rows], states.qdd[rows], speed[rows], sign[rows], shifted, speeds
        own = slice(at[0], at[-1] + 1)
        above = np.sum((states.raw[own] - states.effort[own]) ** 2, axis=0)
        return (states.q[at], states.qd[at], states.qdd[at], sign[at], torque), moved, above

    parts, moved, above, count, first = [], [], np.zeros(model.nv), 0, wanted.start
    for stretch, (part, others, removed) in each_part(stretches(log, options), sampled):
        parts.append(
            [values[first :: wanted.step].copy() for values in part]
        )  # a view would keep all of them
        first = (first - len(stretch.at)) % wanted.step
        moved.append(others)
        above += removed
        count += int(stretch.at[-1] + 1 - stretch.at[0])
    q, qd, qdd, sign, torque = (np.concatenate(values) for values in zip(*parts, strict=True))
    share = options.cutoff / (0.5 / stretch.states.period - options.cutoff)
    noise = motors.torque(np.sqrt(share * above / count))
    names = ("q", "qd", "qdd", "speed", "sign", "torque", "speeds")
    whole = {name: np.concatenate(x) for name, x in zip(names, zip(*moved, strict=True), strict=True)}
    moved_log = Shifted(log.name, lags, **whole, kernel=kernel)
    return q, qd, qdd, sign, torque, np.abs(noise), moved_log


def _at_other_times(
    states: States, at: NDArray[np.intp], lags: Array, every: int
) -> tuple[NDArray[np.intp], Array]:
    """Return the rows that have efforts at all `lags` from them, one in `every`, and these efforts (rows, D, n)."""
    used, times = states.time[states.use], states.time[at]
    some = np.flatnonzero((times >= used[0] - lags[0]) & (times <= used[-1] - lags[-1]))[::every]
    later = interpolate.CubicSpline(states.time, states.effort)(times[some, None] + lags)
    return some, np.asarray(later, dtype=np.float64)
