"""The regressor Y for a calibration, with torques Y theta_b for the base parameters theta_b.

A compiled robot can compute the regressor. Without a compiler, this module computes it in NumPy.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np

from psdmc.calibration.logs.log import Array
from psdmc.dynamics.frames import base_acceleration, frames_of
from psdmc.dynamics.kinematics import frame_placement, jacobian
from psdmc.dynamics.regressor import regressor
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.robot.mechanism import Mechanism


class Regressor(Protocol):
    """An object that computes the regressor Y (..., n, l) of n joints at states q, qd, qdd (..., n).

    The joint torques are tau = Y theta_b with l base parameters theta_b. The result of psdmc.compile(model) is a fast
    Regressor.
    """

    def regressor(self, q: Array, qd: Array, qdd: Array) -> Array: ...


IN_CACHE = 1024
"""States whose regressors are filled at once, so that they stay in the cache."""


class ChainRegressor:
    """The regressor of a model, computed in NumPy by the Newton-Euler recursion. It needs no compiler."""

    def __init__(self, model: DynamicsModel) -> None:
        chain = model.mechanism
        self._frames = frames_of(chain)
        self._link_frames = [joint.link_frame for joint in chain.joints]
        self._base = base_acceleration(chain)
        self._shape = (chain.nv, model.l)
        expand = expansion(model)
        self._wanted = [int(k) for k in np.flatnonzero(np.abs(expand).any(axis=1))]
        self._factors = {
            j: [(int(k), float(expand[j, k])) for k in np.flatnonzero(expand[j])] for j in self._wanted
        }

    def regressor(self, q: Array, qd: Array, qdd: Array) -> Array:
        q, qd, qdd = (np.moveaxis(np.asarray(a, dtype=np.float64), -1, 0) for a in (q, qd, qdd))
        rows = regressor(
            self._frames, self._link_frames, self._wanted, list(q), list(qd), list(qdd), self._base
        )
        out = np.zeros((q[0].size, *self._shape))
        terms = [
            (i, k, factor, np.broadcast_to(value, q.shape[1:]).reshape(-1))
            for i, row in enumerate(rows)
            for j, value in row.items()
            for k, factor in self._factors[j]
        ]
        for first in range(0, len(out), IN_CACHE):
            part = slice(first, first + IN_CACHE)
            for i, k, factor, values in terms:
                out[part, i, k] += values[part] if factor == 1.0 else factor * values[part]
        return out.reshape(*q.shape[1:], *self._shape)


def expansion(model: DynamicsModel) -> Array:
    """Return a matrix (11 n, l) that computes possible standard parameters x from base parameters theta_b.

    The product of B, with theta_b = B x, and this matrix is the identity. The standard parameters keep the model's
    assumptions, such as parameters that are zero. If B is in echelon form, most standard parameters are zero.
    """
    span = model.mechanism.parameter_span
    reduced = model.B @ span
    columns: list[int] = []
    for i in range(model.l):
        unit = np.eye(model.l)[i]
        found = np.flatnonzero(np.abs(reduced - unit[:, None]).max(axis=0) < 1e-12)
        if not len(found):
            return np.asarray(span @ np.linalg.pinv(reduced))
        columns.append(int(found[0]))
    return np.asarray(span[:, columns])


def gravity_regressor(model: Regressor, q: Array) -> Array:
    """Return the regressor Y_grav (..., n, l) of gravity torques alone, at positions q (..., n) of n joints.

    The gravity torques are Y_grav theta_b for the l base parameters theta_b.
    """
    still = np.zeros_like(q)
    return model.regressor(q, still, still)


def payload_torque(chain: Mechanism, q: Array, mass: float, com: tuple[float, float, float]) -> Array:
    """Return the joint torques (N, n), N m, that hold a load's weight at N poses q (N, n).

    These are -J^T f with the weight f, (17) in Denso-2022.

    mass  kg
    com   m, centre of mass in the tip frame
    """
    frames = frames_of(chain)
    states = [q[:, k] for k in range(chain.nv)]
    rotation, _ = frame_placement(frames, chain.tip_body, chain.tip, states)
    arm = [sum(rotation[r][c] * com[c] for c in range(3)) for r in range(3)]
    weight = (mass * chain.gravity).tolist()
    moment = (
        arm[1] * weight[2] - arm[2] * weight[1],
        arm[2] * weight[0] - arm[0] * weight[2],
        arm[0] * weight[1] - arm[1] * weight[0],
    )
    rows = jacobian(frames, chain.tip_body, chain.tip, states)
    torque = np.zeros_like(q)
    for row, component in zip(rows, (*weight, *moment), strict=True):
        for k, entry in enumerate(row):
            torque[:, k] -= entry * component
    return torque
