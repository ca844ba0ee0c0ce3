"""How the recursions are arranged: choices that change the number of operations, but not the result."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Choices:
    """The arrangement of a recursion; w, dw and U are those of motion.py.

    compound           consecutive parallel axes turn w and dw once, by the sum of their angles, from the frame before the
                       first
    fold               a leaf (a body that carries no other) is described in the frame before its joint's turn, where U
                       differs from its parent's in six entries only; the body's parameters are turned instead
    fold_double_angle  a folded body's second moments are turned by a sincos(2 q) of their own, not by products of sincos(q)
    add_sines          a compound turn's sincos is made from those of its parts, not by a sincos of the sum
    articulated        accelerations are found by articulated bodies, not by a factorized mass matrix
    """

    compound: bool = False
    fold: bool = False
    fold_double_angle: bool = False
    add_sines: bool = False
    articulated: bool = False


PLAIN = Choices()
