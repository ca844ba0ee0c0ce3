"""The columns of the fit that an exciting motion is for: base parameters, and friction and offsets where it has them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from psdmc.calibration.identify.gravity import gravity_split
from psdmc.calibration.identify.linear_options import LinearOptions
from psdmc.calibration.identify.linear_problem import friction_columns
from psdmc.calibration.identify.predictor import Regressor
from psdmc.calibration.logs.log import Array
from psdmc.robot.mechanism import Mechanism

SPEED_STEP = 1e-6
"""rad/s (m/s) of the central difference of friction terms by speed."""
ANGLE_STEP = 1e-5
"""rad (m) of the central difference of the regressor by position: wrong by 1e-10 of it."""


@dataclass(frozen=True, slots=True, eq=False)
class FitColumns:
    """Columns (..., n, m + n f) of a linear fit at states: (Y @ into) of l base parameters, then each joint's own.

    model  Y
    into   (l, m)  directions of theta_b that the fit looks for
    terms  (..., n) speeds to (..., n, f) factors of a joint's friction and offset; None: the fit has none
    """

    model: Regressor
    into: Array
    terms: Callable[[Array], Array] | None = None

    def of(self, regressor: Array, qd: Array) -> Array:
        """The columns from the regressor (..., n, l) and the speeds."""
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
        """(3, n, N) derivatives by the states of sum(weights * columns) + sum(on_regressor * Y).

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
    """Those of the linear fit of one log: all base parameters, friction, offsets, before its filter."""

    def terms(qd: Array) -> Array:
        return np.stack(friction_columns(options.terms, qd, options.sign_speed), axis=-1)

    return FitColumns(model, np.eye(l), terms)


def inertial_columns(chain: Mechanism, model: Regressor, l: int) -> FitColumns:
    """Those of the inertial step of the four: the parameters that gravity does not show, (23). Friction is known by then."""
    return FitColumns(model, gravity_split(chain, model, l).from_psi())


def regressor_slopes(model: Regressor, q: Array, qd: Array, qdd: Array, weights: Array) -> Array:
    """(3, n, N) derivatives by q, qd and qdd, (N, n) each, of sum(weights * Y(q, qd, qdd)), weights (N, n, l).

    Y is linear in the accelerations and quadratic in the speeds, so that differences are exact there.
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
