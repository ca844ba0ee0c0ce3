"""Derivatives of forward dynamics by the motion of a floating base, which are known without computing any dynamics.

The position, orientation and linear velocity v of a floating base enter the equations of motion through one vector
only. Along the axes of the base, this vector is a = dv/dt + w x v + R^T up. Here w is the angular velocity, R the
orientation, and up minus gravity. If position, orientation and v change and the torques do not, then a and all other
accelerations stay the same. dv/dt therefore changes by minus the change of w x v + R^T up.
"""

from __future__ import annotations

from collections.abc import Sequence

from psdmc.dynamics.frames import BASE, Frame, from_previous, joint_turn, outward
from psdmc.dynamics.scalar import Matrix, Scalar, Vector
from psdmc.dynamics.slices import positions, rates
from psdmc.robot.joints.joint_type import SLIDES, TURNS

KNOWN_BY_Q, KNOWN_BY_QD = 6, 3
"""Columns of a free root, which comes first, that are known without dynamics."""


def has_free_root(frames: Sequence[Frame]) -> bool:
    """Return whether a floating joint carries the whole robot, with linear and angular rates along the axes of its
    body."""
    return frames[0].joint.twists == (*SLIDES, *TURNS) and all(frame.parent != BASE for frame in frames[1:])


def known_derivatives(
    frames: Sequence[Frame], q: Sequence[Scalar], qd: Sequence[Scalar], up: Vector
) -> tuple[Matrix, Matrix]:
    """Return the derivatives (3 x 3 each) of a floating base's linear acceleration by its orientation and linear
    velocity.

    The accelerations do not depend on the position of the base. The accelerations of all other joint rates do not
    depend on the orientation and linear velocity either.
    """
    root = frames[0]
    turned = outward(joint_turn(root, positions(frames, q)[0]), from_previous(root, up))
    own = rates(frames, qd)[0]
    return _minus_cross(turned), _minus_cross(own[3:])


def _minus_cross(v: Sequence[Scalar]) -> Matrix:
    """The matrix of - v x."""
    x, y, z = v
    return ((0.0, z, -y), (-z, 0.0, x), (y, -x, 0.0))
