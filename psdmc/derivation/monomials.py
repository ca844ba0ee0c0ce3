"""Numbers the monomials y_j, the products of joint variables in torques, and returns their exponents, the matrix E.

A monomial is a rate factor (|g|, qdd_j, qd_j^2 or qd_j qd_k) times one function of each joint's q. With s = sin q and c
= cos q, the functions are 1, s, c, s c, c^2 for a revolute joint. For a prismatic joint, they are 1, q, q^2. The
numbers of the functions are the digits of the monomial's code, a number in radix 5. The first joint's digit is the
highest.

A monomial's key is the number of the rate factor times 5^n plus the code. The columns of E are in the order of keys:
gravity, acceleration, centrifugal, Coriolis. Within each group, they are ordered by joint (pair), then by code.
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
        """Return the change of a monomial's code if the digit of this joint, the number of its function of q, increases
        by one."""
        return int(RADIX ** (self.n - 1 - joint))

    def digit(self, codes: Integers, joint: int) -> Integers:
        digits: Integers = (codes // self.weight(joint)) % RADIX
        return digits

    def tensor_codes(self, joints: Sequence[int], sizes: Sequence[int]) -> Integers:
        """Return the codes of the monomials in a flattened array of coefficients with one axis for each of these
        joints.

        The index along an axis is the number of the joint's function of q. `sizes` has the lengths of the axes.
        """
        codes = np.zeros(1, dtype=np.int64)
        for joint, size in zip(joints, sizes, strict=True):
            codes = (codes[:, None] + self.weight(joint) * np.arange(size)).reshape(-1)
        return codes

    def acceleration_rate(self, j: int) -> int:
        return 1 + j

    def velocity_rate(self, j: int, k: int) -> int:
        """Return the number of the factor qd_j qd_k among all products of rates, such as |g|, qdd_j, qd_j^2. j and k
        may be equal."""
        j, k = min(j, k), max(j, k)
        if j == k:
            return 1 + self.n + j
        before = j * (2 * self.n - j - 1) // 2
        return 1 + 2 * self.n + before + k - j - 1

    def rate_exponents(self) -> NDArray[np.uint8]:
        """Return (rates, 2n) the exponents of qd (n) and qdd (n) in each product of rates: |g|, qdd_j, qd_j^2, qd_j
        qd_k."""
        n = self.n
        table = np.zeros((1 + 2 * n + n * (n - 1) // 2, 2 * n), dtype=np.uint8)
        for j in range(n):
            table[self.acceleration_rate(j), n + j] = 1
            for k in range(j, n):
                table[self.velocity_rate(j, k), j] += 1
                table[self.velocity_rate(j, k), k] += 1
        return table

    def exponents(self, keys: Integers) -> NDArray[np.uint8]:
        """Return the matrix E (5n, p) uint8: exponents of the joint variables in p monomials, which are given by their
        keys.

        E has n rows each for q, sin q, cos q, qd and qdd.
        """
        rows = RowBlocks.of(self.n)
        table = np.zeros((BLOCKS * self.n, len(keys)), dtype=np.uint8)
        position = table[rows.position].reshape(-1, self.n, len(keys))
        rates, codes = np.divmod(keys, self.codes)
        for j, joint in enumerate(self.types):
            powers = np.array(joint.basis.exponents, dtype=np.uint8)
            position[:, j] = powers[self.digit(codes, j)].T
        table[rows.rates] = self.rate_exponents()[rates].T
        return table
