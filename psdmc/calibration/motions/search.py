"""Searches for an exciting motion by quasi-Newton descents from the best of many random motions.

The condition number of a fit's columns is not differentiable where two eigenvalues are both the smallest. So a descent
first minimises a smooth mean over all eigenvalues, and then approaches the condition number in steps.
"""

from __future__ import annotations

import contextlib
import os
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize

from psdmc.calibration.logs.log import Array
from psdmc.calibration.motions.allowed import TorqueLimits
from psdmc.calibration.motions.criterion import FitColumns, scaled, smooth_score
from psdmc.calibration.motions.excite_options import ExciteOptions
from psdmc.calibration.motions.limited_sines import LimitedSines

POWERS = (1.0, 3.0, 10.0, 30.0)
"""Of the means of eigenvalues that stand for the extreme ones, descent after descent."""
PER_START = 800
"""Evaluations for which a descent from one start is over, as a rule."""
TORQUE_COST = 1e4
"""Of the mean square excess of torque; 1 % of excess in each sample costs as much as a condition number e times larger."""
WALL = 0.5
"""By how much a motion that hits something counts as worse than the best: the line search then comes back by about half."""
STEPS_PER_EVALUATION = 5
"""Of the walk, for each evaluation with derivatives that descents left over when they came to something in the way: one
takes ten times as long."""
SEARCHED = 0.8
"""Share of the seconds after which the search ends; the rest is for looking at what it found more finely."""
REMEMBERED = 20
"""Steps that L-BFGS keeps."""

SearchProgress = Callable[[float, float, float], None]
"""Called with the share of the search that is done, seconds of CPU spent and the best score so far."""


def cpu_seconds() -> float:
    """Return the CPU time of this process with its threads and its ended child processes, s."""
    spent = os.times()
    return spent.user + spent.system + spent.children_user + spent.children_system


class OutOfTime(Exception):
    """The time limit or the number of evaluations ended a descent."""


@dataclass(frozen=True, slots=True, eq=False)
class Found:
    """The result of a search for an exciting motion.

    points          best coordinates of a motion (size,) from each descent, best first
    evaluations     number of evaluations of the objective
    history         (k, 2) for k times during the search: number of evaluations, and best objective so far
    ended_by_clock  True: the time limit ended the search
    """

    points: tuple[Array, ...]
    evaluations: int
    history: Array
    ended_by_clock: bool


class Criterion:
    """The function of a motion's coordinates that the search minimises.

    It is the objective of the options, such as the condition number of the fit's columns, plus a penalty for torques
    beyond their limits.
    """

    def __init__(
        self, space: LimitedSines, columns: FitColumns, options: ExciteOptions, torques: TorqueLimits | None
    ) -> None:
        self.space, self.columns, self.options, self.torques = space, columns, options, torques

    def score(self, point: Array) -> float:
        """Return the objective at a point."""
        found = scaled(self.columns.at(*(part.T for part in self.space.placed(point).states)))
        return found.score(self.options.objective)

    def cost(self, point: Array) -> float:
        """Return the smooth objective of a motion plus the penalty for torques beyond their limits, without
        derivatives.

        The smoothing is that of the last descent, which is closest to the objective itself.

        point  (size,) coordinates of the motion
        """
        q, qd, qdd = (np.ascontiguousarray(part.T) for part in self.space.placed(point).states)
        regressor = self.columns.model.regressor(q, qd, qdd)
        seen = scaled(self.columns.of(regressor, qd))
        value, _ = smooth_score(seen, self.options.objective, POWERS[-1])
        if self.torques is None:
            return value
        return value + TORQUE_COST * self.torques.excess(regressor, qd, self.options.torque_margin)[0]

    def smooth(self, point: Array, power: float) -> tuple[float, Array, float]:
        """Return the smooth objective of a motion with a penalty for excessive torques, its derivatives, and the plain
        objective.

        point  (size,) coordinates of the motion
        power  exponent of the smoothing; larger values are closer to the plain objective
        """
        at = self.space.placed(point)
        q, qd, qdd = (np.ascontiguousarray(part.T) for part in at.states)
        regressor = self.columns.model.regressor(q, qd, qdd)
        columns = self.columns.of(regressor, qd)
        seen = scaled(columns)
        value, by_gram = smooth_score(seen, self.options.objective, power)
        weights = (2.0 * columns.reshape(-1, columns.shape[-1]) @ by_gram).reshape(columns.shape)
        on_regressor, on_speed = None, None
        if self.torques is not None:
            excess, by_regressor, on_speed = self.torques.excess(regressor, qd, self.options.torque_margin)
            value, on_regressor = value + TORQUE_COST * excess, TORQUE_COST * by_regressor
        by_states = self.columns.slopes(at.states, weights, on_regressor)
        if on_speed is not None:
            by_states[1] += TORQUE_COST * on_speed.T
        return value, self.space.slope(at, by_states), seen.score(self.options.objective)


def search(
    criterion: Criterion,
    starts: Array,
    begin: float,
    is_free: Callable[[Array], bool] | None = None,
    progress: SearchProgress | None = None,
) -> Found:
    """Return the best motions that descents from several start motions find, best first.

    criterion  function to minimise
    starts     (k, size) coordinates of k start motions. The options' number of evaluations limits how many of them are
               used
    begin      value of cpu_seconds() from which the time limit counts
    is_free    function that returns whether the motion with given coordinates has no collision. Descents stay at such
               motions. If a collision ends a descent early, a random walk continues
    """
    options = criterion.options
    budget = options.evaluations
    counted = _Counted(criterion, begin, is_free, progress)
    best: list[tuple[float, Array]] = []
    descents = max(1, round(budget / PER_START))
    for number, start in enumerate(starts[:descents]):
        point = start
        counted.until = budget * (number + 1) // descents
        for power in POWERS[:1] if options.objective == "log_det" else POWERS:
            counted.begin(power, point)
            left = max(counted.until - counted.count, 1)
            limits = {"maxiter": PER_START, "maxfun": left, "maxcor": REMEMBERED}
            with contextlib.suppress(OutOfTime):
                minimize(counted, point, jac=True, method="L-BFGS-B", options=limits)
            point = counted.point
            if counted.is_over:
                break
        best.append((criterion.score(point), point))
        if counted.is_late:
            break
    if is_free is not None and best and not counted.is_late:
        _, nearest = min(best, key=lambda each: each[0])
        rng = np.random.default_rng(options.seed)
        point = walked(criterion.cost, nearest, is_free, counted.steps_left(), rng)
        best.append((criterion.score(point), point))
    best.sort(key=lambda each: each[0])
    history = np.array(counted.history).reshape(-1, 2)
    return Found(tuple(point for _, point in best), counted.count, history, counted.is_late)


class _Counted:
    """The criterion of a descent, with its best point, the count and the clock."""

    def __init__(
        self,
        criterion: Criterion,
        begin: float,
        is_free: Callable[[Array], bool] | None,
        progress: SearchProgress | None,
    ) -> None:
        self.criterion, self.is_free, self.progress = criterion, is_free, progress
        self.budget = self.until = criterion.options.evaluations
        self.count, self.started = 0, begin
        self.power, self.point, self.lowest = 1.0, np.zeros(0), np.inf
        self.best_score = np.inf
        self.history: list[tuple[float, float]] = []

    def begin(self, power: float, point: Array) -> None:
        self.power, self.point, self.lowest = power, point, np.inf
        self.limit = self.count + max((self.until - self.count) // 2, 1)

    @property
    def is_late(self) -> bool:
        return cpu_seconds() - self.started > SEARCHED * self.criterion.options.seconds

    @property
    def is_over(self) -> bool:
        return self.count >= self.until or self.is_late

    def __call__(self, point: Array) -> tuple[float, Array]:
        if self.count >= self.limit or self.is_late:
            raise OutOfTime
        self.count += 1
        value, slope, score = self.criterion.smooth(point, self.power)
        if self.is_free is not None and np.isfinite(self.lowest) and not self.is_free(point):
            return self.lowest + WALL, np.zeros_like(slope)
        if value < self.lowest:
            self.lowest, self.point = value, point.copy()
        if score < self.best_score:
            self.best_score = score
            self.history.append((float(self.count), score))
        self._tell(self.count)
        return value, slope

    def steps_left(self) -> Iterator[int]:
        """Yield the number of each step of the random walk until the number of evaluations or the time is used up."""
        for step in range(STEPS_PER_EVALUATION * max(self.budget - self.count, 0)):
            if self.is_late:
                return
            self._tell(self.count + step / STEPS_PER_EVALUATION)
            yield step

    def _tell(self, evaluations: float) -> None:
        if self.progress is not None:
            self.progress(evaluations / self.budget, cpu_seconds() - self.started, self.best_score)


FIRST_STEP = 0.1
"""Of each coordinate of the space, whose random motions have standard deviations of one."""
SMALLEST_STEP = 1e-4
"""Below it a walk gains nothing that counts; it then begins again with the first."""
GROWTH = 1.25
"""Of the step after a success; after a failure its fourth root's inverse, so that a fifth of the steps succeed (Rechenberg
1973)."""


def walked(
    cost: Callable[[Array], float],
    point: Array,
    is_free: Callable[[Array], bool],
    steps: Iterable[object],
    rng: np.random.Generator,
) -> Array:
    """Search for a motion of lower cost by a random walk, and return its coordinates. Only motions without collision
    count.

    cost     function from the coordinates of a motion to its cost
    point    (size,) coordinates of the first motion, which has no collision
    is_free  function that returns whether a motion has no collision
    steps    iterable with one entry per step of the walk
    """
    lowest, step = cost(point), FIRST_STEP
    for _ in steps:
        tried = point + step * rng.standard_normal(len(point))
        value = cost(tried)
        # whether it is free takes longer to find out, and is asked of what is better alone
        if value < lowest and is_free(tried):
            point, lowest, step = tried, value, step * GROWTH
        else:
            step = step * GROWTH**-0.25 if step > SMALLEST_STEP else FIRST_STEP
    return point
