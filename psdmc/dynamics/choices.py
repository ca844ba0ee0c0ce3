"""Options for the arrangement of the recursions. They change the number of operations, but not the result."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Choices:
    """Options for the arrangement of the Newton-Euler recursion and of forward dynamics.

    w and dw are a body's angular velocity and its derivative. A point of the body at r accelerates with a + U r.

    compound           consecutive joints with parallel axes rotate w and dw once, by the sum of their angles
    fold               a body that carries no other is described in the frame before its joint's rotation. There U
                       differs from its parent's in six entries only; the body's parameters are rotated instead
    fold_double_angle  second moments of such a body are rotated with a separate sincos(2 q), not with products of
                       sincos(q)
    add_sines          the sine and cosine of a sum of angles are computed from those of the angles
    articulated        accelerations are computed by articulated bodies, not by a factorized mass matrix
    """

    compound: bool = False
    fold: bool = False
    fold_double_angle: bool = False
    add_sines: bool = False
    articulated: bool = False


PLAIN = Choices()
