"""The orders in which the expanded lowering (code from polynomials) takes the variables, the rows of E. The order
determines the number of operations."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from psdmc.model.expansion import BLOCKS

Order = tuple[int, ...]
Joints = tuple[int, ...]

TRIGONOMETRY = ((0, 2, 1), (0, 1, 2))
"""Row blocks of one joint's position, outermost first: q, cos, sin and q, sin, cos."""


def base_first(n: int) -> Joints:
    """Return the order of joints for torques, from the base outward. The inner parts of the nested forms then depend on
    the outer links only, and recur often."""
    return tuple(range(n))


def tip_first(n: int) -> Joints:
    """Return the order of joints for regressors, from the tip inward. A regressor column belongs to one link, and
    joints after this link do not occur in it."""
    return tuple(reversed(range(n)))


def candidates(joints: Joints, rows: int) -> Iterator[Order]:
    """Return orders of all variables (rows of the exponents), outermost first. Joint positions are in the given order
    of joints.

    In most orders, joint rates and accelerations are outermost, so that the torques of two joints share polynomials of
    position. In the other orders, all variables of a joint stand together. Base parameters, the rows from 5 n on, are
    always innermost.

    rows  number of rows
    """
    n = len(joints)
    parameters = tuple(range(BLOCKS * n, rows))
    for blocks in TRIGONOMETRY:
        position = _by_joint(joints, blocks, n)
        for rates in (joints[::-1], joints):
            yield _by_block(rates, (4, 3), n) + position + parameters
        yield _by_joint(joints, (4, 3, *blocks), n) + parameters


def _by_joint(joints: Sequence[int], blocks: Sequence[int], n: int) -> Order:
    return tuple(block * n + joint for joint in joints for block in blocks)


def _by_block(joints: Sequence[int], blocks: Sequence[int], n: int) -> Order:
    return tuple(block * n + joint for block in blocks for joint in joints)
