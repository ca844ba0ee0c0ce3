"""How well a motion's columns tell the parameters apart, with derivatives: smaller is better."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from psdmc.calibration.logs.log import Array
from psdmc.calibration.motions.excite_options import Objective

SMALLEST_EIGENVALUE = 1e-14
"""Of a Gram matrix of unit columns: rounding is as large."""
TINY = 1e-100
"""Squared length of a column that a motion does not excite: its inverse is a number."""


@dataclass(frozen=True, slots=True, eq=False)
class Scaled:
    """The Gram matrix of columns scaled to unit length.

    matrix (m, m), lengths (m,) of the columns, values (m,) ascending, vectors (m, m)
    """

    matrix: Array
    lengths: Array
    values: Array
    vectors: Array

    @property
    def condition(self) -> float:
        """Condition number of the scaled columns, exact enough up to 1e6."""
        return float(np.sqrt(self.values[-1] / self.values[0]))

    @property
    def deviation(self) -> float:
        """A bound on the parameters' standard deviations where each row's error is one, as a geometric mean over them: the
        condition number over the columns' lengths.

        Parameter j has the standard deviation sqrt((C^-1)_jj) / L_j, C the matrix and L_j its column's length; the first
        factor is at most the condition number, as the largest eigenvalue of a matrix with a unit diagonal is at least one.
        """
        return self.condition / float(np.exp(np.mean(np.log(self.lengths))))

    @property
    def log_det(self) -> float:
        """Minus the log determinant of the columns' own Gram matrix."""
        return -float(np.sum(np.log(self.values)) + 2.0 * np.sum(np.log(self.lengths)))

    def score(self, objective: Objective) -> float:
        """What the objective minimises."""
        match objective:
            case "deviation":
                return self.deviation
            case "condition":
                return self.condition
            case "log_det":
                return self.log_det


def scaled(columns: Array) -> Scaled:
    """Of columns (..., m), all leading axes being rows."""
    rows = columns.reshape(-1, columns.shape[-1])
    gram = rows.T @ rows
    lengths = np.sqrt(np.maximum(np.diagonal(gram), TINY))
    matrix = gram / np.outer(lengths, lengths)
    values, vectors = np.linalg.eigh(matrix)
    return Scaled(matrix, lengths, np.maximum(values, SMALLEST_EIGENVALUE), vectors)


def smooth_score(of: Scaled, objective: Objective, power: float) -> tuple[float, Array]:
    """The objective's smooth form, logarithmic, and its derivatives by the unscaled Gram matrix (m, m)."""
    if objective == "log_det":
        return negative_log_det(of)
    value, by_gram = smooth_condition(of, power)
    if objective == "condition":
        return value, by_gram
    share = 1.0 / len(of.lengths)
    return value - share * float(np.log(of.lengths).sum()), by_gram - np.diag(0.5 * share / of.lengths**2)


def smooth_condition(of: Scaled, power: float) -> tuple[float, Array]:
    """The logarithm of the condition number with its extreme eigenvalues replaced by means of all, and its derivatives by
    the unscaled Gram matrix (m, m).

    power   the means are sums of powers: 1 counts all directions alike, large ones the best and the worst alone
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
    """Minus the log determinant of the unscaled Gram matrix, and its derivatives."""
    inverse = (of.vectors / of.values) @ of.vectors.T
    return of.log_det, -inverse / np.outer(of.lengths, of.lengths)
