"""Step three: determines the LuGre friction of every joint, from runs of one joint at a time.

LuGre friction is a friction law with bristle deflection as its state. Source: Denso-2022, (12) to (14), (19), (20).

The fit of a joint's seven parameters has the two steps of Denso-2022 and a final refinement. The first step fits F_c,
F_v and d_v by trust-region least squares, to fast samples, for which bristles do not matter. The second step fits the
other parameters by Nelder-Mead over a simulation of the LuGre equation (12). The refinement fits all parameters by
trust region, which also gives the standard deviations.

A run has three more unknowns: the joint's inertia in that pose (the paper neglects it), a constant torque, and the time
between position and current.

Unknowns p, in order: F_c, F_s - F_c, ln v_s, F_v, d_v, ln sigma_0, sigma_1, inertia, offset, delay.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import optimize

from psdmc.calibration.identify.predictor import gravity_regressor, payload_torque
from psdmc.calibration.identify.residuals import CORRELATED, quality, sample_correlation, widening
from psdmc.calibration.identify.state_friction import PARAMETERS, friction_torque
from psdmc.calibration.identify.steps import FrictionOptions, FrictionRun, Robot, StepOptions
from psdmc.calibration.logs.filter import States, filtered, held_out, thinned
from psdmc.calibration.logs.log import Array
from psdmc.calibration.logs.log_checks import checked
from psdmc.calibration.logs.low_pass import LowPass
from psdmc.errors import InputError
from psdmc.friction.terms import STATE_LAW
from psdmc.model.calibrated import JointQuality, Remark, Sample, StepQuality
from psdmc.robot.mechanism import DRIVE, Mechanism
from psdmc.workers import in_processes


@dataclass(frozen=True, slots=True, eq=False)
class FrictionResult:
    """The identified friction by joint name, in the robot's order, without joints that had no run; and warnings."""

    joints: dict[str, JointFriction]
    warnings: tuple[str, ...]

    @property
    def delay(self) -> float:
        """Return the time in s by which the position lags behind the current: the median over the joints."""
        return float(np.median([joint.delay for joint in self.joints.values()])) if self.joints else 0.0

    def covariance_with_delay(self, name: str) -> Array:
        """Return the covariance (8, 8) of a joint's seven friction values and `delay`; zeros for values of a joint that had
        no run."""
        found, count = np.zeros((8, 8)), max(len(self.joints), 1)
        efficiency = 1.0 if count <= 2 else 0.5 * np.pi  # of a median, whose variance exceeds that of a mean
        found[7, 7] = efficiency * sum(joint.with_delay[7] for joint in self.joints.values()) / count**2
        if name in self.joints:
            found[:7, :7] = self.joints[name].covariance
            found[:7, 7] = found[7, :7] = self.joints[name].with_delay[:7] / count
        return found


def calibrate_friction(
    runs: Mapping[str, JointRun], options: FrictionOptions, start: FrictionResult | None = None
) -> FrictionResult:
    """Return the LuGre friction of every joint that has a friction run (a recording in which this joint alone moves).

    runs    runs by joint, from `prepared_runs`
    start   friction from an earlier iteration, as start values; None: psdmc searches for start values
    """
    earlier = start.joints if start is not None else {}
    tasks = [(name, run, options, earlier.get(name)) for name, run in runs.items()]
    found = {joint.joint: joint for joint in in_processes(_fit_joint, tasks, options.workers)}
    warnings = [
        f"joint {name}: friction parameter(s) not seen in the data: {', '.join(joint.unseen)}"
        for name, joint in found.items()
        if joint.unseen
    ]
    named = [
        f"{name} ({joint.correlation:.2f}, by {joint.widened:.1f})"
        for name, joint in found.items()
        if joint.correlation > CORRELATED
    ]
    if named:
        text = (
            f"friction: the residual is no noise but correlated from sample to sample, joint(s) {', '.join(named)}: the "
            "model lacks an effect there; standard deviations are widened for it, by the factor named"
        )
        warnings.append(Remark(text, "residual"))
    return FrictionResult(found, tuple(warnings))


def judge_friction(runs: Mapping[str, JointRun], joints: Mapping[str, JointFriction]) -> StepQuality:
    """Return how well each joint's friction alone predicts its run. The torque that gravity, inertia and offset explain is
    subtracted from the measured and from the predicted motor torque."""
    qualities, samples = {}, []
    for name, data in runs.items():
        if name not in joints:
            continue
        joint, fit, out, every = joints[name], data.fit, data.out, data.every
        rigid = data.low_pass(data.rigid(joint.inertia, joint.offset, joint.delay))
        measured = data.measured - rigid
        modelled = data.low_pass(data.torque(unknowns_of(joint))) - rigid
        qualities[name] = JointQuality(
            quality(measured[fit], modelled[fit]), quality(measured[out], modelled[out])
        )
        is_out = np.isin(every, out)
        samples.append(Sample(name, "time [s]", data.time[every], measured[every], modelled[every], is_out))
    return StepQuality("Friction", qualities, tuple(samples))


def prepared_runs(
    robot: Robot, theta_b: Array, runs: Sequence[FrictionRun], options: StepOptions
) -> dict[str, JointRun]:
    """Return the friction runs (recordings in which one joint moves) by joint, in the order of the robot's joints. Each
    has its gravity torque, which is computed from the base parameters theta_b."""
    places = {name: k for k, name in enumerate(robot.chain.v_names)}
    own = sorted((run for run in runs if run.joint in places), key=lambda run: places[run.joint])
    return {run.joint: prepared(robot, theta_b, run, places[run.joint], options) for run in own}


# The fit of one joint


DELAY = 9
FREE = {"lugre": tuple(range(10)), "coulomb_viscous": (0, 3, 7, 8, DELAY)}
"""Unknowns that each friction law estimates."""
STIFF_BEND = 1e-5
"""rad: bristle deflection at Coulomb friction that stands for rigid bristles."""
PEAK_SPEEDS = (0.01, 0.04)
"""Stribeck velocities of further starts of the last step, as shares of the run's largest speed."""
PEAK_HEIGHT = 0.2
"""F_s - F_c of these starts, as a share of F_c."""
SHORTEST_DELAY = 1e-12
"""s, bound of a delay that is not estimated: none."""
SHORT_DESCENT, LONG_DESCENT = 8, 25
"""Numbers of evaluations: to compare starts, and to refine the best one."""
UNSEEN_CURVATURE = 1e-13
"""Curvature of the sum of squares, relative to the largest, below which a direction counts as not seen."""


@dataclass(frozen=True, slots=True, eq=False)
class JointFriction:
    """The identified friction of one joint.

    friction     (7,)    values of the LuGre law, in the order of PARAMETERS
    covariance   (7, 7)  of these values from the fit alone, larger if residuals are correlated
    unseen       names of parameters that the data do not determine
    inertia      kg m^2, of the joint in the run's pose, not negative
    offset       constant torque, N m
    delay        time between position and current, s
    correlation  of the residual from sample to sample
    widened      factor by which correlated residuals increased the standard deviations
    with_delay   (8,)    covariances of the delay with the seven values, and its variance
    """

    joint: str
    friction: Array
    covariance: Array
    unseen: tuple[str, ...]
    inertia: float
    offset: float
    delay: float
    correlation: float = 0.0
    widened: float = 1.0
    with_delay: Array = field(default_factory=lambda: np.zeros(8))

    @property
    def std(self) -> Array:
        """Standard deviations (7,) of the LuGre values."""
        return np.sqrt(np.maximum(np.diag(self.covariance), 0.0))


def unknowns_of(found: JointFriction) -> Array:
    """Return the ten unknowns of the fit at its result: seven of LuGre friction, then inertia, offset and delay."""
    own = [found.inertia, found.offset, found.delay]
    return np.concatenate([STATE_LAW.unknowns(found.friction), own])


def _fit_joint(task: tuple[str, JointRun, FrictionOptions, JointFriction | None]) -> JointFriction:
    """The friction of one joint, from the paper's two steps or an earlier result, then the refinement."""
    name, data, options, start = task
    if start is not None and options.law != "coulomb_viscous":
        return _polished(name, data, unknowns_of(start), options)
    fast = _fast(data, options)
    if options.law == "coulomb_viscous":
        # as LuGre parameters: no Stribeck peak, linear, rigid bristles
        coulomb, viscous, _, *others = fast
        first = np.array([coulomb, 0.0, 0.0, viscous, 1.0, np.log(coulomb / STIFF_BEND), 0.0, *others])
        sliding = data.fit[np.abs(data.qd[data.fit]) > options.sliding * np.abs(data.qd).max()]
        return _polished(name, replace(data, fit=sliding), first, options)
    first = _best_of_peaks(data, _presliding(data, fast, options), fast, options)
    return _polished(name, data, first, options)


def _best_of_peaks(data: JointRun, first: Array, fast: Array, options: FrictionOptions) -> Array:
    """The start with the smallest residual. A missed or a false Stribeck peak is a local minimum as well."""
    top = float(np.abs(data.qd).max())
    starts = [first]
    for speed in PEAK_SPEEDS:
        other = first.copy()
        other[[0, 1, 2, 3, 4]] = fast[0], PEAK_HEIGHT * fast[0], np.log(speed * top), fast[1], fast[2]
        starts.append(other)
    found = [_descended(data, start, options, SHORT_DESCENT) for start in starts]
    return min(found, key=lambda fitted: float(fitted[0].cost))[1]


def _fast(data: JointRun, options: FrictionOptions) -> Array:
    """(20): F_c, F_v, d_v with the run's inertia, offset and delay, from samples well beyond the Stribeck velocity. A delay
    makes a part of the inertia's torque look like friction."""
    speed = np.abs(data.qd)
    rows = data.fit[speed[data.fit] > options.fast * speed.max()]
    qd, qdd = data.qd[rows], data.qdd[rows]
    target = (data.measured - data.gravity)[rows]
    rate = np.gradient(data.measured, data.time)[rows]
    reach = options.largest_delay if options.estimate_delay else SHORTEST_DELAY

    def residual(p: Array) -> Array:
        friction = (p[0] + p[1] * np.abs(qd) ** p[2]) * np.sign(qd)
        return np.asarray(friction + p[3] * qdd + p[4] + p[5] * rate - target)

    size = float(np.sqrt(np.mean(target**2)))
    low = [1e-6 * size, 0.0, 0.1, 0.0, -np.inf, -reach]
    high = [np.inf, np.inf, 2.5, np.inf, np.inf, reach]
    start = [0.5 * size, 0.3 * size, 0.8, 1e-3 * size, 0.0, 0.0]
    fitted = optimize.least_squares(residual, start, bounds=(low, high), x_scale="jac")
    return np.asarray(fitted.x)


def _presliding(data: JointRun, fast: Array, options: FrictionOptions) -> Array:
    """F_s, v_s, sigma_0, sigma_1 by Nelder-Mead, from the best of a coarse grid of stiffness and Stribeck velocity."""
    coulomb, viscous, exponent, *others = fast
    top = float(np.abs(data.qd).max())

    def unknowns(x: Array) -> Array:
        peak, log_speed, log_stiffness, log_time = x
        damping = np.exp(log_stiffness + log_time)
        return np.array(
            [
                coulomb,
                abs(peak) * coulomb,
                log_speed,
                viscous,
                exponent,
                log_stiffness,
                damping,
                *others,
            ]
        )

    def cost(x: Array) -> float:
        if abs(x[1]) > 20 or abs(x[2]) > 40 or not -20 < x[3] < 0:
            return 1e300
        return float(np.sum(data.residual(unknowns(x), data.fit) ** 2))

    grid = [
        np.array([0.15, np.log(speed), np.log(coulomb / bend), np.log(1e-3)])
        for bend in np.geomspace(1e-5, 1e-2, 7)
        for speed in (0.005 * top, 0.03 * top)
    ]
    best = min(grid, key=cost)
    simplex = np.vstack([best, best + np.diag([0.15, 1.0, 0.7, 1.0])])
    limits = {"maxfev": options.simplex_steps, "initial_simplex": simplex, "xatol": 3e-2, "fatol": 0.0}
    found = optimize.minimize(cost, best, method="Nelder-Mead", options=limits)
    return unknowns(found.x)


def _polished(name: str, data: JointRun, start: Array, options: FrictionOptions) -> JointFriction:
    """All free unknowns together by trust region within bounds, with standard deviations from its Jacobian."""
    free = _free(options)
    scale = step_sizes(start)[free]
    fitted, p = _descended(data, start, options, LONG_DESCENT)
    spread = np.zeros((len(p), len(p)))
    spread[np.ix_(free, free)] = _covariance(fitted.jac * scale, fitted.fun) * np.outer(scale, scale)
    left = np.zeros((len(data.time), 1))
    left[data.fit, 0] = fitted.fun
    use = np.isin(np.arange(len(left)), data.fit)[:, None]
    left, use = left[data.every], use[data.every]
    widened = float(widening(left, use)[0])
    spread = widened**2 * spread
    friction = STATE_LAW.from_unknowns(p[:7])
    turn = to_seven(friction)
    covariance = turn @ spread @ turn.T
    relative = np.sqrt(np.diag(covariance)) / np.maximum(np.abs(friction), 1e-12)
    unseen = [PARAMETERS[j] for j in range(7) if not relative[j] < options.unseen]
    no_peak = p[1] < 3.0 * float(np.sqrt(spread[1, 1]))  # F_s = F_c: v_s has no effect
    if no_peak and PARAMETERS[2] not in unseen and options.law == "lugre":
        unseen.append(PARAMETERS[2])
    return JointFriction(
        joint=name,
        friction=friction,
        covariance=covariance,
        unseen=tuple(unseen),
        inertia=float(p[7]),
        offset=float(p[8]),
        delay=float(p[DELAY]),
        correlation=float(sample_correlation(left, use)[0]),
        widened=widened,
        with_delay=np.append(turn @ spread[:, DELAY], spread[DELAY, DELAY]),
    )


def _free(options: FrictionOptions) -> list[int]:
    """The unknowns that are estimated."""
    return [j for j in FREE[options.law] if options.estimate_delay or j != DELAY]


def _descended(data: JointRun, start: Array, options: FrictionOptions, evaluations: int) -> tuple[Any, Array]:
    """scipy's result for the free unknowns, and all unknowns with it, from `start` by trust region within the bounds.

    The bounds are the law's, which keep the search within reasonable numbers, inertia >= 0, and the largest delay.
    """
    free, reach = _free(options), options.largest_delay
    low = np.append(STATE_LAW.bounds[0], [0.0, -np.inf, -reach])[free]
    high = np.append(STATE_LAW.bounds[1], [np.inf, np.inf, reach])[free]
    scale = step_sizes(start)[free]
    inner = np.clip(start[free], low + 1e-6 * scale, np.where(np.isfinite(high), high - 1e-6 * scale, np.inf))

    def whole(x: Array) -> Array:
        p = start.copy()
        p[free] = x
        return p

    def residual(x: Array) -> Array:
        return data.residual(whole(x), data.fit)

    def jacobian(x: Array) -> Array:
        here = residual(x)
        columns = []
        for j, step in enumerate(1e-4 * scale):
            moved = x.copy()
            moved[j] += step if x[j] + step <= high[j] else -step
            columns.append((residual(moved) - here) / (moved[j] - x[j]))
        return np.stack(columns, axis=1)

    bounds = {"bounds": (low, high), "x_scale": scale}
    limits = {"xtol": 1e-7, "ftol": 1e-9, "gtol": 1e-12, "max_nfev": evaluations}
    fitted = optimize.least_squares(residual, inner, jac=jacobian, **bounds, **limits)
    return fitted, whole(fitted.x)


def step_sizes(p: Array) -> Array:
    """Return for each of the ten unknowns p a change that clearly affects the torque, used as its unit."""
    viscous, damping = max(p[3], 0.1 * p[0]), max(p[6], 1e-4 * np.exp(p[5]))
    return np.array([p[0], 0.2 * p[0], 1.0, viscous, 0.5, 1.0, damping, 1.0, p[0], 1e-3])


def _covariance(jac: Array, residual: Array) -> Array:
    """Return the covariance of the scaled unknowns. A direction that the data do not see gets a huge variance, never
    none."""
    variance = float(residual @ residual) / max(len(residual) - jac.shape[1], 1)
    curvature, directions = np.linalg.eigh(jac.T @ jac)
    seen = np.maximum(curvature, UNSEEN_CURVATURE * curvature[-1])
    return np.asarray((directions * (variance / seen)) @ directions.T)


def to_seven(friction: Array) -> Array:
    """Return the derivatives (7, 10) of the seven LuGre values by the ten unknowns of the fit. The last three unknowns
    (inertia, offset, delay) do not affect these values."""
    return np.hstack([STATE_LAW.slopes(friction), np.zeros((7, 3))])


# The friction run of one joint


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

        p  (10,) the unknowns in the order of the module's text
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
        """Return a torque shifted in time: at time t the given torque at t + delay, by interpolation."""
        return torque if delay == 0 else np.interp(self.time + delay, self.time, torque)

    def residual(self, p: Array, rows: NDArray[np.intp]) -> Array:
        return np.asarray((self.low_pass(self.torque(p)) - self.measured)[rows])


def prepared(robot: Robot, theta_gravity: Array, run: FrictionRun, k: int, options: StepOptions) -> JointRun:
    """Return joint k's friction run with the torques of gravity and load. Raises InputError if other joints move.

    Friction acts at the motors, gravity and inertia at the links. Behind an elastic gear, these move differently.
    """
    of_motors = run.log.of_motors
    logs = [run.log] if of_motors is None else [run.log, of_motors]
    motions = [filtered(checked(log, robot.chain, options.filter.cutoff), options.filter) for log in logs]
    links, states = motions[0], motions[-1]
    _require_alone(run, robot.chain, k, states)
    gravity = (gravity_regressor(robot.regressor, links.q) @ theta_gravity)[:, k]
    if run.tool is not None:
        gravity = gravity + payload_torque(robot.chain, links.q, run.tool.mass, run.tool.com)[:, k]
    if of_motors is not None:
        drive = float(np.nan_to_num(robot.chain.parameters[k, DRIVE]))
        gravity = gravity + drive * (states.qdd - links.qdd)[:, k]
    rows = thinned(states, options.filter)
    out = held_out(len(rows), options.split)
    return JointRun(
        time=states.time,
        period=states.period,
        qd=states.qd[:, k],
        qdd=links.qdd[:, k],
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
