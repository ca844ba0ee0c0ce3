"""The orders in which the expanded lowering takes the rows of E, the matrix of exponents. The order determines the
number of operations."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from psdmc.model.expansion import BLOCKS

Order = tuple[int, ...]
Joints = tuple[int, ...]

TRIGONOMETRY = ((0, 2, 1), (0, 1, 2))
"""Row blocks of one joint's position, outermost first: q, cos, sin and q, sin, cos."""


def base_first(n: int) -> Joints:
    """Return the joint order for torques, from the base outward. The inner parts of the nested forms then depend on the
    outer links only, and recur often."""
    return tuple(range(n))


def tip_first(n: int) -> Joints:
    """Return the joint order for regressors, from the tip inward. A column belongs to one link and does not contain the
    joints after this link."""
    return tuple(reversed(range(n)))


def candidates(joints: Joints, rows: int) -> Iterator[Order]:
    """Return orders of all rows, outermost first, with the joints' positions in the order given.

    Rows of rates are outermost, so that the torques of two joints share polynomials of position; in other orders, they
    are joint by joint. Parameters, the rows from 5 n on, are always innermost.
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
