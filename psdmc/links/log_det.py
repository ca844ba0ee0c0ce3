"""Finds the symmetric matrices P(z) nearest to given matrices among all positive definite ones. They depend linearly on
parameters z.

    minimise the sum over blocks of  weight (tr(N P(z)) - log det P(z)),  P(z) = constant + sum of z_k slopes_k

Each block is one matrix P, for example of one link. N is the inverse of the given matrix that P should be near to. The
problem is convex, and -log det P keeps every step within the positive definite matrices. Newton's method does not
depend on the units of z or P and reaches rounding accuracy. Conic solvers stop at 1e-8 or fail if links of a gram and
of ten kilograms occur together. Source: Boyd, Vandenberghe 2004, chapters 9 and 11.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from psdmc.robot.mechanism import Array

MOST_STEPS = 200
"""Newton steps of one minimisation; tens are usual."""
SETTLED = 1e-20
"""Square of Newton's decrement, twice what a further step would win, at which the minimum is reached."""
ROUND = 0.1
"""Smallest entry of a rounder diagonal beside its largest."""
INSIDE = 0.999
"""Share of the way to the boundary that a step may go."""
LONGEST = 1e3
"""Longest step, in Newton steps."""
HALVINGS = 50
"""Of the interval in which a step's share lies."""
SHARPER = 10.0
"""Factor between successive weights of the distance from feasibility."""
CERTAIN = 1e4
"""A shift this many times larger than the duality gap leaves, were the blocks what they should resemble, is needed: blocks
without it would have to be ten thousand times as large."""
MARGIN = 1e-13
"""Shift, as a share of the first, at which blocks that are still not positive definite count as not feasible."""


@dataclass(frozen=True, slots=True, eq=False)
class Block:
    """One symmetric matrix that depends linearly on z: P(z) = constant + sum of z_k slopes_k.

    constant  (m, m)
    slopes    (k, m, m)  derivatives of P by the k entries of z
    near      (m, m)  the matrix that P should be near to
    weight    factor of the distance between P and `near`
    """

    constant: Array
    slopes: Array
    near: Array
    weight: float

    def at(self, z: Array) -> Array:
        return np.asarray(self.constant + np.einsum("k,kij->ij", z, self.slopes))


def nearest_definite(blocks: Sequence[Block], z: Array) -> Array | None:
    """Return the z (k,) for which the blocks are positive definite and nearest to their given matrices. Newton's method
    starts from the given z. Return None if no z makes all blocks positive definite."""
    found = feasible_point(blocks, z)
    if found is None:
        return None
    pull = _pull(blocks)
    share = min(1.0, sum(len(block.near) for block in blocks) / max(_likeness(blocks, found), 1.0))
    while (
        share < 1.0
    ):  # along the central path: far from what blocks should resemble, the boundary is in the way
        found = _minimised(blocks, share * pull, found)
        share = min(1.0, SHARPER * share)
    return _minimised(blocks, pull, found)


def feasible_point(blocks: Sequence[Block], z: Array) -> Array | None:
    """Return some z (k,) that makes all blocks positive definite; None if there is none.

    The search adds s times a positive definite matrix to each block. It makes s smaller, until the blocks are positive
    definite without this addition.
    """
    if _are_definite(blocks, z):
        return z
    rounder = [_rounder(block) for block in blocks]
    shifted = [replace(block, slopes=np.concatenate([block.slopes, block.near[None]])) for block in rounder]
    first = 2.0 * max(_shift(block, z) for block in rounder)
    # Another block keeps the shift above -first, or it might have no least value.
    slopes = np.append(np.zeros(len(z)), 1.0).reshape(-1, 1, 1)
    shifted.append(Block(np.array([[first]]), slopes, np.array([[first]]), 1.0))
    point, pull = np.append(z, first), _pull(shifted)
    sharpness, size = 1.0 / first, sum(len(block.near) for block in shifted)
    while size / sharpness > MARGIN * first:
        weight = np.append(np.zeros(len(z)), sharpness)
        point = _minimised(shifted, pull + weight, point, lambda at: _are_definite(blocks, at[:-1]))
        if _are_definite(blocks, point[:-1]):
            return point[:-1]
        if point[-1] > CERTAIN * (size + _likeness(shifted, point)) / sharpness:
            return None
        sharpness *= SHARPER
    return None


def _likeness(blocks: Sequence[Block], z: Array) -> float:
    """The sum of tr(N P): the number of rows where all blocks are what they should resemble."""
    return sum(float(np.trace(np.linalg.solve(block.near, block.at(z)))) for block in blocks)


def _rounder(block: Block) -> Block:
    """Return the block with a diagonal to resemble, none of whose entries is small beside the others. A thin one would leave
    no digits for the shift."""
    diagonal = np.diag(block.near)
    return replace(block, near=np.diag(np.maximum(diagonal, ROUND * diagonal.max())), weight=1.0)


def _pull(blocks: Sequence[Block]) -> Array:
    """(k,) the slopes of the sum of weight tr(N P)."""
    total = np.zeros(blocks[0].slopes.shape[0] if blocks else 0)
    for block in blocks:
        total += block.weight * np.einsum("ij,kji->k", np.linalg.inv(block.near), block.slopes)
    return total


def _shift(block: Block, z: Array) -> float:
    """The smallest s with P + s near positive semidefinite."""
    root = np.linalg.inv(np.linalg.cholesky(block.near))
    return -float(np.linalg.eigvalsh(root @ block.at(z) @ root.T)[0])


def _are_definite(blocks: Sequence[Block], z: Array) -> bool:
    for block in blocks:
        try:
            np.linalg.cholesky(block.at(z))
        except np.linalg.LinAlgError:
            return False
    return True


def _minimised(
    blocks: Sequence[Block],
    linear: Array,
    z: Array,
    is_enough: Callable[[Array], bool] = lambda z: False,
) -> Array:
    """The minimiser of linear z - the sum of weighted log dets, from a point where all are positive definite."""
    for _ in range(MOST_STEPS):
        gradient, hessian = _slopes(blocks, linear, z)
        size = 1.0 / np.sqrt(np.maximum(np.diag(hessian), np.finfo(float).tiny))
        step = -size * np.linalg.lstsq(hessian * np.outer(size, size), size * gradient, rcond=None)[0]
        if -float(gradient @ step) < SETTLED:
            return z
        further = z + _share(blocks, linear, z, step) * step
        if not _are_definite(blocks, further):
            return z
        z = further
        if is_enough(z):
            return z
    return z


def _share(blocks: Sequence[Block], linear: Array, z: Array, step: Array) -> float:
    """The share of a step that minimises the cost along it: where its slope, that of -log det from eigenvalues, is zero.
    Slopes have digits where differences of costs have none."""
    along, rates, weights = float(linear @ step), [], []
    for block in blocks:
        root = np.linalg.inv(np.linalg.cholesky(block.at(z)))
        rates.append(np.linalg.eigvalsh(root @ np.einsum("k,kij->ij", step, block.slopes) @ root.T))
        weights.append(np.full(len(root), block.weight))
    rate, weight = np.concatenate(rates), np.concatenate(weights)

    def slope(share: float) -> float:
        return along - float(np.sum(weight * rate / (1.0 + share * rate)))

    low, high = 0.0, min(LONGEST, INSIDE / max(float(-rate.min()), INSIDE / LONGEST))
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if slope(middle) < 0.0 else (low, middle)
    return low if low > 0.0 else high


def _slopes(blocks: Sequence[Block], linear: Array, z: Array) -> tuple[Array, Array]:
    """Gradient (k,) and Hessian (k, k), whose entries are weight tr(P^-1 A_i P^-1 A_j)."""
    gradient, hessian = linear.copy(), np.zeros((len(z), len(z)))
    for block in blocks:
        inverse = np.linalg.inv(block.at(z))
        turned = np.einsum("ij,kjl->kil", inverse, block.slopes)
        gradient -= block.weight * np.einsum("kii->k", turned)
        used = np.flatnonzero(np.abs(block.slopes).any(axis=(1, 2)))
        own = turned[used]
        rows, columns = own.reshape(len(used), own[0].size if len(used) else 0), np.swapaxes(own, 1, 2)
        hessian[np.ix_(used, used)] += block.weight * (rows @ columns.reshape(rows.shape).T)
    return gradient, hessian
