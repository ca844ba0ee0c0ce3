"""Momentum about the centre of mass, its rate, and the derivatives of both."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from psdmc.dynamics.body import Body
from psdmc.dynamics.derivatives import composites, swept, wrenches_of_motions
from psdmc.dynamics.energy import first_moment
from psdmc.dynamics.following import columns_summed, on_coordinates
from psdmc.dynamics.frames import BASE, Frame
from psdmc.dynamics.kinematics import AT_BASE, forward_kinematics
from psdmc.dynamics.scalar import ZERO, Matrix, Scalar, Vector, add, cross, scale, transform
from psdmc.dynamics.slices import first_rates
from psdmc.dynamics.twist import momentum

Wrench = tuple[Vector, Vector]

Rows = Sequence[Sequence[Scalar]]


class RateSlopes(NamedTuple):
    """Derivatives of the momentum's rate, 6 x nv each: by q, along its tangent, by qd and by qdd."""

    by_q: Rows
    by_qd: Rows
    by_qdd: Rows


def about_centre(
    frames: Sequence[Frame], bodies: Sequence[Body], q: Sequence[Scalar], moved: Wrench
) -> Wrench:
    """Convert a momentum, or its rate, from the origin of the first joint frame to the bodies' centre of mass. The bodies
    must be the real ones."""
    linear, angular = moved
    centre = scale(first_moment(frames, bodies, q), 1.0 / _mass(bodies))
    return linear, add(angular, cross(linear, centre))


def _mass(bodies: Sequence[Body]) -> Scalar:
    return sum(body.mass for body in bodies)


def _summed(frames: Sequence[Frame], found: RateSlopes) -> RateSlopes:
    return RateSlopes(*(columns_summed(frames, block) for block in found))


@on_coordinates(_summed)
def momentum_rate_slopes(
    frames: Sequence[Frame],
    bodies: Sequence[Body],
    q: Sequence[Scalar],
    qd: Sequence[Scalar],
    qdd: Sequence[Scalar],
) -> RateSlopes:
    """Compute the derivatives of the rates of the bodies' linear momentum, and of their angular momentum about the centre
    of mass. Components are along the axes that the first joint frame turns from. The bodies must be the real ones.

    The rate is A qdd + dA/dt qd with the centroidal momentum matrix A. At qd = 0, with rates in the place of qdd, the rate
    is therefore the momentum at these rates, and the derivatives are those of the momentum.

    A joint's motion requires a wrench on the bodies beyond the joint (derivatives.py); the momentum of other bodies does
    not change. By q the centre of mass c moves too, so that c x force changes."""
    moving = swept(frames, q, qd, qdd, ZERO)
    carried = composites(moving, bodies)
    share, placed = 1.0 / _mass(bodies), forward_kinematics(frames, q)
    force = centre = ZERO
    for i, composite in carried:
        if frames[i].parent == BASE:
            body, step = composite.body, moving.steps[i]
            force = add(force, step.to_link(composite.wrench[0]))
            moved = add(step.to_link(body.moment), scale(step.offset, body.mass))
            centre = add(centre, scale(moved, share))
    first = first_rates(frames)
    blocks: list[list[tuple[Scalar, ...]]] = [[()] * first[-1] for _ in range(3)]
    for i, composite in carried:
        frame, step = frames[i], moving.steps[i]
        axes_of, origin = AT_BASE if frame.parent == BASE else placed[frame.parent]
        before = axes_of, add(origin, scale(centre, -1.0))
        required = wrenches_of_motions(frame, moving.axes[i], composite, moving.qd[i])
        for k, (by_q, by_qd), twist in zip(
            range(first[i], first[-1]), required, frame.joint.twists, strict=False
        ):
            wrenches = (by_q, by_qd, momentum(composite.body, twist))
            by_q, by_qd, by_qdd = (_placed(step.to_parent(each), before) for each in wrenches)
            shifted = by_q[0], add(by_q[1], cross(force, scale(by_qdd[0], share)))
            for block, (linear, angular) in zip(blocks, (shifted, by_qd, by_qdd), strict=True):
                block[k] = (*linear, *angular)
    return RateSlopes(*(tuple(zip(*block, strict=True)) for block in blocks))


def _placed(wrench: Wrench, frame: tuple[Matrix, Vector]) -> Wrench:
    """Convert a wrench from a frame to the axes and the origin in which the frame is given."""
    rotation, origin = frame
    force = transform(rotation, wrench[0])
    return force, add(transform(rotation, wrench[1]), cross(origin, force))
