"""Estimates of an expansion's memory and time before it is made, and the errors if it would take too much."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from psdmc.derivation.interpolate import linear_sizes, quadratic_sizes
from psdmc.derivation.mass_matrix import slope_count
from psdmc.derivation.monomials import Monomials, Terms
from psdmc.errors import DerivationError
from psdmc.robot.joints import JointType
from psdmc.robot.mechanism import BASE

UNEXPANDED = (
    "derive with --no-expand: base parameters, regressor and generated code then come without E and P"
)
"""The remedy where a robot has no E and P."""

BYTES_PER_TERM = 280
"""Peak of the whole expansion per velocity term: 123 to collect, sort and sum it, some 200 with the matrices made of
them (measured on six and seven joints with oblique axes; 225 in double, 255 in extended precision)."""

_GRID_COPIES = 5
"""Grids of ten features held at once: twists, products, two steps of the interpolation, magnitudes. For a first,
optimistic check: with oblique axes the mass matrix keeps up to six times the largest grid (measured on seven
joints), and only then is the number of velocity terms known."""


LARGEST_EXPANSION = 25_000_000
"""Velocity terms beyond which an expansion is refused, whatever the memory: at some 1.6 us each, certificate included, these
take well under a minute (measured on six, seven and eight joints with oblique axes)."""

LARGEST_GRID = 5**8
"""Grid points of the mass matrix beyond which an expansion is refused: nine revolute joints, a few seconds each way."""

HEADROOM = 0.75
"""Part of the free memory that an expansion may plan for, as its need is estimated and other processes run."""


def types_along_paths(
    types: Sequence[JointType], parents: Sequence[int]
) -> tuple[tuple[JointType, ...], ...]:
    """Return the joint types on the path from the base to each body that carries no other body. A serial chain has one
    path."""
    paths: list[tuple[JointType, ...]] = []
    for joint, parent in zip(types, parents, strict=True):
        paths.append((*(paths[parent] if parent != BASE else ()), joint))
    return tuple(path for i, path in enumerate(paths) if i not in parents)


def refuse_uncountable(types: Sequence[JointType]) -> None:
    """Raise DerivationError if the torques can have more monomials (products of joint variables) than 64 bits can
    number."""
    monomials = Monomials(tuple(types))
    if len(monomials.rate_exponents()) * monomials.codes < 2**63:
        return
    raise DerivationError(
        f"expanding this {len(types)}-joint robot: its monomials are too many to be numbered",
        UNEXPANDED,
    )


def largest_monomial_count(types: Sequence[JointType]) -> int:
    """Return the number of products of joint variables (monomials) in the torques of a serial chain.

    The count is for axes in general position, with which the number is largest. The mass matrix entry M_0j has degree
    one in the variables of joints 1 to j, and two in those of later joints. The factors of rate products qd_j qd_k (k
    >= j) have at most these degrees.
    """
    n, linear, quadratic = len(types), linear_sizes(types), quadratic_sizes(types)
    total, gravity = 0, 1
    for size in linear:
        gravity *= size
    for j in range(n):
        product = 1
        for size in linear[1 : j + 1] + quadratic[j + 1 :]:
            product *= size
        total += (1 + n - j) * product
    return total + gravity - 1


def grid_bytes(types: Sequence[JointType]) -> int:
    """Return the estimated number of bytes of the largest grid of joint positions on which the mass matrix is sampled."""
    size = 10 * 8 * _GRID_COPIES
    for points in quadratic_sizes(types[1:]):
        size *= points
    return size


def velocity_bytes(
    mass_matrix: Mapping[tuple[int, int], Terms], monomials: Monomials, carried: Sequence[Sequence[int]]
) -> tuple[int, int]:
    """Return the number of velocity terms in all torques before equal terms are summed, and an estimate of their bytes.

    carried  for each joint, the joints that it moves
    """
    count = 0
    for (a, b), terms in mass_matrix.items():
        slopes = sum(slope_count(terms, monomials, d) for d in carried[a])
        count += slopes * (2 if a == b else 3)
    return count, count * BYTES_PER_TERM


def refuse_beyond(needed: int, available: int, monomials: int, n: int) -> None:
    """Raise DerivationError if the computation of E and P needs more memory than is available.

    needed, available  bytes
    monomials          number of columns of E, for the message
    n                  number of joints, for the message
    """
    if needed <= available:
        return
    raise DerivationError(
        f"expanding this {n}-joint robot takes up to {monomials:,} monomials and about "
        f"{needed / 2**30:.1f} GiB of memory, but no more than {available / 2**30:.1f} GiB should be taken here",
        UNEXPANDED,
    )


def refuse_long(terms: int, paths: Sequence[Sequence[JointType]], n: int) -> None:
    """Raise DerivationError if the computation of E and P (exponents and coefficients) would take more than about a
    minute.

    The reason is too many velocity terms. While their number is unknown (0), the size of the grid of joint positions
    for the mass matrix is tested instead.

    terms  number of velocity terms, or 0
    paths  joint types on each path from the base to an end of the robot
    n      number of joints, for the message
    """
    grid = max(int(np.prod(quadratic_sizes(path[1:]), dtype=float)) for path in paths)
    if terms <= LARGEST_EXPANSION and grid <= LARGEST_GRID:
        return
    what = f"{terms:,} velocity terms (limit {LARGEST_EXPANSION:,})"
    if not terms:
        what = f"a grid of {grid:,} points for the mass matrix alone (limit {LARGEST_GRID:,})"
    raise DerivationError(
        f"expanding this {n}-joint robot takes {what}: minutes",
        UNEXPANDED,
    )


def available_memory() -> int:
    """Return the bytes that an expansion may use: most of the machine's free memory. If the process has a memory limit
    (control group), it is most of what the limit leaves, if that is less."""
    return int(HEADROOM * min(_machine_memory(), _group_memory()))


def _machine_memory() -> int:
    try:
        for line in Path("/proc/meminfo").read_text(encoding="ascii").splitlines():
            if line.startswith("MemAvailable:"):
                return int(line.split()[1]) * 1024
    except (OSError, ValueError):
        pass
    return int(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"))


def _group_memory() -> int:
    group = Path("/sys/fs/cgroup")
    try:
        limit = int((group / "memory.max").read_text(encoding="ascii"))
        return limit - int((group / "memory.current").read_text(encoding="ascii"))
    except (OSError, ValueError):
        return 2**63 - 1
