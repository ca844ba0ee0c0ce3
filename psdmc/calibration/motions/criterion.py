"""Measures how well a motion distinguishes the parameters of a fit, with derivatives. Smaller values are better.

Most functions need the Gram matrix of the fit's columns A, which is A^T A.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from psdmc.calibration.identify.gravity import gravity_split
from psdmc.calibration.identify.linear_options import LinearOptions
from psdmc.calibration.identify.linear_problem import friction_columns
from psdmc.calibration.identify.predictor import Regressor
from psdmc.calibration.logs.log import Array
from psdmc.calibration.motions.excite_options import Objective
from psdmc.robot.mechanism import Mechanism

SMALLEST_EIGENVALUE = 1e-14
"""Of a Gram matrix of unit columns: rounding is as large."""
TINY = 1e-100
"""Squared length of a column that a motion does not excite: its inverse is a number."""


@dataclass(frozen=True, slots=True, eq=False)
class Scaled:
    """The Gram matrix of columns after scaling to unit length.

    matrix (m, m), lengths (m,) of the columns, eigenvalues `values` (m,) ascending, eigenvectors `vectors` (m, m)
    """

    matrix: Array
    lengths: Array
    values: Array
    vectors: Array

    @property
    def condition(self) -> float:
        """Condition number of the scaled columns, accurate up to 1e6."""
        return float(np.sqrt(self.values[-1] / self.values[0]))

    @property
    def deviation(self) -> float:
        """Bound of the parameters' standard deviations, as a geometric mean, if the error of each row is one: the
        condition number divided by the columns' lengths.

        The standard deviation of parameter j is sqrt((C^-1)_jj) / L_j, with the matrix C and the length L_j of its
        column. The first factor is at most the condition number, because the largest eigenvalue of a matrix with unit
        diagonal is at least one.
        """
        return self.condition / float(np.exp(np.mean(np.log(self.lengths))))

    @property
    def log_det(self) -> float:
        """Minus the log determinant of the unscaled Gram matrix."""
        return -float(np.sum(np.log(self.values)) + 2.0 * np.sum(np.log(self.lengths)))

    def score(self, objective: Objective) -> float:
        """Return the value that the objective minimises."""
        match objective:
            case "deviation":
                return self.deviation
            case "condition":
                return self.condition
            case "log_det":
                return self.log_det


def scaled(columns: Array) -> Scaled:
    """Return the scaled Gram matrix of columns (..., m), where all leading axes are rows."""
    rows = columns.reshape(-1, columns.shape[-1])
    gram = rows.T @ rows
    lengths = np.sqrt(np.maximum(np.diagonal(gram), TINY))
    matrix = gram / np.outer(lengths, lengths)
    values, vectors = np.linalg.eigh(matrix)
    return Scaled(matrix, lengths, np.maximum(values, SMALLEST_EIGENVALUE), vectors)


def smooth_score(of: Scaled, objective: Objective, power: float) -> tuple[float, Array]:
    """Return a smooth form of the objective, in logarithms, and its derivatives by the unscaled Gram matrix (m, m)."""
    if objective == "log_det":
        return negative_log_det(of)
    value, by_gram = smooth_condition(of, power)
    if objective == "condition":
        return value, by_gram
    share = 1.0 / len(of.lengths)
    return value - share * float(np.log(of.lengths).sum()), by_gram - np.diag(0.5 * share / of.lengths**2)


def smooth_condition(of: Scaled, power: float) -> tuple[float, Array]:
    """Return a smooth form of the logarithm of the condition number, and its derivatives by the unscaled Gram matrix
    (m, m). Means over all eigenvalues replace the extreme ones.

    power   exponent of these means: 1 weights all directions equally, large values only the best and the worst
    """
    values, vectors = of.values, of.vectors
    up, down = (values / values[-1]) ** power, (values / values[0]) ** -power
    value = np.log(values[-1] / values[0]) + (np.log(up.sum()) + np.log(down.sum())) / power
    by_values = 0.5 * (up / up.sum() - down / down.sum()) / values
    by_matrix = (vectors * by_values) @ vectors.T
    by_gram = by_matrix / np.outer(of.lengths, of.lengths)
    by_gram -= np.diag((by_matrix * of.matrix).sum(axis=1) / of.lengths**2)
    return 0.5 * float(value), by_gram


def negative_log_det(of: Scaled) -> tuple[float, Array]:
    """Return minus the log determinant of the unscaled Gram matrix, and its derivatives."""
    inverse = (of.vectors / of.values) @ of.vectors.T
    return of.log_det, -inverse / np.outer(of.lengths, of.lengths)


SPEED_STEP = 1e-6
"""rad/s (m/s) of the central difference of friction terms by speed."""
ANGLE_STEP = 1e-5
"""rad (m) of the central difference of the regressor by position: wrong by 1e-10 of it."""


@dataclass(frozen=True, slots=True, eq=False)
class FitColumns:
    """The columns (..., n, m + n f) of a linear fit at states: (Y @ into) for theta_b, then friction and offset of
    each joint.

    model  regressor Y
    into   (l, m)  directions of theta_b that the fit determines
    terms  function from speeds (..., n) to factors (..., n, f) of a joint's friction and offset; None: the fit has none
    """

    model: Regressor
    into: Array
    terms: Callable[[Array], Array] | None = None

    def of(self, regressor: Array, qd: Array) -> Array:
        """Return the columns from the regressor (..., n, l) and the speeds."""
        rigid = regressor @ self.into
        if self.terms is None:
            return np.asarray(rigid)
        own = self.terms(qd)
        n, f = own.shape[-2:]
        spread = np.zeros((*qd.shape, n * f))
        for k in range(n):
            spread[..., k, k * f : (k + 1) * f] = own[..., k, :]
        return np.concatenate([rigid, spread], axis=-1)

    def at(self, q: Array, qd: Array, qdd: Array) -> Array:
        return self.of(self.model.regressor(q, qd, qdd), qd)

    def slopes(self, states: Array, weights: Array, on_regressor: Array | None = None) -> Array:
        """Return the derivatives (3, n, N) of sum(weights * columns) + sum(on_regressor * Y) by the states.

        states (3, n, N), weights (N, n, m + n f), on_regressor (N, n, l)
        """
        q, qd, qdd = (np.ascontiguousarray(part.T) for part in states)
        m = self.into.shape[1]
        onto = weights[..., :m] @ self.into.T
        found = regressor_slopes(
            self.model, q, qd, qdd, onto if on_regressor is None else onto + on_regressor
        )
        if self.terms is not None:
            rate = (self.terms(qd + SPEED_STEP) - self.terms(qd - SPEED_STEP)) / (2 * SPEED_STEP)
            f = rate.shape[-1]
            for k in range(qd.shape[1]):
                found[1, k] += (weights[:, k, m + k * f : m + (k + 1) * f] * rate[:, k]).sum(axis=-1)
        return found


def all_columns(model: Regressor, l: int, options: LinearOptions) -> FitColumns:
    """Return the columns of the linear fit of one log, before its filter: all base parameters, friction and offsets."""

    def terms(qd: Array) -> Array:
        return np.stack(friction_columns(options.terms, qd, options.sign_speed), axis=-1)

    return FitColumns(model, np.eye(l), terms)


def inertial_columns(chain: Mechanism, model: Regressor, l: int) -> FitColumns:
    """Return the columns of the inertial step of the four steps: the parameters that do not affect gravity torques,
    (23) of Denso-2022. Friction is known in that step."""
    return FitColumns(model, gravity_split(chain, model, l).from_psi())


def regressor_slopes(model: Regressor, q: Array, qd: Array, qdd: Array, weights: Array) -> Array:
    """Return the derivatives (3, n, N) of sum(weights * Y(q, qd, qdd)) by q, qd and qdd, (N, n) each; weights (N, n,
    l).

    Y is linear in the accelerations and quadratic in the speeds, so differences are exact for these.
    """
    count, n = q.shape
    away = np.eye(n)[:, None]
    still = np.zeros_like(q)

    def many(values: Array, copies: int) -> Array:
        return np.broadcast_to(values, (copies, count, n))

    places = np.concatenate([q + ANGLE_STEP * away, q - ANGLE_STEP * away, many(q, 3 * n + 1)])
    speeds = np.concatenate([many(qd, 2 * n), qd + away, qd - away, many(still, n + 1)])
    unit = np.broadcast_to(away, (n, count, n))
    changes = np.concatenate([many(qdd, 4 * n), unit, many(still, 1)])
    rows = model.regressor(places, speeds, changes).reshape(len(places), count, -1)
    total = np.einsum("btk,tk->bt", rows, weights.reshape(count, -1))
    by_q = (total[:n] - total[n : 2 * n]) / (2 * ANGLE_STEP)
    by_qd = 0.5 * (total[2 * n : 3 * n] - total[3 * n : 4 * n])
    return np.stack([by_q, by_qd, total[4 * n : 5 * n] - total[5 * n]])
