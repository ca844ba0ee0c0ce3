"""Checks that quaternions in q, and pairs of cosine and sine, have length one."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from psdmc.errors import InputError
from psdmc.robot.joints import JointType

SLACK = 1e-6
"""Accepted deviation of a length from one: torques are then off by as much, and a quaternion in float32 by 1e-7."""


def units_of(types: Iterable[JointType]) -> tuple[tuple[int, int], ...]:
    """Return the slices (start, stop) of q that are quaternions or pairs of cosine and sine, whose length must be one.
    `types` are the types of the robot's joints, in order."""
    found, start = [], 0
    for kind in types:
        if kind.unit.stop:
            found.append((start + kind.unit.start, start + kind.unit.stop))
        start += kind.nq
    return tuple(found)


def refuse_other_lengths(what: str, q: NDArray[Any], units: Sequence[tuple[int, int]]) -> None:
    """Raise InputError for the first row of q (..., nq) in which a quaternion, or a pair of cosine and sine, has not
    length one.

    units  slices (start, stop) of q that must have length one
    """
    rows = np.reshape(q, (-1, q.shape[-1]))
    for start, stop in units:
        lengths = np.linalg.norm(rows[:, start:stop].astype(np.float64), axis=1)
        wrong = np.flatnonzero(~(np.abs(lengths - 1.0) <= SLACK))
        if wrong.size:
            row = int(wrong[0])
            where = f" of row {_place(row, q.shape[:-1])}" if q.ndim > 1 else ""
            raise InputError(
                f"{what}[{start}:{stop}]{where} has length {lengths[row]:.9g}, expected one",
                "divide it by its length, or let integrate do it: integrate(q, 0 * v)",
            )


def _place(row: int, shape: tuple[int, ...]) -> str:
    """A row's number, or its indices where rows have several axes."""
    found = [int(k) for k in np.unravel_index(row, shape)]
    return str(found[0]) if len(found) == 1 else f"({', '.join(map(str, found))})"
