"""In which order the expanded lowering takes the rows: candidates, compared by operations."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from psdmc.lower.expanded_diagram import Diagram, nested_horner, operations
from psdmc.lower.expanded_terms import Terms

Order = tuple[int, ...]

TRIGONOMETRY = ((0, 2, 1), (0, 1, 2))
"""Row blocks of one joint's position, outermost first: q, cos, sin and q, sin, cos."""


def cheapest(terms: Terms, n: int) -> Diagram:
    """The diagram with fewest multiplications and additions over all candidates; the first of equals."""
    return min((nested_horner(terms, order) for order in candidates(terms, n)), key=_total)


def _total(diagram: Diagram) -> int:
    return sum(operations(diagram))


def candidates(terms: Terms, n: int) -> Iterator[Order]:
    """Orders of rows, outermost first.

    Parameters (rows from 5 n on) stay innermost. Rates go outermost, where the torques of two joints meet in
    the same polynomials of position, or joint by joint; joints go base first, so that what stands inside is
    about the outer links only and recurs often, or tip first.
    """
    parameters = tuple(range(5 * n, len(terms.exponents)))
    up, down = tuple(range(n)), tuple(reversed(range(n)))
    for joints in (up, down):
        for blocks in TRIGONOMETRY:
            position = _by_joint(joints, blocks, n)
            for rates in (up, down):
                yield _by_block(rates, (4, 3), n) + position + parameters
            yield _by_joint(joints, (4, 3, *blocks), n) + parameters


def _by_joint(joints: Sequence[int], blocks: Sequence[int], n: int) -> Order:
    return tuple(block * n + joint for joint in joints for block in blocks)


def _by_block(joints: Sequence[int], blocks: Sequence[int], n: int) -> Order:
    return tuple(block * n + joint for block in blocks for joint in joints)
