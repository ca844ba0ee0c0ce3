"""Selects the first allowed motion from several, which use smaller and smaller parts of the joints' ranges."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace

import numpy as np

from psdmc.calibration.motions.trajectory import Trajectory
from psdmc.errors import InputError
from psdmc.robot.mechanism import Mechanism

SHARES = (1.0, 0.85, 0.7, 0.55, 0.4, 0.28, 0.2)
"""Of each joint's range in which a motion is tried, one after the other."""
TRIES = 8
"""Places of such a part, and motions in it, that are tried before a smaller one."""

Try = tuple[float, Callable[[], Trajectory]]
"""Share of the ranges, and a motion within it."""


def first_allowed(
    what: str, tries: Iterable[Try], faults: Callable[[Trajectory], list[str]]
) -> tuple[Trajectory, float]:
    """Return the first motion that violates no limit, and the share of the joint ranges that this motion uses.

    what    kind of motion, for messages
    tries   shares of the ranges, and functions that make a motion within them
    faults  function that returns one sentence for each violated limit

    Raises InputError if all motions violate limits, or with the first error if no motion can be made.
    """
    found: list[str] = []
    for number, (share, make) in enumerate(tries):
        try:
            motion = make()
        except InputError:
            if number == 0:
                raise
            continue  # no room for the motion in so small a part of the ranges
        found = faults(motion)
        if not found:
            return motion, share
    raise InputError(
        f"no {what} is allowed, however small: {'; '.join(found)}",
        "give ranges in which the robot is free: --range JOINT=LOW:HIGH; or other limits",
    )


def smaller_boxes(chain: Mechanism, seed: int) -> Iterator[tuple[float, int, Mechanism]]:
    """Yield smaller and smaller joint ranges in which a motion may be planned.

    Each entry has the share of the full ranges, the number of the attempt with this share, and the robot with the
    smaller ranges. The first attempt takes the middle of the ranges, the others random places.
    """
    rng = np.random.default_rng(seed)
    low, high = np.array([(joint.limits.lower, joint.limits.upper) for joint in chain.joints]).T
    for share in SHARES:
        half = 0.5 * share * (high - low)
        for number in range(TRIES):
            middle = 0.5 * (low + high)
            if number and share < 1.0:
                middle = rng.uniform(low + half, high - half)
            yield share, number, _within(chain, middle - half, middle + half)


def _within(chain: Mechanism, low: np.ndarray, high: np.ndarray) -> Mechanism:
    joints = tuple(
        replace(joint, limits=replace(joint.limits, lower=float(a), upper=float(b)))
        for joint, a, b in zip(chain.joints, low, high, strict=True)
    )
    return replace(chain, joints=joints)
