"""Computes an upper bound of the change of torques by snapping, which replaces rotations by near ones with exact zeros.
The bound is computed with Pinocchio's model of the original file.

Each snapped angle is applied to Pinocchio's model in every direction that it could affect. The sum of the changes of
the torques is a bound to first order.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np
import pinocchio

from psdmc.robot.draft import BASE, Snap
from psdmc.robot.mechanism import Array
from psdmc.robot.reference import Reference

MARGIN = 2.0
"""Factor for terms of second order in the angles, up to --snap 0.1."""


def angles_by_segment(snaps: Sequence[Snap], n: int, largest: float) -> Array:
    """Return the snapped angles, summed for each section of the robot, rad (n + 2,). The sections are before each joint
    (0 to n - 1), before the tip (n), and from root to base (last).

    largest   rad: each single angle counts at most this much
    """
    angles = np.zeros(n + 2)
    for snap in snaps:
        angles[n + 1 if snap.segment == BASE else snap.segment] += min(snap.angle, largest)
    return angles


def torque_bound(reference: Reference, angles: Array, q: Array, qd: Array, qdd: Array) -> Array:
    """Return an upper bound (n,) of the change of each joint's torque by snapped rotations, N m (N). The bound covers
    all k states q, qd, qdd (k, n).

    angles   (n + 2,) rad, as from angles_by_segment
    """
    exact = reference.inverse_dynamics(q, qd, qdd)
    change = np.zeros_like(exact)
    for disturb, motion in _disturbances(reference, angles):
        other = reference.model.copy()
        disturb(other, motion)
        change += np.abs(Reference(other, reference.tip_name).inverse_dynamics(q, qd, qdd) - exact)
    return np.asarray(MARGIN * change.max(axis=0))


Disturbance = Callable[[pinocchio.Model, pinocchio.SE3], None]


def _disturbances(reference: Reference, angles: Array) -> Iterator[tuple[Disturbance, pinocchio.SE3]]:
    """Small motions of a joint in its parent, of a body on its joint with all that follows, and of gravity."""
    n, reach = reference.model.njoints - 1, reference.path_length
    for k, angle in enumerate(angles[:n], start=1):
        if angle > 0.0:
            for motion in _motions(angle, reach):
                yield _moved_joint(k), motion
                yield _moved_link(k), motion
    if angles[n + 1] > 0.0:
        for motion in _motions(angles[n + 1], 0.0)[:3]:
            yield _turned_gravity, motion


def _motions(angle: float, reach: float) -> list[pinocchio.SE3]:
    """Turns by the angle about each axis, and shifts along each by the displacement of a point `reach` away."""
    turns = [pinocchio.SE3(pinocchio.exp3(angle * axis), np.zeros(3)) for axis in np.eye(3)]
    return turns + [pinocchio.SE3(np.eye(3), angle * reach * axis) for axis in np.eye(3)]


def _moved_joint(k: int) -> Disturbance:
    def disturb(model: pinocchio.Model, motion: pinocchio.SE3) -> None:
        model.jointPlacements[k] = model.jointPlacements[k] * motion

    return disturb


def _moved_link(k: int) -> Disturbance:
    def disturb(model: pinocchio.Model, motion: pinocchio.SE3) -> None:
        model.inertias[k] = motion.act(model.inertias[k])
        for child in range(k + 1, model.njoints):
            if model.parents[child] == k:
                model.jointPlacements[child] = motion * model.jointPlacements[child]

    return disturb


def _turned_gravity(model: pinocchio.Model, motion: pinocchio.SE3) -> None:
    model.gravity.linear = motion.rotation @ model.gravity.linear
