"""Efforts that saturate: an extreme value that repeats while the joint moves and others come nowhere near it as often."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from psdmc.calibration.logs.log import Array
from psdmc.model.grounds import at_level

SAME = 1e-9
"""Share of a column's peak to peak up to which two efforts count as equal."""
BESIDE = 0.02
"""Share of the peak to peak just inside an extreme whose rows are counted beside those at it."""
PILED = 4.0
"""Rows at an extreme per row beside it. A sine in whole steps of its sensor has at most 2.5, of a sum of sines' one highest
peak there are fewer; clipped at 40 % of the peak it has tens."""
COARSE = 0.02
"""Share of the peak to peak: with coarser steps plain friction repeats an extreme as clipping does."""
MOVING = 0.02
"""Share of a joint's own speed below which it stands still and may hold one torque."""
BY_SENSE = 0.9
"""Correlation of being at an extreme with the motion's sense from which friction alone may explain it."""


@dataclass(frozen=True, slots=True)
class Saturated:
    """A joint's effort that stays at its largest or smallest value.

    joint    its name
    level    the value, in the effort's unit
    share    of the rows in which the joint moves
    certain  False where friction of a constant size would look the same
    unit     of the level; empty where it is not known
    """

    joint: str
    level: float
    share: float
    certain: bool
    unit: str = ""

    @property
    def words(self) -> str:
        return at_level(self.joint, self.level, self.unit, self.share)


def saturated(
    names: Sequence[str], effort: Array, speed: Array, fast: Array, smallest_share: float
) -> tuple[Saturated, ...]:
    """What repeats in some rows of a log: of each joint, the extreme that repeats more.

    effort, speed  (N, n);  fast (n,) the speed of each joint's fast motion;  smallest_share  of rows at an extreme
    """
    found = []
    for k, name in enumerate(names):
        moving = np.abs(speed[:, k]) > MOVING * fast[k]
        sides = [
            Saturated(name, side * piled[0], *piled[1:])
            for side in (1.0, -1.0)
            if (piled := _piled(side * effort[moving, k], side * speed[moving, k] > 0, smallest_share))
        ]
        found += sorted(sides, key=lambda side: (-side.certain, -side.share))[:1]
    return tuple(found)


def _piled(effort: Array, onwards: Array, smallest_share: float) -> tuple[float, float, bool] | None:
    """The largest effort (N,), the share of rows at it, and whether that is certain; None where it does not saturate.

    onwards  (N,)  whether the motion goes where this effort would drive it
    """
    reach = float(np.ptp(effort)) if len(effort) else 0.0
    if not reach > 0.0:
        return None
    level = float(effort.max())
    at = effort >= level - SAME * reach
    share = float(at.mean())
    if share < smallest_share:
        return None
    steps: Array = np.diff(np.unique(effort))
    step = float(np.min(steps[steps > SAME * reach], initial=reach))
    near = effort >= level - max(BESIDE * reach, 1.5 * step)
    beside = int(near.sum() - at.sum())
    if int(at.sum()) < PILED * max(beside, 1):
        return None
    is_one_way = onwards.all() or not onwards.any()
    by_sense = not is_one_way and abs(np.corrcoef(at, onwards)[0, 1]) > BY_SENSE
    return None if by_sense and step > COARSE * reach else (level, share, not by_sense)
