"""The orders in which the expanded lowering takes the rows of E."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from psdmc.model.expansion import BLOCKS

Order = tuple[int, ...]
Joints = tuple[int, ...]

TRIGONOMETRY = ((0, 2, 1), (0, 1, 2))
"""Row blocks of one joint's position, outermost first: q, cos, sin and q, sin, cos."""


def base_first(n: int) -> Joints:
    """Joint order for torques, from the base outward: the inner parts of the nested forms then depend on the outer
    links only, and recur often."""
    return tuple(range(n))


def tip_first(n: int) -> Joints:
    """Joint order for regressors, from the tip inward: a column is about one link and does not contain the joints
    beyond it."""
    return tuple(reversed(range(n)))


def candidates(joints: Joints, rows: int) -> Iterator[Order]:
    """Orders of all rows, outermost first, with the joints' positions in the order given.

    Rates stand outermost, where the torques of two joints share polynomials of position, or joint by joint. Parameters,
    the rows from 5 n on, stay innermost.
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
