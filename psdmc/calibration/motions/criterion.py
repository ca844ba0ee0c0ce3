"""Measures how well a motion determines the parameters of a linear fit, with derivatives. Smaller values are better.

The columns A of the fit have one row per sample and joint, one column per parameter. Most functions need the Gram
matrix A^T A.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from psdmc.calibration.identify.gravity import gravity_split
from psdmc.calibration.identify.linear_problem import LinearOptions, friction_columns
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
    """The Gram matrix A^T A of the columns of a fit after each column was scaled to unit length.

    matrix   (m, m) scaled Gram matrix of m columns, with ones on the diagonal
    lengths  (m,) lengths of the columns before scaling
    values   (m,) eigenvalues of the matrix, ascending
    vectors  (m, m) eigenvectors
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
        """Upper bound of the parameters' standard deviations, as a geometric mean, for a measurement error of one in
        each row.

        The bound is the condition number divided by the geometric mean of the columns' lengths. The standard deviation
        of parameter j is sqrt((C^-1)_jj) / L_j, with the scaled Gram matrix C and the length L_j of column j. The first
        factor is at most the condition number, because the largest eigenvalue of a matrix with unit diagonal is at
        least one.
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

    def times(self, other: Scaled, objective: Objective) -> float:
        """Return how many times the measure of an objective is that of other columns.

        For "log_det", the measure is the geometric mean of the semi-axes of the parameters' confidence ellipsoid."""
        if objective == "log_det":
            return float(np.exp(0.5 * (self.log_det - other.log_det) / len(self.lengths)))
        return self.score(objective) / other.score(objective)


def scaled(columns: Array) -> Scaled:
    """Return the Gram matrix of the columns of a fit, each scaled to unit length.

    columns  (..., m) m columns; all leading axes count rows
    """
    rows = columns.reshape(-1, columns.shape[-1])
    gram = rows.T @ rows
    lengths = np.sqrt(np.maximum(np.diagonal(gram), TINY))
    matrix = gram / np.outer(lengths, lengths)
    values, vectors = np.linalg.eigh(matrix)
    return Scaled(matrix, lengths, np.maximum(values, SMALLEST_EIGENVALUE), vectors)


def smooth_score(of: Scaled, objective: Objective, power: float) -> tuple[float, Array]:
    """Return a smooth measure of how well a motion determines the parameters of a fit, and its derivatives.

    With the objective "log_det", the measure is minus the log determinant of the Gram matrix. With the others, it is
    the smoothed logarithm of the condition number, with "deviation" divided by the columns' geometric mean length. The
    derivatives are those by the entries of the Gram matrix (m, m) before scaling.
    """
    if objective == "log_det":
        inverse = (of.vectors / of.values) @ of.vectors.T
        return of.log_det, -inverse / np.outer(of.lengths, of.lengths)
    value, by_gram = smooth_condition(of, power)
    if objective == "condition":
        return value, by_gram
    share = 1.0 / len(of.lengths)
    return value - share * float(np.log(of.lengths).sum()), by_gram - np.diag(0.5 * share / of.lengths**2)


def smooth_condition(of: Scaled, power: float) -> tuple[float, Array]:
    """Return a smooth form of the logarithm of the condition number of scaled columns, and its derivatives.

    The condition number is not differentiable where several eigenvalues are the largest or the smallest. Power means
    over all eigenvalues therefore take the place of these two. The derivatives are those by the entries of the Gram
    matrix (m, m) before scaling.

    power  exponent of the power means: with 1, all eigenvalues matter; with large values, only the largest and the
           smallest
    """
    values, vectors = of.values, of.vectors
    up, down = (values / values[-1]) ** power, (values / values[0]) ** -power
    value = np.log(values[-1] / values[0]) + (np.log(up.sum()) + np.log(down.sum())) / power
    by_values = 0.5 * (up / up.sum() - down / down.sum()) / values
    by_matrix = (vectors * by_values) @ vectors.T
    by_gram = by_matrix / np.outer(of.lengths, of.lengths)
    by_gram -= np.diag((by_matrix * of.matrix).sum(axis=1) / of.lengths**2)
    return 0.5 * float(value), by_gram


SPEED_STEP = 1e-6
"""rad/s (m/s) of the central difference of friction terms by speed."""
ANGLE_STEP = 1e-5
"""rad (m) of the central difference of the regressor by position: wrong by 1e-10 of it."""


@dataclass(frozen=True, slots=True, eq=False)
class FitColumns:
    """Computes the columns (..., n, m + n f) of a linear fit at states of n joints.

    The first m columns are Y @ into, with the regressor Y. They are followed by f columns of friction and offset for
    each joint.

    model  object that computes the regressor Y
    into   (l, m) the m combinations of base parameters theta_b that the fit determines
    terms  function from speeds (..., n) to the f factors (..., n, f) of friction and offset; None: the fit has no
           friction
    """

    model: Regressor
    into: Array
    terms: Callable[[Array], Array] | None = None

    def of(self, regressor: Array, qd: Array) -> Array:
        """Return the columns (..., n, m + n f) of the fit from the regressor (..., n, l) and the joint speeds (..., n)."""
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
        """Return the derivatives (3, n, N) of sum(weights * columns) + sum(on_regressor * Y) by the states of N
        samples.

        Here `columns` are those of the fit, and Y is the regressor. The first axis has derivatives by q, qd and qdd.

        states        (3, n, N) q, qd and qdd of n joints
        weights       (N, n, m + n f)
        on_regressor  (N, n, l) additional weights of Y; None: zero
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
    """Return the columns of a log's linear fit, for unfiltered states: base parameters, friction and offsets."""

    def terms(qd: Array) -> Array:
        return np.stack(friction_columns(options.terms, qd, options.sign_speed), axis=-1)

    return FitColumns(model, np.eye(l), terms)


def inertial_columns(chain: Mechanism, model: Regressor, l: int) -> FitColumns:
    """Return the columns of the inertial step of a four-step calibration, (23) of Denso-2022.

    The columns belong to the parameters that do not affect gravity torques. In the inertial step, friction is known.
    """
    return FitColumns(model, gravity_split(chain, model, l).from_psi())


def regressor_slopes(model: Regressor, q: Array, qd: Array, qdd: Array, weights: Array) -> Array:
    """Return the derivatives (3, n, N) of sum(weights * Y) by the states of N samples, with the regressor Y.

    The first axis has the derivatives by q, qd and qdd, (N, n) each. `weights` is (N, n, l) like Y.

    Y is linear in the accelerations and quadratic in the speeds, so finite differences are exact for these.
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
