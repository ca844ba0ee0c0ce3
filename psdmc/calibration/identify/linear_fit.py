"""One linear fit of plain logs: base parameters, Coulomb and viscous friction, and constant torques (offsets).

The fit replaces the four calibration steps (motors, gravity, friction, inertia) for a log of an exciting motion. The
log has torques, or currents with known torque constants. The columns of the regressor and of friction are filtered as
the measured torques are.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from psdmc.calibration.identify.estimate import (
    Estimate,
    FitOptions,
    Prior,
    base_parameter_scale,
    torque_sizes,
)
from psdmc.calibration.identify.least_squares import estimate_rows
from psdmc.calibration.identify.linear_problem import (
    LinearOptions,
    LinearProblem,
    extra_scale,
    linear_problem,
)
from psdmc.calibration.identify.motor_model import Motors, RowsByMotors
from psdmc.calibration.identify.predictor import Regressor
from psdmc.calibration.identify.residuals import noise_warnings
from psdmc.calibration.logs.log import AnyLog, Array
from psdmc.calibration.logs.log_checks import checked
from psdmc.robot.mechanism import Mechanism


@dataclass(frozen=True, slots=True, eq=False)
class LinearResult:
    """The result of a linear fit, one vector of l + n f + m values. They are l base parameters, then f friction values
    (with offset) of each of n joints, then m values of springs and further friction.

    estimate   of the whole vector, without physical constraints
    problem    the rows of the least-squares problem
    prior      values before the fit, which remain in directions (combinations) that the data do not determine
    motors     the motors that convert logged effort to torques
    dropped    (l + n f + m,) entries that keep the prior's value because the data do not need them; None: none
    stated     whether the user stated how accurate the base parameters of the robot file are
    """

    estimate: Estimate
    problem: LinearProblem
    prior: Prior
    motors: Motors
    warnings: tuple[str, ...]
    dropped: NDArray[np.bool_] | None = None
    stated: bool = False

    @property
    def samples(self) -> int:
        """Return the number of fitted samples that count as independent, summed over all joints."""
        return int((~self.problem.held_out).sum()) * self.problem.chain.nv

    @property
    def theta_b(self) -> Array:
        return self.estimate.values[: self.problem.l]

    @property
    def std(self) -> Array:
        return self.estimate.std[: self.problem.l]

    @property
    def identifiable(self) -> NDArray[np.bool_]:
        return self.estimate.identifiable[: self.problem.l]

    @property
    def friction(self) -> Array:
        """Return the friction values (n joints, f values of each joint), in the order of `problem.friction`."""
        start, n = self.problem.l, self.problem.chain.nv
        return self.estimate.values[start : self.problem.first_extra].reshape(n, -1)

    @property
    def extra(self) -> Array:
        """Return the m values of springs and further friction, in the order of `problem.columns.unknowns`."""
        return self.estimate.values[self.problem.first_extra :]


def calibrate_linear(
    chain: Mechanism,
    model: Regressor,
    l: int,
    logs: Sequence[AnyLog],
    options: LinearOptions | None = None,
    motors: Motors | None = None,
    theta_b: Array | None = None,
    progress: Callable[[str], None] = lambda step: None,
) -> LinearResult:
    """Return base parameters and plain friction from logs by linear least squares. Raises InputError if a log cannot be
    used.

    l         number of base parameters
    theta_b   (l,) base parameters of the robot file. They remain in directions (linear combinations) that the logs do
              not determine; None: zero
    progress  function that is called with the share of the logs that has been read
    """
    options = options or LinearOptions()
    motors = motors or Motors.torques(chain.nv)
    checked_logs = [checked(log, chain, options.filter.cutoff, options.check) for log in logs]
    remarks = tuple(note for log in checked_logs for note in log.notes)

    def fitted(chosen: LinearOptions, carried: Array | None) -> LinearResult:
        """Return the result of one fit. `carried` (l,) are base parameters from which the torque on the joints is
        computed, if friction depends on this torque; None: friction does not."""
        problem, resting = linear_problem(chain, model, l, checked_logs, chosen, motors, progress, carried)
        progress("linear fit: solving")
        prior = linear_prior(chain, model, problem, chosen, theta_b)
        return _solved(problem, prior, motors, chosen.fit, (*remarks, *resting))

    whole = options.columns
    first = whole if theta_b is not None else whole.without_load()
    found = fitted(replace(options, columns=first), theta_b)
    for _ in range(LOAD_ROUNDS if whole.by_load else 0):
        found = fitted(options, found.theta_b)
    return found


LOAD_ROUNDS = 2
"""Fits after the first where friction depends on the load: each takes the load of the one before, whose error it inherits
times the coefficient of friction, some hundredths."""


def _solved(
    problem: LinearProblem, prior: Prior, motors: Motors, options: FitOptions, remarks: tuple[str, ...]
) -> LinearResult:
    """The values that fit a problem's rows best, and what was remarked on the way."""
    kept = np.repeat(~problem.held_out[:, None], problem.chain.nv, axis=1)
    uncertain = motors.relative_covariance
    rows = problem.rows if uncertain is None else RowsByMotors(problem.rows, problem.torque)
    solved = estimate_rows(rows, problem.torque, options, uncertain, kept, prior)
    noisy = noise_warnings("linear fit", problem.chain.v_names, solved)
    return LinearResult(solved, problem, prior, motors, (*remarks, *noisy))


def linear_prior(
    chain: Mechanism, model: Regressor, problem: LinearProblem, options: LinearOptions, theta_b: Array | None
) -> Prior:
    """Return the values of all unknowns before a linear fit, with a plausible size of each. The values are the file's
    base parameters, no springs, and the start values of friction laws. psdmc's own friction laws start from zero. The
    plausible size of friction is the joint's torque at an ordinary speed."""
    sizes = torque_sizes(problem.torque[~problem.held_out])
    rigid = base_parameter_scale(chain, model, sizes, theta_b)
    own = np.repeat(sizes, len(problem.friction))
    extra = extra_scale(chain, options.columns, options.sign_speed, sizes)
    plain = [value.start for term in problem.terms for value in term.law.values] * chain.nv
    rigid_part = np.zeros(problem.l) if theta_b is None else theta_b
    values = np.concatenate([rigid_part, np.array(plain), options.columns.start])
    return Prior(values, np.concatenate([rigid, own, extra]))
