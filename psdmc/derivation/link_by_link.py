"""Base parameters link by link, in extended precision: for long chains, and for axes that are nearly parallel.

Link k's parameters leave the torque of joint k at zero in every motion exactly where its Lagrangian depends on neither
q_k nor its rate. Then link k might as well be fixed to its parent, and its parameters, moved there, belong to that link.
So with C_k the rows that joint k's torque has in the parameters of its own link, and T_c those of a link c moved to its
parent at q_c = 0, the torques of all joints depend on the parameters through

    C_k z_k,    z_k = x_k + sum of T_c z_c over the links c that hang on k

and on nothing else: each C_k is 11 columns of a few samples, whatever the length of the chain, and every decision about
rank is made there, joint by joint, against that joint's own torque.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from psdmc.derivation.extended import Long, extended
from psdmc.derivation.reduce import Reduction
from psdmc.derivation.units import Scaled
from psdmc.dynamics.frames import BASE, Frame
from psdmc.dynamics.motion import PLAIN, LinkMotion, sweep_outward
from psdmc.dynamics.parameters import moving_map
from psdmc.dynamics.regressor import unit_wrench
from psdmc.dynamics.twist import effort
from psdmc.robot.graded import graded_pivots, halving_shares, lengths
from psdmc.robot.mechanism import BODY_PARAMETERS, DRIVE, PARAMETERS_PER_LINK
from psdmc.robot.small import times

SEED = 20_210_157
STATES = 48
"""Sampled motions, the same for all joints; each joint's torque has at most 11 columns to distinguish."""

EFFECT = 1e-15
"""Smallest effect of a parameter on a joint's torque, beyond that of other parameters, that counts; lengths in the
robot's unit, and relative to the largest effect that a parameter of the link has there. Rounding leaves 1e-18;
evaluating the torque in double leaves as much as this."""

EXACT = 1e-16
"""Smaller coefficients of the echelon form are zero, lengths in the robot's unit: they add less than the last digit.
Also the share of the longest column below which a column depends on others because of assumed zeros: the longest
column of a long chain has a length of a thousand, and its rounding grows alike."""


def reduction_link_by_link(robot: Scaled) -> Reduction:
    """The base parameters within the span's columns, by graded passes over rows that span the row space and nothing
    more."""
    rows = torque_rows(extended(robot))
    links = robot.leads // PARAMETERS_PER_LINK
    return _reduced(np.asarray((sparse.csr_array(robot.span.T) @ rows.T).T), links)


def torque_rows(robot: Scaled) -> Long:
    """(r, 11 n) rows that span all torques' dependence on the parameters, joint by joint; each joint's rows have length
    one at most.

    r is the number of base parameters of a chain whose parameters are all free. `robot` is in extended precision.
    """
    n = len(robot.types)
    own = [echelon_rows(samples) for samples in _own_torques(robot)]
    rows = np.zeros((sum(len(part) for part in own), PARAMETERS_PER_LINK * n), np.longdouble)
    carried: list[Long] = []
    places: list[NDArray[np.int64]] = []
    used = 0
    for k, (frame, place, part) in enumerate(zip(robot.frames, robot.link_frames, own, strict=True)):
        turned = np.array(frame.rotation, dtype=np.longdouble)
        fixed = moving_map(turned, np.array(frame.translation, dtype=np.longdouble))
        is_first = frame.parent == BASE
        above = np.zeros((0, BODY_PARAMETERS), np.longdouble) if is_first else carried[frame.parent]
        before, own_rows = len(above), np.arange(used, used + len(part))
        used, first = used + len(part), PARAMETERS_PER_LINK * k
        carried.append(np.vstack([times(above, fixed), part[:, :BODY_PARAMETERS]]))
        places.append(own_rows if is_first else np.concatenate([places[frame.parent], own_rows]))
        about_link = moving_map(place.rotation, place.translation)
        rows[places[k], first : first + BODY_PARAMETERS] = times(carried[k], about_link)
        rows[places[k][before:], first + DRIVE] = part[:, DRIVE]
    return rows


def _own_torques(robot: Scaled) -> list[Long]:
    """n of (STATES, 11): each joint's torque from its own link's parameters about its own frame, at random motions."""
    n = len(robot.types)
    drawn = np.random.default_rng(SEED).uniform(-np.pi, np.pi, size=(3, n, STATES)).astype(np.longdouble)
    q, qd, qdd = (list(vector) for vector in drawn)
    motions = sweep_outward(robot.frames, q, qd, None, qdd, robot.up, PLAIN).motions
    return [
        _own_torque(frame, motion, acceleration)
        for frame, motion, acceleration in zip(robot.frames, motions, qdd, strict=True)
    ]


def _own_torque(frame: Frame, motion: LinkMotion, acceleration: Long) -> Long:
    columns: list[Any] = [effort(frame.joint, *unit_wrench(name, motion)) for name in range(DRIVE)]
    samples = [np.broadcast_to(column, (STATES,)) for column in (*columns, acceleration)]
    return np.stack(samples, axis=1).astype(np.longdouble)


def echelon_rows(samples: Long) -> Long:
    """(rank, k) rows with the row space of (m, k) samples, but for directions below EFFECT; the longest column of length
    one."""
    longest = lengths(samples).max(initial=0.0)
    if not longest:
        return samples[:0]
    work = samples / longest
    work[:, lengths(work) <= EFFECT] = 0.0
    pivots, _, _ = graded_pivots(work, np.ones(work.shape[1]), halving_shares(EFFECT))
    return np.asarray(work[: len(pivots)])


def _reduced(rows: Long, links: NDArray[np.int64]) -> Reduction:
    """The base parameters from rows, with residuals compared as they are and not relative to their columns.

    A small column then becomes a pivot late: earlier, its torque would be a large parameter times small numbers, which
    double precision holds with fewer digits. A link's columns come before the next link's, small or not; otherwise a
    parameter of a heavy link could be combined into one of a light link farther out, whose torque would be a small
    difference of large numbers.

    links  (k,) which link each column belongs to
    """
    work = np.array(rows, order="C")
    last = EXACT * max(1.0, float(lengths(work).max(initial=0.0)))
    found, _, _ = graded_pivots(work, np.ones(work.shape[1]), halving_shares(last), links)
    pivots = np.array(found, dtype=np.int64)
    others = np.setdiff1d(np.arange(work.shape[1]), pivots)
    shares = _solved(work[: len(pivots), pivots], work[: len(pivots), others])
    echelon = np.zeros((len(pivots), work.shape[1]))
    echelon[:, pivots] = np.eye(len(pivots))
    echelon[:, others] = np.where(np.abs(shares) < EXACT, 0.0, shares)
    order = np.argsort(pivots)
    return Reduction(pivots[order], echelon[order], False)


def _solved(triangle: Long, right: Long) -> Long:
    """The solution x of triangle @ x = right. Entries below the diagonal of `triangle` (l, l) are not exactly zero but
    rounding, which is nothing in a row of length one and much in a row of 1e-13."""
    solution = right.copy()
    for r in reversed(range(len(triangle))):
        solution[r] /= triangle[r, r]
        above = np.flatnonzero(triangle[:r, r])
        solution[above] -= triangle[above, r, None] * solution[r]
    return solution
