"""Computes the statistics of a log's columns that its checks need, in one pass over the log.

The rows are read in parts, so that the log need not fit into memory.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from psdmc.calibration.logs.log import LARGEST_NUMBER, AnyLog, Array, Log, once
from psdmc.model.grounds import at_level

STRETCH_ROWS = 65_536
"""Rows that are surveyed, filtered and fitted at once."""
MOST_SLOPES = 200_000
"""Rows whose slopes are ranked; in longer logs evenly spread ones."""
FAST_SHARE = 0.99
"""Of the slopes; those above are noise."""


@dataclass(frozen=True, slots=True)
class NoNumber:
    """A column with values that are not finite or too large for a measurement.

    what          the column in words, such as "position of joint J1"
    rows          number of such values
    first, value  row and value of the first one
    """

    what: str
    rows: int
    first: int
    value: float


@dataclass(frozen=True, slots=True)
class Jump:
    """A position that changes from one row to the next far more than before and after, rad or m.

    time  s, of the row before the jump
    size  change of the position
    rate  change divided by the time between the rows, or by the log's period if that is longer
    """

    time: float
    size: float
    rate: float


@dataclass(frozen=True, slots=True, eq=False)
class Survey:
    """Statistics of a log with n joints, over all rows.

    no_numbers      columns with values that are not finite; if there are any, the other statistics have no meaning
    reach           (n,) largest absolute position
    motion          (n,) range of the position, peak to peak
    speed           (n,) a high value of the position's rate of change, which the share FAST_SHARE of the rows does not
                    exceed
    slope_power     (n,) sum of the squared rates of change of the position
    slope_velocity  (n,) sum of logged velocity times rate of change of the position; None if the log has no velocity
    largest_effort  (n,) largest absolute effort
    saturated       efforts that stay at an extreme value while the joint moves
    jumps           the largest jump of each joint's position; None if there is none
    motor_jumps     the same of the motors' positions; empty if the log has none
    straight        share of rows in which all positions and efforts lie on straight lines, as interpolated values do
    steps           s, the shortest and the longest time between rows
    """

    no_numbers: tuple[NoNumber, ...]
    reach: Array
    motion: Array
    speed: Array
    slope_power: Array
    slope_velocity: Array | None
    largest_effort: Array
    saturated: tuple[Saturated, ...]
    jumps: tuple[Jump | None, ...]
    motor_jumps: tuple[Jump | None, ...]
    straight: float
    steps: tuple[float, float]

    @property
    def velocity_ratios(self) -> dict[int, float]:
        """Return the ratio of logged velocity to the rate of change of the position, by the index of each joint that
        moves.

        A ratio that differs from one shows a wrong unit. The result is empty if the log has no velocity.
        """
        if self.slope_velocity is None:
            return {}
        moves = (self.motion >= SEEN_MOTION) & (self.slope_power > 0)
        return {int(k): float(self.slope_velocity[k] / self.slope_power[k]) for k in np.flatnonzero(moves)}


SEEN_MOTION = 1e-2
"""rad or m, peak to peak, from which a joint's slope is compared with its velocity."""


def surveyed(log: AnyLog, saturated_share: float) -> Survey:
    """Return the statistics of a log with two rows or more.

    saturated_share  share of rows at an extreme effort above which the effort counts as saturated
    """
    return once(log, ("survey", saturated_share), lambda: _surveyed(log, saturated_share))


def _surveyed(log: AnyLog, saturated_share: float) -> Survey:
    n = len(log.joint_names)
    bad: dict[str, NoNumber] = {}
    low, high, reach = np.full(n, np.inf), np.full(n, -np.inf), np.zeros(n)
    power, by_velocity, has_velocity = np.zeros(n), np.zeros(n), False
    largest = np.zeros(n)
    jumps: list[Jump | None] = [None] * n
    of_motors: list[Jump | None] = []
    straight, shortest, longest = 0, np.inf, -np.inf
    every = -(-len(log) // MOST_SLOPES)
    slopes: list[Array] = []
    efforts: list[Array] = []
    with np.errstate(all="ignore"):
        period = log.period
        for start in range(0, len(log), STRETCH_ROWS):
            part = log.rows(max(start - 1, 0), start + STRETCH_ROWS + 1)
            low, high = (
                np.minimum(low, part.position.min(axis=0)),
                np.maximum(high, part.position.max(axis=0)),
            )
            reach = np.maximum(reach, np.abs(part.position).max(axis=0))
            steps = np.diff(part.time)
            shortest, longest = min(shortest, float(steps.min())), max(longest, float(steps.max()))
            # central differences over two periods: too coarse for dynamics, but they distinguish units
            slope = (part.position[2:] - part.position[:-2]) / (part.time[2:] - part.time[:-2])[:, None]
            power += np.sum(slope**2, axis=0)
            if part.velocity is not None:
                has_velocity = True
                by_velocity += np.sum(slope * part.velocity[1:-1], axis=0)
            first = max(start, 1)
            # Copies: a view would keep the whole stretch in memory.
            slopes.append(slope[(-first) % every :: every].copy())
            efforts.append(part.effort[1:-1][(-first) % every :: every].copy())
            own = part.rows(start - max(start - 1, 0), start - max(start - 1, 0) + STRETCH_ROWS)
            _note_no_numbers(bad, own, start)
            jumps = [_larger(*both) for both in zip(jumps, _jumps(part, part.position, period), strict=True)]
            if part.motor_position is not None:
                more = _jumps(part, part.motor_position, period)
                of_motors = [_larger(*both) for both in zip(of_motors or [None] * n, more, strict=True)]
            straight += _straight_rows(own)
            largest = np.maximum(largest, np.abs(own.effort).max(axis=0))
        ranked = np.concatenate(slopes)
        speed = np.quantile(np.abs(ranked), FAST_SHARE, axis=0) if len(ranked) else np.zeros(n)
        return Survey(
            tuple(bad.values()),
            reach,
            high - low,
            np.asarray(speed),
            power,
            by_velocity if has_velocity else None,
            largest,
            ()
            if bad
            else saturated(
                log.joint_names, np.concatenate(efforts), ranked, np.asarray(speed), saturated_share
            ),
            tuple(jumps),
            tuple(of_motors),
            straight / len(log),
            (shortest, longest),
        )


ALONE = 10.0
"""Ratio of a jump to the changes before and after it: a fast motion, or a single wrong sample, has similar neighbours."""


def _jumps(part: Log, positions: Array, period: float) -> list[Jump | None]:
    """The largest isolated change of each joint's position, of its link or of its motor."""
    found: list[Jump | None] = [None] * len(part.joint_names)
    if len(part) < 4:
        return found
    steps = np.diff(positions, axis=0)
    size = np.abs(steps)
    is_alone = size[1:-1] > ALONE * np.maximum(size[:-2], size[2:])
    lasts = np.maximum(np.diff(part.time), period)
    for k in np.flatnonzero(is_alone.any(axis=0)).tolist():
        row = 1 + int(np.argmax(np.where(is_alone[:, k], size[1:-1, k], -1.0)))
        found[k] = Jump(float(part.time[row]), float(steps[row, k]), float(steps[row, k] / lasts[row]))
    return found


def _larger(one: Jump | None, other: Jump | None) -> Jump | None:
    if one is None or other is None:
        return one or other
    return one if abs(one.size) >= abs(other.size) else other


EXACTLY = 1e-9
"""Share of a column's range by which interpolated values leave a straight line: rounding. Motion leaves it by far more."""
STRAIGHT_ROWS = 6
"""Rows on one line, in all columns, that are no chance."""


def _straight_rows(part: Log) -> int:
    """The number of rows in stretches in which all positions and efforts lie on lines and some effort is not constant."""
    if len(part) < STRAIGHT_ROWS:
        return 0
    values = np.concatenate([part.position, part.effort], axis=1)
    close = EXACTLY * np.ptp(values, axis=0)
    slopes = np.diff(values, axis=0) / np.diff(part.time)[:, None]
    bends = np.abs(np.diff(slopes, axis=0)) * part.period
    n = len(part.joint_names)
    changes = np.any(np.abs(slopes * part.period)[:, n:] > close[n:], axis=1)[1:]
    on_line = np.all(bends <= close, axis=1) & changes
    edges = np.flatnonzero(np.diff(np.concatenate([[0], on_line.astype(np.int8), [0]])))
    lengths = edges[1::2] - edges[::2]
    return int(lengths[lengths >= STRAIGHT_ROWS].sum())


def _note_no_numbers(bad: dict[str, NoNumber], part: Log, start: int) -> None:
    """Add a stretch's values that are no measurements; `start` is its first row."""
    columns = [("time", part.time)]
    parts = {"position": part.position, "velocity": part.velocity, "effort": part.effort}
    for what, values in (parts | {"motor position": part.motor_position}).items():
        if values is None:
            continue
        called = f"effort ({part.quantity})" if what == "effort" else what
        columns += [(f"{called} of joint {name}", values[:, k]) for k, name in enumerate(part.joint_names)]
    for what, column in columns:
        rows = start + np.flatnonzero(~(np.abs(column) < LARGEST_NUMBER))
        if not len(rows):
            continue
        before = bad.get(what, NoNumber(what, 0, int(rows[0]), float(column[rows[0] - start])))
        bad[what] = replace(before, rows=before.rows + len(rows))


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
    """The effort of a joint that stays at its largest or smallest value.

    joint    name of the joint
    level    that value, in the effort's unit
    share    share of the rows in which the joint moves
    certain  False if friction of constant magnitude would look the same
    unit     unit of the level; empty if it is not known
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
    """Return the efforts that stay at their largest or smallest value in many rows of a log, as at a saturated drive.

    For each joint, only the more frequent extreme is returned.

    effort, speed   (N, n) for N rows and n joints
    fast            (n,) a high speed of each joint; rows with much smaller speeds are left out
    smallest_share  share of the rows at an extreme from which the effort is returned
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
