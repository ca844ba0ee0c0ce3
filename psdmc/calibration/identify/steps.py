"""Data classes of a four-step calibration (motors, gravity, friction, inertia): runs, options, and accuracy."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from psdmc.calibration.identify.estimate import FitOptions
from psdmc.calibration.identify.motor_model import Motors
from psdmc.calibration.identify.predictor import Regressor
from psdmc.calibration.identify.residuals import quality
from psdmc.calibration.logs.filter import SplitOptions
from psdmc.calibration.logs.log import Array, Log
from psdmc.calibration.logs.low_pass import FilterOptions
from psdmc.model.calibrated import JointQuality, Sample, StepQuality, StepUsed
from psdmc.robot.mechanism import Mechanism


@dataclass(frozen=True, slots=True)
class Load:
    """A known mass (kg) at the tip; com is its centre of mass (m) in the tip frame."""

    mass: float
    com: tuple[float, float, float]


@dataclass(frozen=True, slots=True, eq=False)
class Robot:
    """The robot, as the steps of a four-step calibration use it.

    chain      the joints, with their limits
    regressor  object that computes the robot's regressor
    motors     the motors, which convert logged effort to torque
    """

    chain: Mechanism
    regressor: Regressor
    motors: Motors


@dataclass(frozen=True, slots=True, eq=False)
class MotorRun:
    """A run that sweeps one joint forwards and backwards at constant speed, without and with a known load."""

    joint: str
    unloaded: Log
    loaded: Log
    load: Load


@dataclass(frozen=True, slots=True, eq=False)
class GravityRun:
    """A run of all joints at constant speeds, and then of the whole motion in reverse.

    tool  known load at the tip; None: no load
    """

    log: Log
    tool: Load | None = None


@dataclass(frozen=True, slots=True, eq=False)
class FrictionRun:
    """A run of one joint along sines of growing amplitude, while the other joints rest."""

    joint: str
    log: Log
    tool: Load | None = None


@dataclass(frozen=True, slots=True, eq=False)
class InertialRun:
    """A run with a fast, exciting motion of all joints."""

    log: Log
    tool: Load | None = None


@dataclass(frozen=True, slots=True)
class StepOptions:
    """Options of one step of a four-step calibration: filter, validation split, and solution of the linear problem."""

    filter: FilterOptions
    split: SplitOptions = field(default_factory=SplitOptions)
    fit: FitOptions = field(default_factory=FitOptions)

    @property
    def used(self) -> StepUsed:
        """The options that a calibrated model stores."""
        low_pass, split = self.filter, self.split
        return StepUsed(low_pass.cutoff, low_pass.order, low_pass.settle, split.held_out, split.blocks)


def step_of(used: StepUsed) -> StepOptions:
    """Return filter and validation split that one step of a calibration used, as the calibrated model stores them.

    Raises InputError if the stored values are out of range.
    """
    return StepOptions(
        FilterOptions(used.cutoff, used.order, used.settle), SplitOptions(used.held_out, used.blocks)
    )


@dataclass(frozen=True, slots=True)
class FrictionOptions:
    """Options for the fit of the seven LuGre friction parameters of a joint.

    law             lugre: all seven parameters; coulomb_viscous: Coulomb friction F_c and linear viscous friction F_v
                    only
    fast            lowest speed in the first part of the fit, which ignores pre-sliding; a share of the run's largest
                    speed
    sliding         lowest speed in the fit of coulomb_viscous; a share of the run's largest speed
    simplex_steps   largest number of Nelder-Mead evaluations
    estimate_delay  True: also estimate the time between position and current
    largest_delay   s
    unseen          relative standard deviation above which a parameter counts as not determined
    workers         number of processes; joints are fitted independently
    """

    law: Literal["lugre", "coulomb_viscous"] = "lugre"
    fast: float = 0.25
    sliding: float = 0.02
    simplex_steps: int = 160
    estimate_delay: bool = True
    largest_delay: float = 5e-3
    unseen: float = 0.5
    workers: int = 1


@dataclass(frozen=True, slots=True)
class CalibrationOptions:
    """Options of all four steps (motors, gravity, friction, inertia), with the cut-off frequencies of Denso-2022.

    passes  number of times that gravity, friction and inertia are determined. From the second pass on, the gravity step
            subtracts the inertial torque that the previous pass determined. The paper has one pass and neglects this
            torque
    """

    motor: StepOptions = field(default_factory=lambda: StepOptions(FilterOptions(cutoff=4.0)))
    gravity: StepOptions = field(default_factory=lambda: StepOptions(FilterOptions(cutoff=4.0)))
    friction: StepOptions = field(default_factory=lambda: StepOptions(FilterOptions(cutoff=40.0)))
    lugre: FrictionOptions = field(default_factory=FrictionOptions)
    inertial: StepOptions = field(default_factory=lambda: StepOptions(FilterOptions(cutoff=15.0)))
    passes: int = 2


def judged(
    step: str,
    joint_names: Sequence[str],
    x: Array,
    measured: Array,
    predicted: Array,
    out: NDArray[np.bool_],
    use: NDArray[np.bool_] | None = None,
    abscissa: str = "time [s]",
) -> StepQuality:
    """Return the accuracy (R^2, RMSE) of each joint's predicted torques, on fitted and on held-out samples, and data to
    plot.

    x                    (N,) abscissa of the plots, such as time
    measured, predicted  (N, n) torques of n joints
    out                  (N,) True: the sample is held out for validation
    use                  (N, n) True: the sample is used; None: all samples are used
    """
    joints: dict[str, JointQuality] = {}
    samples: list[Sample] = []
    for k, name in enumerate(joint_names):
        rows: slice | NDArray[np.intp]
        rows = slice(None) if use is None else np.flatnonzero(use[:, k])  # without copies: logs may be long
        m, p, is_out = measured[rows, k], predicted[rows, k], out[rows]
        joints[name] = JointQuality(quality(m[~is_out], p[~is_out]), quality(m[is_out], p[is_out]))
        samples.append(Sample(name, abscissa, x[rows], m, p, is_out))
    return StepQuality(step, joints, tuple(samples))
