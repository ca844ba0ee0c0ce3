"""Inputs and results that the four steps share: runs, options, qualities."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from psdmc.calibration.identify.estimate import FitOptions
from psdmc.calibration.identify.quality import quality
from psdmc.calibration.logs.filter import SplitOptions
from psdmc.calibration.logs.log import Array, Log
from psdmc.calibration.logs.low_pass import FilterOptions
from psdmc.model.calibrated import JointQuality, Sample, StepQuality, StepUsed


@dataclass(frozen=True, slots=True)
class Load:
    """A known mass (kg) at the tip; com (m) in the tip frame."""

    mass: float
    com: tuple[float, float, float]


@dataclass(frozen=True, slots=True, eq=False)
class MotorRun:
    """One joint swept to and fro at constant speed, without and with a known load."""

    joint: str
    unloaded: Log
    loaded: Log
    load: Load


@dataclass(frozen=True, slots=True, eq=False)
class GravityRun:
    """All joints at constant speeds, then the same path backwards; `tool` is the known load at the tip, if any."""

    log: Log
    tool: Load | None = None


@dataclass(frozen=True, slots=True, eq=False)
class FrictionRun:
    """One joint through sines of growing amplitude, the others at rest."""

    joint: str
    log: Log
    tool: Load | None = None


@dataclass(frozen=True, slots=True, eq=False)
class InertialRun:
    """A fast, exciting motion of all joints."""

    log: Log
    tool: Load | None = None


@dataclass(frozen=True, slots=True)
class StepOptions:
    """Filter, split and solution of one step."""

    filter: FilterOptions
    split: SplitOptions = field(default_factory=SplitOptions)
    fit: FitOptions = field(default_factory=FitOptions)

    @property
    def used(self) -> StepUsed:
        """What a calibrated model keeps of it."""
        low_pass, split = self.filter, self.split
        return StepUsed(low_pass.cutoff, low_pass.order, low_pass.settle, split.held_out, split.blocks)


def step_of(used: StepUsed) -> StepOptions:
    """The options of a step that a calibrated model keeps; InputError where they cannot be."""
    return StepOptions(
        FilterOptions(used.cutoff, used.order, used.settle), SplitOptions(used.held_out, used.blocks)
    )


@dataclass(frozen=True, slots=True)
class FrictionOptions:
    """How the seven LuGre parameters are found.

    law             lugre: all seven; coulomb_viscous: F_c and a linear F_v only
    fast            speed above which pre-sliding is ignored in the first step, share of the run's largest
    sliding         speed above which plain friction is fitted, share of the run's largest
    simplex_steps   largest number of Nelder-Mead evaluations
    estimate_delay  whether the time between position and current is estimated with them
    largest_delay   s
    unseen          relative standard deviation from which a parameter is marked unseen
    workers         processes; joints are independent
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
    """All four steps, with the cut-offs of Denso-2022.

    passes   how often gravity, friction and inertia are repeated: from the second pass on, the inertial torque of the
             first is subtracted in the gravity step (the paper's single pass neglects it)
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
    """Quality and samples of every joint.

    x (N,), measured and predicted (N, n), out (N,) held-out rows; use (N, n) entries that count, None: all
    """
    joints: dict[str, JointQuality] = {}
    samples: list[Sample] = []
    for k, name in enumerate(joint_names):
        rows = np.arange(len(x)) if use is None else np.flatnonzero(use[:, k])
        m, p, is_out = measured[rows, k], predicted[rows, k], out[rows]
        joints[name] = JointQuality(quality(m[~is_out], p[~is_out]), quality(m[is_out], p[is_out]))
        samples.append(Sample(name, abscissa, x[rows], m, p, is_out))
    return StepQuality(step, joints, tuple(samples))
