"""Finds errors of a log, or of the robot file's base, that the fit hides. These are a zero position, a scale, a tilted
base, and a load that the file does not state.

Each error is a hypothesis with one or a few columns: the change of all joint torques by a small error. The base
parameters, friction and offsets are fitted together with these columns. The likelihoods with and without the columns are
compared; each joint has a variance of its own. All fits use sums over the samples, so a fit costs little. The standard
deviation of an error is that of stretches of time whose residuals may depend on each other (Liang and Zeger 1986).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from copy import copy
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from scipy import stats
from scipy.linalg import lapack

from psdmc.calibration.logs.log import Array
from psdmc.calibration.verdict.effort_checks import CLUSTERS, RANK_TOLERANCE, clustered, with_friction
from psdmc.calibration.verdict.evidence import Evidence
from psdmc.errors import InputError
from psdmc.model import evaluate
from psdmc.model.bodies import load_map
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.robot.mechanism import PARAMETERS_PER_LINK

ROWS = 1500
"""Samples on which hypotheses are tried."""
STEP = 1e-4
"""rad, m or a share: step of the differences that give a column."""
ROUNDS = 3
"""Fits of each hypothesis: the first weights joints by their torques, the others by the residuals of the fit before."""
STEPS = 3
"""Gauss-Newton steps that make an error exact."""
MOST = 0.9
"""Largest error that is made exact, rad, m or a share: the steps of a larger one may not converge."""
SMALLEST_SHARE = 1e-3
"""Share of a joint's torque that counts as left: less is rounding."""
CHANCE = 1e-4
"""Probability that one of all hypotheses is named although the log has no error."""
EXPLAINS = 0.1
"""Share of a joint's unexplained power that a hypothesis explains at least to be named."""
CERTAIN = 0.75
"""The same share from which a log is not usable: the error then doubles the joint's RMSE."""
ALIKE = 0.8
"""Ratio of logarithms of likelihoods from which a second hypothesis is named beside the best."""
LARGE = {"zero": 0.035, "ratio": 0.03, "position": 0.03, "torque": 0.1, "tilt": 0.05}
"""Error of each kind from which a log is not usable, if the error surely has this size."""
LEAST = {"zero": 0.005, "ratio": 0.01, "position": 0.01, "torque": 0.03, "tilt": 0.01}
"""Smallest error of each kind that is named: rad or m, shares, and rad."""
LOADED = 0.9
"""Share that a load explains of all that the fit explains beyond the robot file, from which the load is named."""

SCALES = np.geomspace(1e-4, 1e4, 25)
"""Scales of an effort that are tried, with both signs: from kN m to mN m, and what wrong constants add."""
STEADY = 0.97
"""Smooth sign of the speed from which a joint is far enough from a reversal to show the scale of its effort."""


@dataclass(frozen=True, slots=True, eq=False)
class LogError:
    """A likely error of a log or of the robot file.

    kind        "zero" (of a position), "ratio" (reduction ratio: position and torque), "position" or "torque" (scale of
                one of them), "tilt" (of the base)
    joint       name of the joint; empty for a tilted base
    value, std  rad or m for "zero", rad for "tilt", otherwise the share by which the logged value is too large
    explains    share of the unexplained power that the error explains at the joint where it explains most
    felt        name of this joint
    unit        rad, m or 1
    certain     whether the log is not usable because of this error
    """

    kind: str
    joint: str
    value: float
    std: float
    explains: float
    felt: str
    unit: str
    certain: bool


@dataclass(frozen=True, slots=True)
class UnstatedLoad:
    """A load at the tip that the robot file does not state: mass and standard deviation, kg. `explains` is the share of
    the difference from the file that the load explains."""

    mass: float
    std: float
    explains: float


@dataclass(frozen=True, slots=True)
class EffortScale:
    """The logged effort of a joint divided by the effort that other joints predict: value and standard deviation.

    over_less, over_more  logarithms by which the value is likelier than all smaller and all larger scales outside a range
    """

    value: float
    std: float
    over_less: float
    over_more: float


def log_errors(evidence: Evidence, model: DynamicsModel) -> tuple[LogError, ...]:
    """Return the most likely error of a log, with errors that are nearly as likely; none if no error is likely.

    model  the calibrated model
    """
    evidence = evidence.thinned(ROWS)
    if model.theta_b is None or not np.any(evidence.torque):
        return ()
    design = _design(evidence)
    tried = list(_hypotheses(evidence, model))
    sums = Sums(design, [columns for _, _, columns in tried], evidence.torque)
    if sums.freedom <= 0:
        return ()
    stated = sums.fitted(())
    fits = [sums.fitted((i,)) for i in range(len(tried))]
    likelier = [sums.likelier(stated, fit) for fit in fits]
    best = max(likelier, default=0.0)
    sure = float(stats.t.isf(0.5 * CHANCE / max(len(tried), 1), CLUSTERS - 1))
    found = []
    for i in np.argsort(likelier)[::-1]:
        if not likelier[i] > max(ALIKE * best, 0.0):
            break
        kind, joint, columns = tried[i]
        value, std = _size(*sums.last(fits[i], (int(i),), design, columns, evidence.torque))
        share = 1.0 - (fits[i].scatter / stated.scatter) ** 2
        felt = int(share.argmax())
        if abs(value) > max(LEAST[kind], sure * std) and share[felt] > EXPLAINS:
            value, std = _refined(evidence, model, kind, joint, value, std)
            if abs(value) > MOST:
                continue  # no log has such an error: the columns differ from the model in another way
            at = None if joint is None else evidence.model.mechanism.leading_joints[joint]
            unit = "1" if kind not in ("zero", "tilt") else "rad" if at is None else at.type.position_unit
            certain = share[felt] > CERTAIN and abs(value) - sure * std > LARGE[kind]
            name, names = "" if at is None else at.name, evidence.model.v_names
            found.append(
                LogError(kind, name, value, std, float(share[felt]), names[felt], unit, bool(certain))
            )
    return tuple(found)


def _size(values: Array, covariance: Array) -> tuple[float, float]:
    """Value and standard deviation of an error; of the norm if the error has two components."""
    if len(values) == 1:
        return float(values[0]), float(np.sqrt(covariance[0, 0]))
    size = float(np.linalg.norm(values))
    pull = values / size if size > 0.0 else values
    return size, float(np.sqrt(pull @ covariance @ pull))


def _refined(
    evidence: Evidence, model: DynamicsModel, kind: str, joint: int | None, value: float, std: float
) -> tuple[float, float]:
    """Value and standard deviation after Gauss-Newton steps: the log is corrected, and the error that remains is fitted.

    A tilt keeps its first value, because other base parameters belong to another gravity.
    """
    if joint is None:
        return value, std
    for _ in range(STEPS):
        corrected = _corrected(evidence, kind, joint, value)
        design = _design(corrected)
        first = Sums(design, [], corrected.torque)
        theta_b = first.values((), first.fitted(()).weights)[: model.l]
        around = replace(model, theta_b=theta_b)
        columns = next(
            columns for own, k, columns in _hypotheses(corrected, around, joint) if (own, k) == (kind, joint)
        )
        sums = Sums(design, [columns], corrected.torque)
        change, std = _size(*sums.last(sums.fitted((0,)), (0,), design, columns, corrected.torque))
        value = value + change if kind == "zero" else (1.0 + value) * (1.0 + change) - 1.0
        if not -MOST < value < MOST:
            return value, std
    return value, std


def _corrected(evidence: Evidence, kind: str, joint: int, value: float) -> Evidence:
    """The samples without an error."""
    one = np.eye(evidence.n)[joint]
    if kind == "zero":
        return replace(evidence, q=evidence.q - value * one)
    factor = 1.0 + value * one
    if kind == "torque":
        return replace(evidence, torque=evidence.torque / factor)
    moved = {name: getattr(evidence, name) / factor for name in ("q", "qd", "qdd")}
    return replace(evidence, **moved, torque=evidence.torque * factor if kind == "ratio" else evidence.torque)


def unstated_load(evidence: Evidence) -> UnstatedLoad | None:
    """Return a load at the tip that explains nearly all of the difference between the log and the robot file's
    parameters; None if there is none."""
    evidence = evidence.thinned(ROWS)
    model, by_file = evidence.model, evidence.file_torque()
    if by_file is None:
        return None
    try:
        onto = load_map(model.mechanism, model.B, model.mechanism.tip_frame)
    except InputError:
        return None
    design = _design(evidence)
    friction = design[:, :, model.l :]
    rigid = design[:, :, : model.l]
    target = evidence.torque - by_file
    sums = Sums(friction, [rigid @ onto, rigid], target)
    if sums.freedom <= 0:
        return None
    weights = sums.fitted((1,)).weights
    left = [sums.left(which, weights) for which in ((), (0,), (1,))]
    explains = (left[0] - left[1]) / max(left[0] - left[2], 1e-300)
    fit = sums.fitted((0,))
    values, covariance = sums.last(fit, (0,), friction, rigid @ onto, target)
    mass, std = float(values[0]), float(np.sqrt(covariance[0, 0]))
    sure = float(stats.t.isf(0.5 * CHANCE, CLUSTERS - 1))
    noticed = left[0] > (1.0 + EXPLAINS) * left[2]
    if not noticed or explains < LOADED or not mass > sure * std:
        return None
    return UnstatedLoad(mass, std, float(explains))


def effort_scale(
    evidence: Evidence, k: int, others: Sequence[int], low: float, high: float
) -> EffortScale | None:
    """Return the most likely scale between `low` and `high` of joint k's effort, by the base parameters that the joint
    shares with other joints; None if the log is too short.

    The efforts of the other joints are taken as right. If motors drive several joints, k and the others are motors.
    """
    evidence = evidence.thinned(ROWS).of_motors()
    joints = [*others, k]
    steady = np.abs(evidence.sign[:, joints]) > STEADY  # friction near a reversal is no part of the model
    design = _design(evidence)[:, joints] * steady[:, :, None]
    torque, rigid = evidence.torque[:, joints] * steady, evidence.model.l
    sums = Sums(design, [], torque)
    if sums.freedom <= 0:
        return None
    stated = sums.fitted(())
    tried = np.concatenate([-SCALES, SCALES, [low, high]])
    likely = np.array([sums.likelier(stated, sums.scaled(rigid, scale).fitted(())) for scale in tried])
    inside = np.where((tried > low) & (tried < high), likely, -np.inf)
    value, best = float(tried[inside.argmax()]), float(inside.max())
    for _ in range(STEPS):
        scaled = design.copy()
        scaled[:, -1, :rigid] *= value
        first = Sums(scaled, [], torque)
        theta_b = first.values((), first.fitted(()).weights)[:rigid]
        slope = np.zeros((*torque.shape, 1))
        slope[:, -1, 0] = scaled[:, -1, :rigid] @ theta_b
        both = Sums(scaled, [slope], torque)
        change, std = _size(*both.last(both.fitted((0,)), (0,), scaled, slope, torque))
        value, std = value * (1.0 + change), abs(value) * std
    over = [float(steady.mean() * (best - likely[side].max())) for side in (tried <= low, tried >= high)]
    return EffortScale(value, std, *over)


def _design(evidence: Evidence) -> Array:
    """(N, n, l + 3 n) of base parameters, and Coulomb and viscous friction and offset of each joint (of its motor)."""
    coupling = evidence.coupling
    speed = evidence.qd if coupling is None else coupling.to_motors(evidence.qd)
    return with_friction(evidence.columns(), evidence.sign, speed, coupling)


def _hypotheses(
    evidence: Evidence, model: DynamicsModel, only: int | None = None
) -> Iterator[tuple[str, int | None, Array]]:
    """Kind, joint and columns (N, n, m) of each error, of all joints or of one.

    A column is the change of the joint torques that are logged, by an error of one.
    """
    x = model.equivalent_parameters()
    chain = model.mechanism
    motion = (evidence.q, evidence.qd, evidence.qdd)

    def torque(*parts: Array) -> Array:
        return evaluate.torques(chain, x, list(parts))

    rigid, one = torque(*motion), np.eye(evidence.n)
    moving = np.flatnonzero(np.ptp(evidence.q, axis=0) > 0).tolist()
    for k in moving if only is None else [only]:
        shift = STEP * one[k]
        yield "zero", k, _slope(*(torque(evidence.q - s * shift, *motion[1:]) for s in (1, -1)))
        scaled = [1.0 - s * shift for s in (1, -1)]
        moved = _slope(*(torque(*(part * factor for part in motion)) for factor in scaled))
        yield "position", k, moved
        if evidence.coupling is None:
            own = (rigid * one[k])[:, :, None]
            yield "torque", k, own
            yield "ratio", k, moved - own
    if only is None and np.linalg.norm(chain.gravity) > 0:
        yield "tilt", None, _tilts(model, motion)


def _slope(after: Array, before: Array) -> Array:
    return np.asarray((after - before) / (2.0 * STEP))[:, :, None]


def _tilts(model: DynamicsModel, motion: Sequence[Array]) -> Array:
    """(N, n, 2) change of the torques by a turn of gravity about two level axes, per radian.

    Parameters that upright gravity does not show come from the robot file where it states them.
    """
    chain = model.mechanism
    x = model.equivalent_parameters()
    stated = chain.parameters.reshape(-1)
    if np.isfinite(stated).all() and len(stated) == len(x) == PARAMETERS_PER_LINK * len(chain.joints):
        x = x + stated - model.representative @ (model.B @ stated)
    g = chain.gravity
    level = np.linalg.svd(g[None])[2][1:]
    parts = [
        _slope(
            *(
                evaluate.torques(replace(chain, gravity=g + s * STEP * np.cross(axis, g)), x, list(motion))
                for s in (1, -1)
            )
        )
        for axis in level
    ]
    return np.concatenate(parts, axis=2)


def solution(matrix: Array, right: Array) -> Array:
    """Return the solution (p,) of a symmetric system (p, p) without directions whose eigenvalue is below RANK_TOLERANCE**2
    of the largest. If LAPACK's estimate of the condition number says that there are none, Cholesky's method is faster."""
    factor, fails = lapack.dpotrf(matrix)
    if not fails and lapack.dpocon(factor, np.abs(matrix).sum(axis=0).max())[0] > 10.0 * RANK_TOLERANCE**2:
        return np.asarray(lapack.dpotrs(factor, right)[0])
    return np.asarray(np.linalg.pinv(matrix, rcond=RANK_TOLERANCE**2, hermitian=True) @ right)


@dataclass(frozen=True, slots=True, eq=False)
class Fit:
    """A weighted fit: RMS residual (n,) of each joint and the weights (n,) that gave it."""

    scatter: Array
    weights: Array


class Sums:
    """Sums over N samples from which each hypothesis is fitted, for n joints.

    design   (N, n, p) columns of the unknowns that are always fitted
    further  columns (N, n, m) of each hypothesis
    torque   (N, n)
    """

    def __init__(self, design: Array, further: Sequence[Array], torque: Array) -> None:
        whole = np.concatenate([design, *further, torque[:, :, None]], axis=2)
        self.samples, self.n = torque.shape
        self.own = list(range(design.shape[2]))
        ends = np.cumsum([design.shape[2], *(part.shape[2] for part in further)])
        self.places = [list(range(a, b)) for a, b in pairwise(ends.tolist())]
        sizes = np.sqrt(np.einsum("tjp,tjp->p", whole, whole))
        self.sizes = np.where(sizes > 0.0, sizes, 1.0)
        whole = whole / self.sizes
        self.grams: Array = np.stack([whole[:, j].T @ whole[:, j] for j in range(self.n)])
        self.size: Array = torque.std(axis=0)
        self.moved = self.size > 0
        self.freedom = self.samples * self.n - whole.shape[2]

    def _solved(self, which: Sequence[int], weights: Array) -> tuple[list[int], Array]:
        """Places of the fitted columns, and their values in units of the scaled columns; directions that the samples do
        not show are left out."""
        columns = [*self.own, *(k for i in which for k in self.places[i])]
        gram = np.tensordot(weights**2, self.grams, axes=1)
        a, b = gram[np.ix_(columns, columns)], gram[columns, -1]
        norms = np.sqrt(np.diag(a))
        scale = 1.0 / np.where(norms > 0.0, norms, 1.0)
        return columns, solution(a * np.outer(scale, scale), b * scale) * scale

    def values(self, which: Sequence[int], weights: Array) -> Array:
        """Return the values of all fitted columns in their own units."""
        places, values = self._solved(which, weights)
        return np.asarray(values / self.sizes[places] * self.sizes[-1])

    def scaled(self, count: int, scale: float) -> Sums:
        """Return the sums with the first columns of the last joint multiplied by a factor."""
        factor = np.ones(self.grams.shape[1])
        factor[:count] = scale
        changed = copy(self)
        changed.grams = np.concatenate([self.grams[:-1], self.grams[-1:] * np.outer(factor, factor)])
        return changed

    def _squares(self, columns: list[int], values: Array) -> Array:
        """(n,) sums of squared residuals."""
        a, b = self.grams[:, columns][:, :, columns], self.grams[:, columns, -1]
        squares = self.grams[:, -1, -1] - 2.0 * b @ values + np.einsum("p,jpq,q->j", values, a, values)
        return np.asarray(np.maximum(squares, 0.0) * self.sizes[-1] ** 2)

    def fitted(self, which: Sequence[int]) -> Fit:
        """Return the fit of some hypotheses together with the unknowns that are always fitted."""
        floor = np.where(self.moved, SMALLEST_SHARE * self.size, 1.0)
        scatter = np.where(self.moved, self.size, 1.0)
        weights = np.where(self.moved, 1.0 / scatter, 0.0)
        for _ in range(ROUNDS):
            weights = np.where(self.moved, 1.0 / scatter, 0.0)
            squares = self._squares(*self._solved(which, weights))
            scatter = np.maximum(np.sqrt(squares / self.samples), floor)
        return Fit(scatter, weights)

    def left(self, which: Sequence[int], weights: Array) -> float:
        """Return the weighted sum of squared residuals of a fit with given weights."""
        return float(weights**2 @ self._squares(*self._solved(which, weights)))

    def likelier(self, stated: Fit, found: Fit) -> float:
        """Return the logarithm of the ratio of two likelihoods."""
        return float(self.samples * np.sum(np.log(stated.scatter / found.scatter)[self.moved]))

    def last(
        self, fit: Fit, which: Sequence[int], design: Array, columns: Array, torque: Array
    ) -> tuple[Array, Array]:
        """Return values (m,) of a hypothesis's columns and their covariance, from stretches of time."""
        w = fit.weights
        values = self.values(which, w)
        whole = np.concatenate([design, columns], axis=2) * w[:, None]
        m, flat = columns.shape[2], whole.reshape(-1, whole.shape[2])
        norms = np.linalg.norm(flat, axis=0)
        scale = 1.0 / np.where(norms > 0.0, norms, 1.0)
        inverse = np.linalg.pinv((flat * scale).T @ (flat * scale), rcond=RANK_TOLERANCE**2, hermitian=True)
        left = torque * w - whole @ values
        scores = np.einsum("tjp,tj->tp", whole * scale, left)
        covariance = (inverse @ clustered(scores) @ inverse) * np.outer(scale, scale)
        return values[-m:], covariance[-m:, -m:]
