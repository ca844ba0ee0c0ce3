"""Combinations of the links' standard parameters on which the joint torques depend: matrix rows that span the torques
at all states. They are computed joint by joint in extended precision.

Consider a combination of link k's parameters whose Lagrangian does not depend on q_k and on its rate. It has no effect
on joint k's torque. If these parameters are moved to the parent link, as if link k were fixed to the parent, no torque
changes.

Let C_k be the rows that joint k's torque has in the parameters of link k. Let T_c move the parameters of a link c to
the parent link, at the position where joint c has not moved. All torques depend on the parameters only through

    C_k z_k,    z_k = x_k + sum of T_c z_c over the child links c of link k

Each C_k has 11 columns and few samples, for robots of any size. Every decision about rank is made on these rows, joint
by joint, relative to that joint's own torque.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from psdmc.dynamics.choices import PLAIN
from psdmc.dynamics.frames import BASE, Frame
from psdmc.dynamics.motion import LinkMotion, sweep_outward
from psdmc.dynamics.parameters import moving_map
from psdmc.dynamics.regressor import Placed, unit_wrench
from psdmc.dynamics.scalar import Scalar, Vector
from psdmc.dynamics.slices import normalized, rates
from psdmc.dynamics.twist import efforts
from psdmc.reproducible import cosine, lengths, sine, times
from psdmc.robot.graded import graded_pivots, halving_shares
from psdmc.robot.mechanism import BODY_PARAMETERS, DRIVE, PARAMETERS_PER_LINK

Long = NDArray[Any]
"""An array of np.longdouble."""

SEED = 20_210_157
STATES = 48
"""Sampled motions, the same for all joints; each joint's torque has at most 11 columns to distinguish."""

EFFECT = 1e-15
"""Smallest effect of a parameter on a joint's torque, beyond that of other parameters, that counts; lengths in the
robot's unit, and relative to the largest effect that a parameter of the link has there. Rounding leaves 1e-18;
evaluating the torque in double leaves as much as this."""


def torque_rows(frames: Sequence[Frame], link_frames: Sequence[Placed], up: Vector) -> Long:
    """Return the (r, 11 n) rows in the standard parameters that span all joint torques, joint by joint. Each joint's
    rows have length one at most.

    r is the number of base parameters of a robot whose standard parameters are not restricted by assumptions.

    link_frames  placements of the link frames, about which the parameters are given, in the joint frames
    up           the base's acceleration against gravity
    """
    n = len(frames)
    own = [echelon_rows(samples) for samples in _own_torques(frames, up)]
    rows = np.zeros((sum(len(part) for part in own), PARAMETERS_PER_LINK * n), np.longdouble)
    carried: list[Long] = []
    places: list[NDArray[np.int64]] = []
    used = 0
    for k, (frame, place, part) in enumerate(zip(frames, link_frames, own, strict=True)):
        fixed = moving_map(_axes_at_rest(frame), np.array(frame.translation, dtype=np.longdouble))
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


def _axes_at_rest(frame: Frame) -> Long:
    """(3, 3): a frame's axes in its parent's where its joint has not moved. Only what slides shows its turn there: about a
    joint that turns, all directions are alike to what its torque does not depend on."""
    s, c = sine(np.longdouble(frame.offset)), cosine(np.longdouble(frame.offset))
    for _ in range(frame.quarters):
        s, c = c, -s
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]], np.longdouble)
    return np.asarray(times(np.array(frame.rotation, np.longdouble), turn))


def _own_torques(frames: Sequence[Frame], up: Vector) -> list[Long]:
    """n of (STATES nv, 11): each joint's torques from its own link's parameters about its own frame, at random motions."""
    nq, nv = (sum(counts) for counts in zip(*((f.joint.nq, f.joint.nv) for f in frames), strict=True))
    drawn = np.random.default_rng(SEED).uniform(-np.pi, np.pi, size=(nq + 2 * nv, STATES))
    drawn = drawn.astype(np.longdouble)
    q, qd, qdd = normalized(frames, drawn[:nq]), drawn[nq : nq + nv], drawn[nq + nv :]
    motions = sweep_outward(frames, list(q), list(qd), None, list(qdd), up, PLAIN).motions
    return [
        _own_torque(frame, motion, acceleration)
        for frame, motion, acceleration in zip(frames, motions, rates(frames, list(qdd)), strict=True)
    ]


def _own_torque(frame: Frame, motion: LinkMotion, acceleration: Scalar) -> Long:
    columns: list[Sequence[Any]] = [efforts(frame.joint, *unit_wrench(name, motion)) for name in range(DRIVE)]
    columns.append((acceleration,) if frame.joint.about_z else (0.0,) * frame.joint.nv)
    rows = [
        np.stack([np.broadcast_to(x, (STATES,)) for x in along], axis=1)
        for along in zip(*columns, strict=True)
    ]
    return np.concatenate(rows).astype(np.longdouble)


def echelon_rows(samples: Long) -> Long:
    """Return (rank, k) rows that span the same space as the sampled rows (m, k). They are scaled so that the longest
    column has length one. Directions shorter than EFFECT are left out."""
    longest = lengths(samples).max(initial=0.0)
    if not longest:
        return samples[:0]
    work = samples / longest
    work[:, lengths(work) <= EFFECT] = 0.0
    pivots, _, _ = graded_pivots(work, np.ones(work.shape[1]), halving_shares(EFFECT))
    return np.asarray(work[: len(pivots)])
