"""Estimates the delay between motion and torque in a log.

The torque of every sample is also taken from earlier and later times. Base parameters, friction and offsets are fitted
for each of these delays. The result is the delay with the best fit.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from psdmc.calibration.identify.motor_model import Coupling
from psdmc.calibration.identify.predictor import Regressor
from psdmc.calibration.logs.log import Array
from psdmc.calibration.verdict.evidence import Shifted
from psdmc.calibration.verdict.gains import FEWEST, basis, clustered
from psdmc.model.grounds import Delay

ROUNDS = 3
"""Fits: the first weights joints by their torques, the others by what the fit before leaves of these."""
SMALLEST_SHARE = 1e-3
"""Of a joint's torque that counts as left: ideal sensors leave less, and rounding is no information."""
SURE = 3.0
"""Standard deviations from zero ..."""
LIKELIER = 25.0
"""... and logarithm of the likelihood that the best delay gains on none, for a delay to be there. The best of a hundred
delays gains 5 on average where only noise is fitted, and 11 on noise whose samples depend on each other."""
BELIEVED = 0.7
"""Mean over joints of the share of torque that the fit explains at the best delay: a log of other faults says nothing of
time."""


def delays_of(
    regressor: Regressor, logs: Sequence[Shifted], coupling: Coupling | None, known: float = 0.0
) -> tuple[Delay, ...]:
    """Return the delay between motion and torque in each log, in addition to the delay `known`, s.

    Logs that are too short for a fit of their own are fitted together.
    """
    alone = [
        log
        for log in logs
        if log.torque[..., 0].size >= FEWEST * _columns(regressor, log, coupling).shape[-1]
    ]
    rest = [log for log in logs if not any(log is one for one in alone)]
    groups = [[log] for log in alone] + ([rest] if rest else [])
    found = [_delay(regressor, group, coupling, known) for group in groups]
    return tuple(delay for delay in found if delay is not None)


def _columns(regressor: Regressor, log: Shifted, coupling: Coupling | None) -> Array:
    """(N, n, l + 3 n) of base parameters, Coulomb and viscous friction and offsets, the motors' friction on the joints."""
    rigid = regressor.regressor(log.q, log.qd, log.qdd)
    n = log.q.shape[1]
    onto = np.eye(n) if coupling is None else coupling.inverse
    rubbing = [np.einsum("tk,kj->tjk", part, onto) for part in (log.sign, log.speed)]
    constant = np.broadcast_to(np.eye(n), (len(log.q), n, n))
    return np.concatenate([rigid, *rubbing, constant], axis=2)


def _delay(
    regressor: Regressor, logs: Sequence[Shifted], coupling: Coupling | None, known: float
) -> Delay | None:
    """One delay of some logs; None where they are too few for a fit."""
    columns = np.concatenate([_columns(regressor, log, coupling) for log in logs])
    torque, lags = np.concatenate([log.torque for log in logs]), logs[0].lags
    samples, n, width = columns.shape
    name = ", ".join(log.log for log in logs)
    zero = int(np.abs(lags - known).argmin())
    size = torque[:, :, zero].std(axis=0)
    moved = size > 0
    if samples * n < FEWEST * width or not moved.any():
        return None
    weights = np.where(moved, 1.0 / np.where(moved, size, 1.0), 0.0)
    for _ in range(ROUNDS):
        fitted = basis((columns * weights[:, None]).reshape(-1, width))
        target = (torque * weights[:, None]).reshape(samples * n, -1)
        left = target - fitted @ (fitted.T @ target)
        squares = (left**2).sum(axis=0)
        best = int(squares.argmin())
        scatter = np.sqrt((left[:, best].reshape(samples, n) ** 2).mean(axis=0))
        share = scatter / np.where(moved, weights * size, 1.0)
        weights = weights / np.maximum(scatter, SMALLEST_SHARE * weights * size + ~moved)
    gained = 0.5 * samples * n * float(np.log(squares[zero] / squares[best]))
    explains = gained > LIKELIER and float(np.mean(1.0 - share[moved] ** 2)) > BELIEVED
    if not 0 < best < len(lags) - 1:
        return Delay(name, float(lags[best]) - known, np.inf, explains)
    before, here, after = squares[best - 1 : best + 2]
    step = float(lags[1] - lags[0])
    value = float(lags[best]) + 0.5 * step * float((before - after) / (before - 2.0 * here + after))
    rate = (left[:, best + 1] - left[:, best - 1]) / (2.0 * step)
    std = _deviation(rate.reshape(samples, n), left[:, best].reshape(samples, n))
    return Delay(name, value - known, std, explains and abs(value - known) > SURE * std)


def _deviation(rate: Array, left: Array) -> float:
    """Return the standard deviation of the delay, from the residuals (N, n) and their change per delay. It comes from
    stretches of time, and from joints left out one at a time, as a joint's friction may look like a delay."""
    power, pull = (rate**2).sum(axis=0), (rate * left).sum(axis=0)
    by_time = float(clustered((rate * left).sum(axis=1)[:, None])[0, 0]) / float(power.sum()) ** 2
    others = power.sum() - power
    moves = (pull.sum() - pull)[others > 0] / others[others > 0] - pull.sum() / power.sum()
    count = max(len(moves), 1)
    return float(np.sqrt(by_time + (count - 1) / count * float((moves**2).sum())))
