"""Choices in the arrangement of the recursions. They change the number of operations, but not the result."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Choices:
    """The arrangement of a recursion. w and dw are a body's angular velocity and its derivative; a body's point at r
    accelerates with a + U r.

    compound           consecutive parallel axes rotate w and dw once, by the sum of their angles, from the frame before the
                       first
    fold               a leaf (a body that carries no other) is described in the frame before its joint's rotation, where U
                       differs from its parent's in six entries only; the body's parameters are rotated instead
    fold_double_angle  a folded body's second moments are rotated with a separate sincos(2 q), not with products of sincos(q)
    add_sines          the sine and cosine of a sum of angles are computed from those of its parts
    articulated        accelerations are computed by articulated bodies, not by a factorized mass matrix
    """

    compound: bool = False
    fold: bool = False
    fold_double_angle: bool = False
    add_sines: bool = False
    articulated: bool = False


PLAIN = Choices()
