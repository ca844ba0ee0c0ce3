"""The monomials y_j: how they are numbered, their order, and their exponents, the matrix E.

A monomial is a product of one factor per joint, which depends on that joint's q, and a rate factor: |g|; qdd_j; qd_j^2;
qd_j qd_k. The joints' factors are written as a code, a number in radix 5 with one digit per joint, the first joint's
digit the highest. A digit stands for a factor in the basis of the joint's type: 1, s, c, s c, c^2 for a revolute joint,
1, q, q^2 for a prismatic one.

A monomial's key is the number of the rate factor times 5^n plus the code. The columns of E are in the order of keys:
gravity, acceleration, centrifugal, Coriolis; within each by joint (pair), then by code.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from psdmc.model.expansion import BLOCKS, RowBlocks
from psdmc.robot.joints import JointType

Integers = NDArray[np.int64]

RADIX = 5
"""Digits of the largest basis."""


@dataclass(frozen=True, slots=True)
class Monomials:
    """The numbering for joints of these types."""

    types: tuple[JointType, ...]

    @property
    def n(self) -> int:
        return len(self.types)

    @property
    def codes(self) -> int:
        """Number of codes, 5^n."""
        return int(RADIX**self.n)

    def weight(self, joint: int) -> int:
        """The change of the code if a joint's digit increases by one."""
        return int(RADIX ** (self.n - 1 - joint))

    def digit(self, codes: Integers, joint: int) -> Integers:
        digits: Integers = (codes // self.weight(joint)) % RADIX
        return digits

    def tensor_codes(self, joints: Sequence[int], sizes: Sequence[int]) -> Integers:
        """Return the codes of the monomials in a flattened coefficient tensor, whose axes belong to these joints."""
        codes = np.zeros(1, dtype=np.int64)
        for joint, size in zip(joints, sizes, strict=True):
            codes = (codes[:, None] + self.weight(joint) * np.arange(size)).reshape(-1)
        return codes

    def acceleration_rate(self, j: int) -> int:
        return 1 + j

    def velocity_rate(self, j: int, k: int) -> int:
        """Return the number of the rate factor qd_j qd_k, in either order."""
        j, k = min(j, k), max(j, k)
        if j == k:
            return 1 + self.n + j
        before = j * (2 * self.n - j - 1) // 2
        return 1 + 2 * self.n + before + k - j - 1

    def rate_exponents(self) -> NDArray[np.uint8]:
        """(rates, 2n) exponents of qd and qdd for every rate factor."""
        n = self.n
        table = np.zeros((1 + 2 * n + n * (n - 1) // 2, 2 * n), dtype=np.uint8)
        for j in range(n):
            table[self.acceleration_rate(j), n + j] = 1
            for k in range(j, n):
                table[self.velocity_rate(j, k), j] += 1
                table[self.velocity_rate(j, k), k] += 1
        return table

    def exponents(self, keys: Integers) -> NDArray[np.uint8]:
        """Return E, (5n, p) uint8, for p monomial keys; row blocks q, sin q, cos q, qd, qdd."""
        rows = RowBlocks.of(self.n)
        table = np.zeros((BLOCKS * self.n, len(keys)), dtype=np.uint8)
        position = table[rows.position].reshape(-1, self.n, len(keys))
        rates, codes = np.divmod(keys, self.codes)
        for j, joint in enumerate(self.types):
            powers = np.array(joint.basis.exponents, dtype=np.uint8)
            position[:, j] = powers[self.digit(codes, j)].T
        table[rows.rates] = self.rate_exponents()[rates].T
        return table
