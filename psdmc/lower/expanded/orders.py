"""In which order the expanded lowering takes the rows."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

Order = tuple[int, ...]
Joints = tuple[int, ...]

TRIGONOMETRY = ((0, 2, 1), (0, 1, 2))
"""Row blocks of one joint's position, outermost first: q, cos, sin and q, sin, cos."""


def base_first(n: int) -> Joints:
    """For torques: what stands inside is about the outer links only, and recurs often."""
    return tuple(range(n))


def tip_first(n: int) -> Joints:
    """For regressors: a column, which is about one link, does not contain the joints further out."""
    return tuple(reversed(range(n)))


def candidates(joints: Joints, rows: int) -> Iterator[Order]:
    """Orders of all rows, outermost first, with the joints' positions taken in the order given.

    Rates go outermost, where the torques of two joints meet in the same polynomials of position, or joint by
    joint. Parameters, the rows from 5 n on, stay innermost.
    """
    n = len(joints)
    parameters = tuple(range(5 * n, rows))
    for blocks in TRIGONOMETRY:
        position = _by_joint(joints, blocks, n)
        for rates in (joints[::-1], joints):
            yield _by_block(rates, (4, 3), n) + position + parameters
        yield _by_joint(joints, (4, 3, *blocks), n) + parameters


def _by_joint(joints: Sequence[int], blocks: Sequence[int], n: int) -> Order:
    return tuple(block * n + joint for joint in joints for block in blocks)


def _by_block(joints: Sequence[int], blocks: Sequence[int], n: int) -> Order:
    return tuple(block * n + joint for block in blocks for joint in joints)
