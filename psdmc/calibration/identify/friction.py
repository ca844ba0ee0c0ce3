"""Step three: determines the LuGre friction of every joint from runs of one joint at a time. Source: Denso-2022, (12)
to (14), (19), (20)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from psdmc.calibration.identify.friction_fit import JointFriction, JointRun, fit_joint, prepared, unknowns_of
from psdmc.calibration.identify.residuals import CORRELATED, quality
from psdmc.calibration.identify.steps import FrictionOptions, FrictionRun, Robot, StepOptions
from psdmc.calibration.logs.log import Array
from psdmc.model.calibrated import JointQuality, Remark, Sample, StepQuality
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
    found = {joint.joint: joint for joint in _fitted(tasks, options.workers)}
    warnings = tuple(
        f"joint {name}: friction parameter(s) not seen in the data: {', '.join(joint.unseen)}"
        for name, joint in found.items()
        if joint.unseen
    )
    return FrictionResult(found, (*warnings, *_correlated(found)))


def _correlated(found: Mapping[str, JointFriction]) -> tuple[str, ...]:
    """One warning that names the joints whose residual is not noise."""
    named = [
        f"{name} ({joint.correlation:.2f}, by {joint.widened:.1f})"
        for name, joint in found.items()
        if joint.correlation > CORRELATED
    ]
    if not named:
        return ()
    text = (
        f"friction: the residual is no noise but correlated from sample to sample, joint(s) {', '.join(named)}: the "
        "model lacks an effect there; standard deviations are widened for it, by the factor named"
    )
    return (Remark(text, "residual"),)


def judge_friction(runs: Mapping[str, JointRun], joints: Mapping[str, JointFriction]) -> StepQuality:
    """Return how well each joint's friction predicts its run's motor torque, after the gravity torque is subtracted."""
    qualities, samples = {}, []
    for name, data in runs.items():
        if name in joints:
            qualities[name], sample = _judged(name, data, joints[name])
            samples.append(sample)
    return StepQuality("Friction", qualities, tuple(samples))


def prepared_runs(
    robot: Robot, theta_b: Array, runs: Sequence[FrictionRun], options: StepOptions
) -> dict[str, JointRun]:
    """Return the friction runs (recordings in which one joint moves) by joint, in the order of the robot's joints. Each
    has its gravity torque, which is computed from the base parameters theta_b."""
    places = {name: k for k, name in enumerate(robot.chain.v_names)}
    own = sorted((run for run in runs if run.joint in places), key=lambda run: places[run.joint])
    return {run.joint: prepared(robot, theta_b, run, places[run.joint], options) for run in own}


_Task = tuple[str, JointRun, FrictionOptions, JointFriction | None]


def _fitted(tasks: list[_Task], workers: int) -> list[JointFriction]:
    """The fits of all joints, which are independent: in several processes where more than one is allowed."""
    return list(in_processes(_fit, tasks, workers))


def _fit(task: _Task) -> JointFriction:
    return fit_joint(*task)


def _judged(name: str, data: JointRun, joint: JointFriction) -> tuple[JointQuality, Sample]:
    """Quality of friction alone: the torque that gravity, inertia and offset explain is subtracted from both sides."""
    rigid = data.low_pass(data.rigid(joint.inertia, joint.offset, joint.delay))
    measured = data.measured - rigid
    modelled = data.low_pass(data.torque(unknowns_of(joint))) - rigid
    fit, out, every = data.fit, data.out, data.every
    both = JointQuality(quality(measured[fit], modelled[fit]), quality(measured[out], modelled[out]))
    is_out = np.isin(every, out)
    return both, Sample(name, "time [s]", data.time[every], measured[every], modelled[every], is_out)
