"""Exciting trajectories: sums of sines per joint (22), optimised for the regressor's condition (23), within limits.

A candidate is scaled to a share of what its limits allow, so that every candidate is feasible and the search needs no
constraints.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from psdmc.calibration.identify.predictor import Regressor
from psdmc.calibration.logs.log import Array
from psdmc.calibration.motions.excite_options import ExciteOptions as ExciteOptions
from psdmc.calibration.motions.trajectory import Trajectory
from psdmc.errors import InputError
from psdmc.robot.mechanism import Joint, Mechanism

STEP = 0.5
"""First step of CMA-ES, in standard deviations of a random start's weights."""
SETTLED = 1e-3
"""Spread of a generation's scores, relative to the best, at which a descent ends and the next begins."""
FILL = 3.0
"""Start of the search for each joint's share of its limits: 1 / (1 + exp(-3)) = 95 %."""

Progress = Callable[[float, float], None]
"""Called with seconds spent and the best score so far: the condition number, or minus the log determinant."""


@dataclass(frozen=True, slots=True, eq=False)
class SineSum:
    """q_i(t) = centre_i + sum over k of a_ik sin(w_k t) + b_ik cos(w_k t), w_k = 2 pi harmonic_k / duration.

    centre (n,), sine (n, h), cosine (n, h): rad (m). As amplitude and phase: A sin(w t + phi), A = hypot(a, b).
    """

    duration: float
    harmonics: tuple[int, ...]
    centre: Array
    sine: Array
    cosine: Array

    @property
    def amplitude(self) -> Array:
        return np.hypot(self.sine, self.cosine)

    @property
    def phase(self) -> Array:
        return np.arctan2(self.cosine, self.sine)

    def sampled(self, joint_names: tuple[str, ...], period: float, repeats: int = 1) -> Trajectory:
        """The motion on an even grid, `repeats` periods of it."""
        count = round(repeats * self.duration / period) + 1
        time_: Array = np.arange(count, dtype=np.float64) * period
        basis = _basis(self.harmonics, self.duration, time_)
        q, qd, qdd = (self.sine @ s + self.cosine @ c for s, c in basis)
        return Trajectory(joint_names, time_, q.T + self.centre, qd.T, qdd.T)


@dataclass(frozen=True, slots=True, eq=False)
class Excitation:
    """A motion found, compared with random ones.

    condition         of the column-scaled regressor along it
    random_conditions (random,) of random motions scaled to the limits, ascending
    history           (k, 2) candidates seen and best score so far: the condition, or minus the log determinant
    """

    motion: SineSum
    condition: float
    random_conditions: Array
    history: Array
    evaluations: int
    seconds: float

    @property
    def gain(self) -> float:
        """Best condition of the random motions over the one reached."""
        return float(self.random_conditions[0] / self.condition)


def excite(
    chain: Mechanism, model: Regressor, options: ExciteOptions | None = None, progress: Progress | None = None
) -> Excitation:
    """Search for an exciting motion by CMA-ES, started from the best random one.

    InputError where a joint has no limits to keep.
    """
    options = options or ExciteOptions()
    space = _Space(chain, options)
    judge = _Judge(model, space, options)
    begin = time.monotonic()
    rng = np.random.default_rng(options.seed)
    drawn = rng.standard_normal((options.random, space.size))
    drawn.reshape(options.random, space.n, -1)[..., -2] = 12.0
    scores = np.concatenate([judge(part) for part in np.array_split(drawn, max(1, options.random // 50))])
    conditions = np.sort(
        np.concatenate(
            [judge.condition(part) for part in np.array_split(drawn, max(1, options.random // 50))]
        )
    )
    starts = drawn[np.argsort(scores, kind="stable")]
    best, history, evaluations = _search(judge, starts, options, begin, progress)
    motion = space.motion(best[None])
    condition = float(judge.condition(best[None])[0])
    spent = time.monotonic() - begin
    return Excitation(motion, condition, conditions, np.array(history), evaluations, spent)


def require_limits(joints: Sequence[Joint]) -> None:
    """InputError names the joints that have no limits to move within, and which."""
    lacking = []
    for joint in joints:
        limits = joint.limits
        named = {
            "position": limits.upper - limits.lower,
            "speed": limits.speed,
            "acceleration": limits.acceleration,
        }
        missing = [what for what, value in named.items() if not np.isfinite(value)]
        if missing:
            lacking.append(f"{joint.name} ({', '.join(missing)})")
    if lacking:
        raise InputError(
            f"joint(s) without limits to move within: {', '.join(lacking)}",
            "add them to the robot file; an acceleration for all such joints can be given with --acceleration",
        )


def _search(
    judge: _Judge, starts: Array, options: ExciteOptions, begin: float, progress: Progress | None
) -> tuple[Array, list[tuple[float, float]], int]:
    """CMA-ES from one random start after the other, the best first, until candidates or time are used up."""
    import cma

    best, best_score = starts[0], float(judge(starts[:1])[0])
    history = [(0.0, best_score)]
    evaluations, restart = 0, 0

    def over() -> bool:
        return evaluations >= options.evaluations or time.monotonic() - begin > options.seconds

    while not over():
        settings = {"popsize": options.population, "seed": options.seed + restart, "verbose": -9}
        strategy = cma.CMAEvolutionStrategy(starts[restart % len(starts)], STEP, settings)
        while not strategy.stop() and not over():
            candidates = np.array(strategy.ask())
            scores = judge(candidates)
            strategy.tell(list(candidates), scores.tolist())
            evaluations += len(candidates)
            leader = int(np.argmin(scores))
            if scores[leader] < best_score:
                best, best_score = candidates[leader], float(scores[leader])
                history.append((float(evaluations), best_score))
            if progress is not None:
                progress(time.monotonic() - begin, best_score)
            if float(np.ptp(scores)) < SETTLED * best_score:
                break
        restart += 1
    return best, history, evaluations


class _Space:
    """Candidates as vectors: per joint, weights of sines and cosines, and the place of the motion within the range."""

    def __init__(self, chain: Mechanism, options: ExciteOptions) -> None:
        require_limits(chain.joints)
        limits = [joint.limits for joint in chain.joints]
        bounds = np.array([(x.lower, x.upper, x.speed, x.acceleration) for x in limits])
        self.options = options
        self.n, self.h = len(chain), len(options.harmonics)
        self.size = self.n * (2 * self.h + 2)
        self.middle = 0.5 * (bounds[:, 0] + bounds[:, 1])
        top = max(options.harmonics)
        self.grid = max(16 * top, options.samples)
        # between grid points a trigonometric polynomial of degree m exceeds its largest sample by at most this factor
        # (Ehlich and Zeller 1964), so that the limits hold at every time, not only on the grid
        self.factor = float(np.cos(np.pi * top / self.grid))
        usable = options.margin * self.factor
        self.half = 0.5 * (bounds[:, 1] - bounds[:, 0]) * usable
        self.speed, self.acceleration = bounds[:, 2] * usable, bounds[:, 3] * usable
        even = np.arange(self.grid) * options.duration / self.grid
        self.basis = _basis(options.harmonics, options.duration, even)
        taken = np.linspace(0, self.grid, options.samples, endpoint=False).astype(int)
        self.taken = taken

    def coefficients(self, candidates: Array) -> tuple[Array, Array, Array]:
        """centre (c, n), sine and cosine (c, n, h), each joint scaled to a share of its first limit."""
        shaped = candidates.reshape(len(candidates), self.n, 2 * self.h + 2)
        # With equal weights the fastest sine would use up the limits.
        order = 1.0 / np.array(self.options.harmonics)
        sine, cosine = shaped[..., : self.h] * order, shaped[..., self.h : 2 * self.h] * order
        q, qd, qdd = (sine @ s + cosine @ c for s, c in self.basis)
        high, low = q.max(axis=-1), q.min(axis=-1)
        swing = 0.5 * (high - low)
        reach = [
            swing / self.half,
            np.abs(qd).max(axis=-1) / self.speed,
            np.abs(qdd).max(axis=-1) / self.acceleration,
        ]
        fill = 1.0 / (1.0 + np.exp(-shaped[..., -2] - FILL))
        scale = fill / np.maximum(np.max(reach, axis=0), 1e-12)
        room = self.half - scale * swing
        place = np.tanh(shaped[..., -1])
        centre = self.middle - scale * 0.5 * (high + low) + place * room
        return centre, sine * scale[..., None], cosine * scale[..., None]

    def motion(self, candidate: Array) -> SineSum:
        centre, sine, cosine = self.coefficients(candidate)
        return SineSum(self.options.duration, self.options.harmonics, centre[0], sine[0], cosine[0])

    def states(self, candidates: Array) -> tuple[Array, Array, Array]:
        """(c, samples, n) each of position, speed and acceleration."""
        centre, sine, cosine = self.coefficients(candidates)
        moved = [sine @ s[:, self.taken] + cosine @ c[:, self.taken] for s, c in self.basis]
        q, qd, qdd = (np.swapaxes(x, -1, -2) for x in moved)
        return q + centre[:, None], qd, qdd


class _Judge:
    """Scores of candidates: smaller is better."""

    def __init__(self, model: Regressor, space: _Space, options: ExciteOptions) -> None:
        self.model, self.space, self.options = model, space, options
        self.columns: NDArray[np.intp] | slice = (
            slice(None) if options.columns is None else np.array(options.columns)
        )

    def __call__(self, candidates: Array) -> Array:
        return (
            self.condition(candidates) if self.options.objective == "condition" else self.log_det(candidates)
        )

    def condition(self, candidates: Array) -> Array:
        """(c,) condition numbers, from the Gram matrix of unit columns: exact enough up to 1e7."""
        gram, _ = self._gram(candidates)
        values = np.linalg.eigvalsh(gram)
        return np.asarray(np.sqrt(values[:, -1] / np.maximum(values[:, 0], 1e-15 * values[:, -1])))

    def log_det(self, candidates: Array) -> Array:
        """(c,) minus the log determinant of the Gram matrix."""
        gram, lengths = self._gram(candidates)
        _, logs = np.linalg.slogdet(gram)
        return np.asarray(-(logs + 2.0 * np.sum(np.log(lengths), axis=-1)))

    def _gram(self, candidates: Array) -> tuple[Array, Array]:
        stack = self.model.regressor(*self.space.states(candidates))[..., self.columns]
        rows = stack.reshape(len(candidates), -1, stack.shape[-1])
        gram = np.swapaxes(rows, -1, -2) @ rows
        lengths = np.sqrt(np.maximum(np.diagonal(gram, axis1=-2, axis2=-1), 1e-300))
        return gram / (lengths[:, :, None] * lengths[:, None, :]), lengths


def _basis(harmonics: tuple[int, ...], duration: float, time_: Array) -> list[tuple[Array, Array]]:
    """(sine, cosine) rows (h, N) of position, speed and acceleration."""
    w = 2.0 * np.pi * np.array(harmonics)[:, None] / duration
    s, c = np.sin(w * time_), np.cos(w * time_)
    return [(s, c), (w * c, -w * s), (-(w**2) * s, -(w**2) * c)]
