"""Finds exciting trajectories, that is, motions that determine the parameters of a fit well.

They are sums of sines for each joint, (22), optimised for the columns of the fit, (23), within limits that every
candidate keeps. Source of the equations: Denso-2022.
"""

from __future__ import annotations

import bisect
import heapq
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from psdmc.calibration.identify.predictor import Regressor, payload_torque
from psdmc.calibration.identify.steps import Load
from psdmc.calibration.logs.log import Array
from psdmc.calibration.motions.allowed import Allowed, require_limits
from psdmc.calibration.motions.criterion import FitColumns, Scaled, scaled
from psdmc.calibration.motions.excite_options import ExciteOptions, Objective
from psdmc.calibration.motions.limited_sines import LimitedSines, SineSum
from psdmc.calibration.motions.search import Criterion, SearchProgress, cpu_seconds, search
from psdmc.calibration.motions.sweeps import swept_range
from psdmc.errors import InputError
from psdmc.robot.mechanism import Mechanism

SHRINKS = tuple(0.97**k for k in range(60))
"""Amplitudes that are tried, as shares of the first, until a motion keeps what its joints' limits do not imply."""
STARTS_FREE = 50
"""Random motions of which those that hit nothing are started from."""
COARSE_STEP = 0.1
"""rad (m) between the poses that the search looks at; what it finds is looked at more finely."""
FINER = 4
"""Rows at which a motion's limits are looked at, per sample of the search."""
MEASURES: dict[Objective, str] = {
    "deviation": "bound on the parameters' standard deviations",
    "condition": "condition number",
    "log_det": "mean semi-axis of the parameters' confidence ellipsoid",
}
"""What the search minimises, by objective. The mean is the geometric one."""
SPARE = 0.99
"""Share of the torque margin that the search may use; the rest is for its slow beginning and end, and between rows."""


@dataclass(frozen=True, slots=True, eq=False)
class Excitation:
    """The exciting motion that a search found, compared with random motions by what the search minimises.

    condition         condition number of the scaled columns of the fit along the motion; smaller is better
    random_times      (random,) how many times the measure of each random motion is that of the motion found, ascending;
                      infinite if a motion needs too much torque at any amplitude. Motions that collide do not count if
                      they are better than the best allowed one
    history           (k, 2) for k times during the search: number of evaluations, and best value of the objective so far
    seconds           CPU time since the time limit of the options began to count
    ended_by_clock    True: the time limit ended the search, so another run may find another motion
    random_condition  condition number of the best random motion; the best is that with the smallest measure
    objective         which measure the search minimises (MEASURES)
    deviation         upper bound of the parameters' standard deviations (criterion.Scaled.deviation)
    """

    motion: SineSum
    condition: float
    random_times: Array
    history: Array
    evaluations: int
    seconds: float
    ended_by_clock: bool = False
    random_condition: float = np.inf
    objective: Objective = "deviation"
    deviation: float = np.nan

    @property
    def times(self) -> float:
        """The measure of the best random motion divided by that of the motion found: at least one."""
        return float(self.random_times[0])

    @property
    def comparison(self) -> str:
        """Return a sentence that compares the motion with the best random motion."""
        count = len(self.random_times)
        if not np.isfinite(self.times):
            return f"none of {count} random motions is allowed, at any size"
        return (
            f"the {MEASURES[self.objective]} is {self.times:.2f} times smaller than that of the best of {count} random"
            f" motions that pass the same checks; the condition number of that random motion is {self.random_condition:.3g}"
        )


def excite(
    chain: Mechanism,
    model: Regressor | FitColumns,
    options: ExciteOptions | None = None,
    progress: SearchProgress | None = None,
    allowed: Allowed | None = None,
    began: float | None = None,
) -> Excitation:
    """Search for a motion that determines the parameters of a fit well. The search starts from the best random motions.

    The method is quasi-Newton descent.

    chain    the robot
    model    columns of the fit; or an object that computes the regressor, of which all columns are fitted
    allowed  limits of torque and collisions in addition to the joints' limits; None: none
    began    value of cpu_seconds() from which the time limit counts; None: now

    The result is never worse than the best random motion that keeps all limits without a collision. The result depends
    on the options alone if the time limit does not end the search. Raises InputError if a joint has no limits, or if no
    motion is allowed.
    """
    options, allowed = options or ExciteOptions(), allowed or Allowed(chain)
    require_limits(chain.joints)
    columns = model if isinstance(model, FitColumns) else _all_of(model, len(chain))
    space = LimitedSines(chain, options)
    begin = cpu_seconds() if began is None else began
    drawn = space.drawn(options.random, np.random.default_rng(options.seed))
    torques_alone = Allowed(chain, allowed.torques, allowed.torque_margin)
    random = [_within(space.motion(point), space, columns, torques_alone) for point in drawn]
    scores = [np.inf if seen is None else seen[1].score(options.objective) for seen in random]
    starts = drawn[np.argsort(scores, kind="stable")]
    best_random = _best_allowed(random, space, columns, allowed)
    criterion = Criterion(space, columns, options, allowed.torques)
    is_free = None if allowed.clearance is None else _free(space, allowed)
    if is_free is not None:
        cleared = [_cleared(space, point, is_free) for point in starts[:STARTS_FREE]]
        kept = [point for point in cleared if point is not None]
        starts = np.array(sorted(kept, key=criterion.score)).reshape(-1, space.size)
    found = search(criterion, starts, begin, is_free, progress)
    reached = [_within(space.motion(point), space, columns, torques_alone) for point in found.points]
    best = _best_allowed([*reached, best_random], space, columns, allowed)
    if best is None:
        why = "; ".join(_faults(space.motion(drawn[0]).shrunk(SHRINKS[-1]), space, allowed))
        raise InputError(
            f"no exciting motion is allowed: {why or 'each one hits something'}",
            "give other limits (--range, --effort, --torque-margin), or a floor that is lower",
        )
    motion, reached_columns = best
    return Excitation(
        motion,
        reached_columns.condition,
        np.sort(
            [np.inf if each is None else each[1].times(reached_columns, options.objective) for each in random]
        ),
        found.history,
        found.evaluations,
        cpu_seconds() - begin,
        found.ended_by_clock,
        np.inf if best_random is None else best_random[1].condition,
        options.objective,
        reached_columns.deviation,
    )


def _all_of(model: Regressor, n: int) -> FitColumns:
    still = np.zeros((1, n))
    return FitColumns(model, np.eye(model.regressor(still, still, still).shape[-1]))


def _seen(motion: SineSum, space: LimitedSines, columns: FitColumns) -> Scaled:
    """The columns along one period."""
    time_: Array = np.arange(space.samples) * motion.duration / space.samples
    return scaled(columns.at(*motion.at(time_)))


def _within(
    motion: SineSum, space: LimitedSines, columns: FitColumns, allowed: Allowed
) -> tuple[SineSum, Scaled] | None:
    """The motion with the largest amplitude that is allowed, and its columns; None where none is. Where the smallest is
    allowed, each smaller one than an allowed one is taken to be."""

    def is_allowed(share: float) -> bool:
        return not _faults(motion.shrunk(share), space, allowed)

    if is_allowed(SHRINKS[0]):
        share = SHRINKS[0]
    elif is_allowed(SHRINKS[-1]):
        share = SHRINKS[bisect.bisect_left(SHRINKS, True, key=is_allowed)]
    else:
        share = next(filter(is_allowed, SHRINKS), 0.0)
    if not share:
        return None
    shrunk = motion.shrunk(share)
    return shrunk, _seen(shrunk, space, columns)


def _best_allowed(
    motions: list[tuple[SineSum, Scaled] | None], space: LimitedSines, columns: FitColumns, allowed: Allowed
) -> tuple[SineSum, Scaled] | None:
    """The best motion by the objective, each with the largest amplitude at which it is allowed; None where none is.

    The best is looked at first. What hits something becomes smaller, in the list, too, and waits for its turn with what its
    columns are then: smaller motions excite less.
    """
    objective = space.options.objective
    waiting = [(each[1].score(objective), k, 1.0) for k, each in enumerate(motions) if each is not None]
    heapq.heapify(waiting)
    while waiting:
        _, k, share = heapq.heappop(waiting)
        found = motions[k]
        assert found is not None
        if not _faults(found[0], space, allowed):
            return found
        motions[k] = None
        if share > SHRINKS[-1]:
            smaller = found[0].shrunk(SHRINKS[1])
            seen = _seen(smaller, space, columns)
            motions[k] = smaller, seen
            heapq.heappush(waiting, (seen.score(objective), k, share * SHRINKS[1]))
    return None


def _faults(motion: SineSum, space: LimitedSines, allowed: Allowed) -> list[str]:
    """Return the faults of one period, and of rest anywhere on it, as the slow beginning and end are nearly at rest."""
    period = motion.duration / (FINER * space.samples)
    once = motion.sampled(allowed.chain.joint_names, period)
    found = replace(allowed, torque_margin=SPARE * allowed.torque_margin).faults(once)
    if found or allowed.torques is None:
        return found
    still = np.zeros_like(once.q)
    return allowed.torques.faults(allowed.torques.torque(once.q, still, still), SPARE * allowed.torque_margin)


def _free(space: LimitedSines, allowed: Allowed) -> Callable[[Array], bool]:
    """Whether the motion at a point meets nothing."""
    clearance = allowed.clearance
    assert clearance is not None

    def is_free(point: Array) -> bool:
        return clearance.first_touch(space.placed(point).states[0].T, COARSE_STEP) is None

    return is_free


def _cleared(space: LimitedSines, point: Array, is_free: Callable[[Array], bool]) -> Array | None:
    """The point with the largest share of its limits at which its motion meets nothing; None: at none."""
    for share in SHRINKS[1::6]:
        smaller = space.filled(point, share)
        if is_free(smaller):
            return smaller
    return None


MOTOR_POSES = 400
"""Random poses in which a load's torques are looked at."""
SWEPT = 0.9
"""Share of each joint's range in which they are, centred."""
SWEEP_POINTS = 15
UNFELT = 1e-6
"""Share of the load's weight times 1 m (of its weight, where a joint slides) that counts as nothing."""


def motor_poses(chain: Mechanism, load: Load) -> tuple[Array, Array]:
    """Return random poses (MOTOR_POSES, n), and the torques (MOTOR_POSES, n), N m (N), of a load in them.

    The torque of joint k in a pose is the RMS value while joint k moves through its range and the other joints rest.
    """
    low, high = np.array([swept_range(joint, SWEPT) for joint in chain.joints]).T
    poses = np.random.default_rng(0).uniform(low, high, (MOTOR_POSES, len(chain)))
    effect = np.empty_like(poses)
    for k in range(len(chain)):
        q = np.repeat(poses[:, None], SWEEP_POINTS, axis=1)
        q[:, :, k] = np.linspace(low[k], high[k], SWEEP_POINTS)
        torque = payload_torque(chain, q.reshape(-1, len(chain)), load.mass, load.com)[:, k]
        effect[:, k] = np.sqrt(np.mean(torque.reshape(-1, SWEEP_POINTS) ** 2, axis=1))
    return poses, effect


def unfelt(chain: Mechanism, load: Load, effect: Array) -> tuple[int, ...]:
    """Return the joints on which the load never acts: their axes are along gravity, or go through the load."""
    weight = load.mass * float(np.linalg.norm(chain.gravity))
    return tuple(int(k) for k in np.flatnonzero(effect.max(axis=0) <= UNFELT * weight))
