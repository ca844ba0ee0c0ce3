"""Division of the vectors q and qd into the values of each joint."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from psdmc.dynamics.frames import Frame
from psdmc.dynamics.scalar import Scalar


def positions(frames: Sequence[Frame], q: Sequence[Scalar]) -> list[Scalar]:
    """Return one entry per joint: its coordinate, or a tuple if the joint has several coordinates."""
    return _dealt([frame.joint.nq for frame in leading(frames)], q)


def rates(frames: Sequence[Frame], qd: Sequence[Scalar]) -> list[Scalar]:
    """Return one entry per joint: the joint's rate, or the tuple of rates if the joint has several."""
    return _dealt([frame.joint.nv for frame in leading(frames)], qd)


def first_rates(frames: Sequence[Frame]) -> tuple[int, ...]:
    """Return, for each joint, the index of its first rate in qd; after the last joint, the number of all rates."""
    found = [0]
    for frame in leading(frames):
        found.append(found[-1] + frame.joint.nv)
    return tuple(found)


def neutral(frames: Sequence[Frame]) -> list[Scalar]:
    """q at which no frame has moved."""
    return [value for frame in leading(frames) for value in frame.joint.neutral]


def normalized(frames: Sequence[Frame], q: NDArray[Any]) -> NDArray[Any]:
    """Return the nearest positions that the joints can have, (nq, ...); for example, quaternions get length one."""
    own = leading(frames)
    ends = np.cumsum([frame.joint.nq for frame in own])[:-1]
    return np.concatenate([f.joint.normalized(part) for f, part in zip(own, np.split(q, ends), strict=True)])


def joints_of_rates(frames: Sequence[Frame]) -> tuple[int, ...]:
    """Return the joint of each rate."""
    return tuple(i for i, f in enumerate(frames) if f.follows is None for _ in range(f.joint.nv))


def flat(values: Iterable[Sequence[Scalar]]) -> list[Scalar]:
    """Flatten values that joints have several of."""
    return [x for own in values for x in own]


def leading(frames: Sequence[Frame]) -> list[Frame]:
    """Return the joints that have their own coordinates, that is, all joints except mimic joints (following.py)."""
    return [frame for frame in frames if frame.follows is None]


def _dealt(counts: Sequence[int], values: Sequence[Scalar]) -> list[Scalar]:
    if len(values) != sum(counts):
        raise ValueError(f"{len(values)} values for joints that have {sum(counts)}")
    found: list[Scalar] = []
    used = 0
    for count in counts:
        found.append(values[used] if count == 1 else tuple(values[used : used + count]))
        used += count
    return found
