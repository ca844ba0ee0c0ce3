"""Finds possible causes of a bad fit: exchanged columns of joints, reversed signs, or another unit.

Hypotheses on positions (a reversed sign, two exchanged columns) are tried one after the other, and the best is kept.
For each, every effort column is explained by every joint with either sign (`explain`), and an assignment gives the
joint of each column. A change is reported only if it improves the explanation enough.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from scipy.optimize import linear_sum_assignment, nnls

from psdmc.calibration.logs.log import Array
from psdmc.calibration.verdict.effort_checks import RANK_TOLERANCE, Gain, basis
from psdmc.calibration.verdict.evidence import Evidence
from psdmc.model.grounds import SCALES, Ground, exchanges
from psdmc.robot.mechanism import DRIVE

ROWS = 500
"""Samples on which hypotheses are tried."""
PRICE = 0.3
"""Explained share, summed over joints, that a change must add to be accepted: a reversed sign adds about 0.9 ..."""
FACTOR = 4.0
"""... or the factor by which what is left unexplained must fall, where little was, as with whole joints swapped ..."""
LEAST = 0.05
"""... by at least this much, summed over joints."""
CLOSE = 0.2
"""Share of a change's worth by which another hypothesis may be worse than the best and still be named."""
MOST_NAMED = 3
"""Number of equally good hypotheses that are named; where there are more, only the best is."""
CHANGES = 3
"""Changes of positions that are tried on top of each other."""
BELIEVED = 0.7
"""Least mean explained share of a hypothesis: of many hypotheses, some explain even noise a little better."""


@dataclass(frozen=True, slots=True)
class Hypothesis:
    """A hypothesis that columns of a log are exchanged or reversed.

    The true position of joint k is signs[k] times position column order[k]. The true effort of joint k is
    effort_signs[k] times effort column effort_order[k].

    score  share of the torque's variation that the hypothesis explains, summed over the joints
    """

    signs: tuple[int, ...]
    order: tuple[int, ...]
    effort_signs: tuple[int, ...]
    effort_order: tuple[int, ...]
    score: float

    @property
    def changes(self) -> int:
        """Return the number of changes in this hypothesis: reversed signs and exchanged pairs of columns.

        All efforts reversed together count as one change. The same change of a joint's position and effort also counts
        as one.
        """
        swaps = exchanges(self.order)
        if self.effort_order != self.order:
            swaps += exchanges(self.effort_order)
        if all(sign < 0 for sign in self.effort_signs) and all(sign > 0 for sign in self.signs):
            return swaps + 1
        return swaps + sum(-1 in both for both in zip(self.signs, self.effort_signs, strict=True))

    def worth(self, stated: Hypothesis) -> float:
        """Return whether the hypothesis is worth its changes: positive if it explains the log better than `stated` by
        enough.

        The result is the number of changes that the improvement justifies, minus the number of changes in the
        hypothesis.

        stated  the hypothesis that the log has no wrong columns
        """
        gained = self.score - stated.score
        left = max(len(self.signs) - self.score, 1e-12)
        fallen = np.log((left + max(gained, 0.0)) / left) / np.log(FACTOR) if gained > LEAST else 0.0
        return float(max(gained / PRICE, fallen)) - self.changes

    @property
    def reading(self) -> dict[str, tuple[int, ...]]:
        """Return the hypothesis as plain numbers, which a verdict's reason or doubt stores."""
        names = ("order", "signs", "effort_order", "effort_signs")
        return {name: getattr(self, name) for name in names}


def suspect(evidence: Evidence, positions: bool = True) -> Ground | None:
    """Return the best hypothesis about exchanged columns and reversed signs; None if none is much better than the log
    as it is.

    positions   True: consider positions and efforts; False: efforts alone
    """
    evidence = evidence.thinned(ROWS)
    stated = _stated(evidence)
    tried = _searched(evidence, stated, CHANGES if positions else 0)
    best = max(tried, key=lambda one: one.worth(stated))
    if best.worth(stated) <= 0 or best.score < BELIEVED * evidence.n:
        return None
    least = best.worth(stated) - CLOSE
    alike = [one for one in tried if one.changes == best.changes and one.worth(stated) > least]
    alike.sort(key=lambda one: -one.worth(stated))
    readings = list({tuple(one.reading.values()): one.reading for one in alike}.values())
    named = readings if len(readings) <= MOST_NAMED else readings[:1]
    explained, logged = (max(one.score, 0.0) / evidence.n for one in (best, stated))
    values = {"joints": evidence.model.v_names, "readings": named}
    return Ground("columns", {**values, "explained": explained, "logged": logged})


def _searched(evidence: Evidence, stated: Hypothesis, rounds: int) -> list[Hypothesis]:
    """All hypotheses that were tried, the log as it is first."""
    best = _assigned(evidence, stated, stated.signs, stated.order)
    tried = [stated, best]
    for _ in range(rounds):
        ways = [_assigned(evidence, stated, *way) for way in _moves(best)]
        tried += ways
        better = max(ways, key=lambda one: one.worth(stated))
        if better.worth(stated) <= best.worth(stated):
            break
        best = better
    return tried


def _stated(evidence: Evidence) -> Hypothesis:
    """The hypothesis that the log is right."""
    explain = Explainer(evidence)
    torque = evidence.of_motors().torque
    score = sum(explain(k, torque[:, k])[0] for k in range(evidence.n))
    here = tuple(range(evidence.n))
    return Hypothesis((1,) * evidence.n, here, (1,) * evidence.n, here, score)


def _moves(one: Hypothesis) -> Iterator[tuple[tuple[int, ...], tuple[int, ...]]]:
    """Positions with one more sign reversed, or one more pair exchanged."""
    n = len(one.signs)
    for k in range(n):
        yield tuple(-s if j == k else s for j, s in enumerate(one.signs)), one.order
    for i, k in combinations(range(n), 2):
        order = list(one.order)
        order[i], order[k] = order[k], order[i]
        yield one.signs, tuple(order)


def _assigned(
    evidence: Evidence, stated: Hypothesis, signs: tuple[int, ...], order: tuple[int, ...]
) -> Hypothesis:
    """The efforts' best signs and order for these positions. Efforts that stay, or change with the positions, cost
    nothing."""
    n = evidence.n
    explain = Explainer(evidence.turned(np.array(signs, dtype=np.float64), order))
    torque = evidence.of_motors().torque
    shares = np.array([[explain(k, torque[:, i]) for i in range(n)] for k in range(n)])
    stays = np.eye(n, dtype=bool) | (np.array(order)[:, None] == np.arange(n))
    moving = np.where(stays, 0.0, 0.5 * PRICE)
    turning = (np.array([0.0, PRICE]), np.zeros(2), np.array([np.inf, 0.0]))
    found = [_chosen(shares, moving, costs) for costs in turning]
    ways = [Hypothesis(signs, order, *one) for one in found]
    return max(ways, key=lambda one: one.worth(stated))


def _chosen(shares: Array, moving: Array, turning: Array) -> tuple[tuple[int, ...], tuple[int, ...], float]:
    """Per joint the sign and the column that explain most, at the costs of reversing and moving; and the explained
    share."""
    worth = shares - turning
    turned = np.argmax(worth, axis=2)
    joints, columns = linear_sum_assignment(np.max(worth, axis=2) - moving, maximize=True)
    sides = turned[joints, columns]
    score = float(shares[joints, columns, sides].sum())
    return tuple(-1 if side else 1 for side in sides), tuple(int(i) for i in columns), score


# How well a joint explains a column of efforts, with either sign
#
# Where the file states parameters: by the joint's torque times a gain that is not negative. Else by the joint's
# regressor, fitted to the first part of the data and judged on the rest. Both include friction that takes power, so that
# signs are found where the rigid torque does not show them.

TRAINING = 0.7
"""Share of the samples that a joint's own parameters are fitted to, where the file states none."""


class Explainer:
    """Computes how much of an effort column each joint explains, to find exchanged columns and reversed signs.

    A call explain(k, torque) returns two shares, 0 to 1, of the column's variation. The first is the share that the
    torque of joint k explains, the second the share that the reversed torque explains.
    """

    def __init__(self, evidence: Evidence) -> None:
        evidence = evidence.of_motors()
        columns = evidence.columns()
        theta_b = evidence.model.theta_b
        self._joints: list[_ByFile | _ByFit] = [
            _ByFit(evidence, columns[:, k], k)
            if theta_b is None
            else _ByFile(evidence, columns[:, k] @ theta_b, k)
            for k in range(evidence.n)
        ]

    def __call__(self, k: int, torque: Array) -> tuple[float, float]:
        if not np.ptp(torque):
            return 0.0, 0.0
        return self._joints[k].share(torque), self._joints[k].share(-torque)


class _ByFile:
    """Torque by the file with a gain, friction, drive inertia (none of them negative) and an offset."""

    def __init__(self, evidence: Evidence, by_file: Array, k: int) -> None:
        columns = [by_file, evidence.sign[:, k], evidence.qd[:, k]]
        if not evidence.model.mechanism.parameters[k, DRIVE] > 0:
            columns.append(evidence.qdd[:, k])
        design = np.stack(columns, axis=1)
        design = design - design.mean(axis=0)
        scale = np.linalg.norm(design, axis=0)
        self._q, self._r = np.linalg.qr(design / np.where(scale > 0, scale, 1.0))

    def share(self, torque: Array) -> float:
        y = torque - torque.mean()
        seen = self._q.T @ y
        _, left = nnls(self._r, seen)
        power = float(y @ y)
        return 1.0 - (float(left) ** 2 + max(power - float(seen @ seen), 0.0)) / power


class _ByFit:
    """The joint's own regressor, free, with friction that takes power: fitted to the first rows, judged on the last."""

    def __init__(self, evidence: Evidence, rigid: Array, k: int) -> None:
        self._first = round(TRAINING * len(evidence))
        columns = np.column_stack([rigid, np.ones(len(evidence))])
        self._rigid = columns
        self._friction = np.stack([evidence.sign[:, k], evidence.qd[:, k]], axis=1)
        self._basis = basis(columns[: self._first])
        train = self._friction[: self._first]
        self._left = train - self._basis @ (self._basis.T @ train)
        self._fit = np.linalg.pinv(columns[: self._first], rcond=RANK_TOLERANCE)

    def share(self, torque: Array) -> float:
        first = self._first
        y = torque[:first]
        friction, _ = nnls(self._left, y - self._basis @ (self._basis.T @ y))
        rigid = self._fit @ (y - self._friction[:first] @ friction)
        error = torque[first:] - self._rigid[first:] @ rigid - self._friction[first:] @ friction
        spread = float(np.sum((torque[first:] - torque[first:].mean()) ** 2))
        return max(1.0 - float(error @ error) / spread, 0.0) if spread > 0 else 0.0


# Units

ABOUT = 2.5
"""Factor within which two gains count as similar: a file's own masses may be wrong by as much."""
ALIKE = 12.0
"""Largest over smallest gain of a log whose joints share one fault: torque constants differ by a few times."""
MOTOR_SIDE = (1.0 / 300.0, 1.0 / ABOUT)
"""Gains that amperes, or torque before a gear, would give."""


def unit_suspect(gains: Sequence[Gain]) -> Ground | None:
    """Return the likely wrong unit of all torques, from their gains; None if no common wrong unit explains the gains.

    A gain is the ratio of measured torque to the torque from the robot file. Only reliable gains are used.
    """
    seen = np.array([gain.value for gain in gains if gain.visible])
    if not len(seen) or np.any(seen <= 0) or seen.max() > ALIKE * seen.min():
        return None
    middle = float(np.exp(np.mean(np.log(seen))))
    if 1.0 / ABOUT < middle < ABOUT:
        return None
    for unit in SCALES:
        if unit / ABOUT < middle < unit * ABOUT:
            return Ground("scaled", {"gain": unit})
    is_motor_side = MOTOR_SIDE[0] < middle < MOTOR_SIDE[1]
    return Ground("motor_side" if is_motor_side else "other_unit", {"gain": middle})
