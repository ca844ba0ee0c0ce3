"""A re-implementation of the estimators that FloBaRoID publishes, for a comparison. It is not FloBaRoID.

FloBaRoID (https://github.com/kjyv/FloBaRoID, LGPL 3.0) is not in the Python package index. This file was written from
its README, its tutorial and the comments and values of its configuration kuka_lwr4.yaml, and from the papers that they
name. No code of FloBaRoID was read or copied.

What is as there: the median filter and the zero-phase low passes with their values; base parameters from the QR
decomposition of 5000 random states with the tolerance 1e-4; friction as a sign and a viscous part; weighted least
squares; essential parameters (Pham and Gautier 2013); and the constrained problem (Sousa and Cortesao 2014) in two
steps, first the fit, then the nearest parameters to the robot file with the same fit.

What differs: columns for drive inertia and offset, so that all programs have the same unknowns; no limits on masses
and on centres of mass, which a user writes for each robot; Clarabel in the place of DSDP.

python flobaroid.py URDF LOG.npz OUT.json --method wls|essential|sdp
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pinocchio as pin
from scipy import linalg, signal

Array = npt.NDArray[np.float64]

MEDIAN = 11
"""Rows of the median filter (filterMedianSize)."""
POSITION_LOW_PASS = (8.0, 5)
"""Hz and order, of positions and torques (filterLowPass1)."""
VELOCITY_LOW_PASS = (6.0, 5)
"""Hz and order (filterLowPass2)."""
EDGE = 0.5
"""s at both ends of a log that the fit leaves out, because the filters have transients there."""
RANDOM_STATES = 5000
TOLERANCE = 1e-4
"""Of the diagonal of R: below it, a column depends on the others (minTol)."""
RATIO = 30.0
"""Largest over smallest relative standard deviation of essential parameters (Pham and Gautier: 10 to 30)."""
SMALLEST_MASS = 1e-3
"""kg."""
LINK = 10
"""Parameters of a link in Pinocchio's order: m, m c (3), then xx, xy, yy, xz, yz, zz of the inertia in the frame."""


@dataclass(frozen=True, slots=True)
class Base:
    """Base parameters: standard parameters `kept`, to each of which `folded` (b, s) adds the others."""

    kept: npt.NDArray[np.int_]
    fold: Array


@dataclass(frozen=True, slots=True)
class Data:
    """The rows of the fit, joint after joint: regressor (N n, s), torques (N n,), joints n, and the file's parameters."""

    regressor: Array
    torque: Array
    joints: int
    file: Array


def low_pass(values: Array, rate: float, setting: tuple[float, int]) -> Array:
    """The values without what is faster, without a delay."""
    b, a = signal.butter(setting[1], setting[0] / (rate / 2))
    return np.asarray(signal.filtfilt(b, a, values, axis=0))


def states_of(time: Array, position: Array, torque: Array) -> tuple[Array, Array, Array, Array]:
    """Filtered positions, rates, accelerations and torques, without EDGE at both ends."""
    step = float(np.median(np.diff(time)))
    clean = [signal.medfilt(x, (MEDIAN, 1)) for x in (position, torque)]
    q, tau = (low_pass(x, 1 / step, POSITION_LOW_PASS) for x in clean)
    qd = low_pass(np.gradient(q, step, axis=0), 1 / step, VELOCITY_LOW_PASS)
    qdd = np.gradient(qd, step, axis=0)
    inner = slice(round(EDGE / step), len(time) - round(EDGE / step))
    return q[inner], qd[inner], qdd[inner], tau[inner]


def regressor(model: Any, q: Array, qd: Array, qdd: Array) -> Array:
    """(N n, 10 n + 4 n) joint after joint: links, then drive inertias, Coulomb, viscous friction and offsets."""
    n, data = model.nv, model.createData()
    links = np.array(
        [pin.computeJointTorqueRegressor(model, data, *state) for state in zip(q, qd, qdd, strict=True)]
    )
    own = np.zeros((len(q), n, 4 * n))
    for k in range(n):
        columns = (qdd[:, k], np.sign(qd[:, k]), qd[:, k], np.ones(len(q)))
        for block, column in enumerate(columns):
            own[:, k, block * n + k] = column
    return np.concatenate([links, own], axis=2).transpose(1, 0, 2).reshape(n * len(q), -1)


def file_parameters(model: Any) -> Array:
    """(14 n,) parameters of the robot file; no drive inertia, friction and offset."""
    links = [model.inertias[k].toDynamicParameters() for k in range(1, model.njoints)]
    return np.concatenate([*links, np.zeros(4 * model.nv)])


def structural_base(model: Any, seed: int = 0) -> Base:
    """Base parameters by QR with pivots, of the regressor of random states."""
    rng = np.random.default_rng(seed)
    q, qd, qdd = (rng.uniform(-np.pi, np.pi, (RANDOM_STATES, model.nv)) for _ in range(3))
    r, order = linalg.qr(regressor(model, q, qd, qdd), mode="r", pivoting=True)
    rank = int(np.sum(np.abs(np.diag(r)) > TOLERANCE))
    fold = np.zeros((rank, len(order)))
    fold[:, order] = np.hstack([np.eye(rank), linalg.solve_triangular(r[:rank, :rank], r[:rank, rank:])])
    return Base(order[:rank], fold)


def joint_weights(residual: Array, torque: Array, joints: int) -> Array:
    """(N n,) one over the standard deviation of each joint's residual, which weights its rows. Rows without a residual
    (noiseless data) keep the weight one."""
    if float(np.linalg.norm(residual)) <= 1e-9 * float(np.linalg.norm(torque)):
        return np.ones(len(residual))
    deviation = residual.reshape(joints, -1).std(axis=1)
    return np.repeat(1.0 / deviation, len(residual) // joints)


def weighted_triangle(columns: Array, torque: Array, joints: int) -> Array:
    """The triangle R of a QR decomposition of the weighted columns and the weighted torques (last column). It has the
    least-squares solutions of all subsets of columns. The weights come from an unweighted fit."""
    first = np.linalg.lstsq(columns, torque, rcond=None)[0]
    weights = joint_weights(torque - columns @ first, torque, joints)
    return np.asarray(np.linalg.qr(np.column_stack([columns, torque]) * weights[:, None], mode="r"))


def solved(triangle: Array, subset: npt.NDArray[np.int_], rows: int) -> tuple[Array, Array]:
    """Least squares with a subset of columns: the solution and its standard deviations."""
    columns, torque = triangle[:, subset], triangle[:, -1]
    found = np.linalg.lstsq(columns, torque, rcond=None)[0]
    left = torque - columns @ found
    variance = float(left @ left) / (rows - len(subset))
    return found, np.sqrt(variance * np.diag(np.linalg.inv(columns.T @ columns)))


def wls(data: Data, base: Base) -> Array:
    """Base parameters by weighted least squares; zero for the parameters that they contain."""
    triangle = weighted_triangle(data.regressor[:, base.kept], data.torque, data.joints)
    x = np.zeros(len(data.file))
    x[base.kept] = solved(triangle, np.arange(len(base.kept)), len(data.torque))[0]
    return x


def essential(data: Data, base: Base) -> Array:
    """The file's parameters, with those base parameters changed that the data determine well (Pham and Gautier 2013).

    The fit is of the difference to the file. The worst relative standard deviation goes until the largest is at most
    RATIO times the smallest.
    """
    difference = data.torque - data.regressor @ data.file
    triangle = weighted_triangle(data.regressor[:, base.kept], difference, data.joints)
    of_file = base.fold @ data.file
    kept = np.arange(len(base.kept))
    while True:
        found, deviation = solved(triangle, kept, len(difference))
        relative = deviation / np.maximum(np.abs(found + of_file[kept]), 1e-12)
        if len(kept) == 1 or relative.max() <= RATIO * relative.min():
            break
        kept = np.delete(kept, int(relative.argmax()))
    x = data.file.copy()
    x[base.kept[kept]] += found
    return x


def sdp(data: Data, base: Base) -> Array:
    """Parameters of real bodies with the best weighted fit; of those with this fit, the nearest to the file's."""
    import cvxpy as cp

    triangle = weighted_triangle(data.regressor[:, base.kept], data.torque, data.joints)
    triangle /= np.abs(triangle[:, :-1]).max()
    x = cp.Variable(len(data.file))
    bodies = [_is_body(x[LINK * k : LINK * (k + 1)]) for k in range(data.joints)]
    masses = [x[LINK * k] >= SMALLEST_MASS for k in range(data.joints)]
    own = LINK * data.joints
    constraints = [*bodies, *masses, x[own : own + 3 * data.joints] >= 0]
    misfit = triangle[:-1, :-1] @ (base.fold @ x) - triangle[:-1, -1]
    cp.Problem(cp.Minimize(cp.sum_squares(misfit)), constraints).solve(solver=cp.CLARABEL)
    first = np.asarray(x.value)
    nearest = cp.sum_squares(x[:own] - data.file[:own])
    problem = cp.Problem(cp.Minimize(nearest), [*constraints, base.fold @ x == base.fold @ first])
    try:
        problem.solve(solver=cp.CLARABEL)
    except cp.SolverError:
        return first  # best fits at a bound leave the second step no room; the base parameters are the same
    return first if x.value is None else np.asarray(x.value)


def _is_body(p: Any) -> Any:
    import cvxpy as cp

    return cp.bmat(body_matrix(p)) >> 0


def body_matrix(p: Any) -> list[list[Any]]:
    """The 6 x 6 matrix [[L, S(l)'], [S(l), m 1]] of Sousa and Cortesao, which is positive semidefinite for bodies. L is
    the inertia in the frame, and l is the mass times the centre of mass."""
    m, lx, ly, lz, xx, xy, yy, xz, yz, zz = (p[k] for k in range(LINK))
    return [
        [xx, xy, xz, 0, lz, -ly],
        [xy, yy, yz, -lz, 0, lx],
        [xz, yz, zz, ly, -lx, 0],
        [0, -lz, ly, m, 0, 0],
        [lz, 0, -lx, 0, m, 0],
        [-ly, lx, 0, 0, 0, m],
    ]


METHODS: Mapping[str, Callable[[Data, Base], Array]] = {"wls": wls, "essential": essential, "sdp": sdp}


def identified(model: Any, states: tuple[Array, Array, Array, Array], method: str) -> Array:
    """(14 n,) parameters by a method, from filtered states and torques (N, n)."""
    q, qd, qdd, tau = states
    data = Data(regressor(model, q, qd, qdd), tau.T.ravel(), model.nv, file_parameters(model))
    return METHODS[method](data, structural_base(model))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("urdf", type=Path)
    parser.add_argument("log", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("--method", choices=sorted(METHODS), default="sdp")
    options = parser.parse_args()
    model = pin.buildModelFromUrdf(str(options.urdf))
    with np.load(options.log) as log:
        states = states_of(log["time"], log["position"], log["torque"])
    x = identified(model, states, options.method)
    n = model.nv
    blocks = {"drive_inertia": 0, "coulomb": 1, "viscous": 2, "offset": 3}
    told = {name: x[(LINK + k) * n : (LINK + 1 + k) * n].tolist() for name, k in blocks.items()}
    options.out.write_text(json.dumps({"standard": x[: LINK * n].tolist(), **told}), encoding="utf-8")


if __name__ == "__main__":
    main()
