"""Plausible sizes of the spring and friction values in a linear fit, and inequalities between these values."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from psdmc.calibration.columns.columns import Columns
from psdmc.calibration.columns.effect import Motion
from psdmc.calibration.columns.ways import poses
from psdmc.calibration.identify.coupling import Coupling
from psdmc.calibration.identify.prior import NO_EFFECT, ORDINARY_SPEED, SEED
from psdmc.calibration.logs.log import Array
from psdmc.robot.mechanism import Mechanism


def motion_of(
    q: Array, qd: Array, sign_speed: float, load: Array | None = None, coupling: Coupling | None = None
) -> Motion:
    """Return the motion from which the torques of springs and friction are computed. If several motors drive a joint,
    friction acts on the motors.

    q, qd  (N samples, n joints) positions and speeds
    load   (N, n) torques of the rigid bodies; None if no friction depends on them
    """
    if coupling is None:
        return Motion(q, qd, q, qd, sign_speed, load)
    of_motors = None if load is None else coupling.torque_of_motors(load)
    place, speed = coupling.to_motors(q), coupling.to_motors(qd)
    return Motion(q, qd, place, speed, sign_speed, of_motors, coupling.inverse)


def extra_scale(chain: Mechanism, columns: Columns, sign_speed: float, sizes: Array) -> Array:
    """Return a plausible size (m,) of each of the m unknown values of springs and friction. With this size, the largest
    torque of the value at some joint equals the whole torque of that joint.

    sizes  (n,) N m, typical torques of the n joints
    """
    if not len(columns):
        return np.zeros(0)
    q = poses(chain)
    speeds = np.geomspace(1e-3, 1.0, len(q))[:, None] * ORDINARY_SPEED
    qd = speeds * np.random.default_rng(SEED).choice([-1.0, 1.0], q.shape)
    load = np.broadcast_to(sizes, q.shape)
    effect = np.abs(columns.values(motion_of(q, qd, sign_speed, load))).max(axis=0)
    acts = effect > NO_EFFECT * effect.max(axis=0, initial=0.0)
    scale = np.min(np.where(acts, sizes[:, None] / np.where(acts, effect, 1.0), np.inf), axis=0)
    return np.where(np.isfinite(scale), scale, 1.0)


def limits_of(columns: Columns, plain: Sequence[tuple[str, str]], l: int) -> Array:
    """Return k rows of linear inequalities between the unknowns of a fit, an array (k, l + n f + m). The product of
    each row with the vector of unknowns may not be negative. The rows keep the magnitude of a value below another value
    of its joint.

    The unknowns are l base parameters, f friction values of each of n joints, and m values of springs and further
    friction.

    plain  joint and name of each of the n f friction values
    """
    rows: list[Array] = []
    width = l + len(plain) + len(columns)
    for k, unknown in enumerate(columns.unknowns, start=l + len(plain)):
        if not unknown.within:
            continue
        for sign in (1.0, -1.0):
            row = np.zeros(width)
            row[l + list(plain).index((unknown.owner, unknown.within))], row[k] = 1.0, sign
            rows.append(row)
    return np.reshape(rows, (-1, width))
