"""Base parameters of mechanisms with closed loops: combinations that the torques of the motors identify, by numerical rank.

The base parameters of a model are those of the open tree. The motors of a closed mechanism move fewer coordinates, and feel
the links only through the motion that the loops allow. So their torques depend on fewer combinations. psdmc computes the
regressor Y of the tree at random states that satisfy the loops, and projects its rows onto the motion that the loops allow.
For a matrix N whose columns span this motion, N^T Y theta_b determine the motors' torques. The count is therefore the
same for all choices of passive joints.

Source: Gautier, Numerical calculation of the base inertial parameters of robots, Journal of Robotic Systems 8 (1991).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from psdmc.dynamics.closed_loops import ANGULAR, loop_drift, loop_error, loop_jacobian
from psdmc.dynamics.coordinates import neutral
from psdmc.dynamics.frames import Frame, frames_of
from psdmc.dynamics.manifold import integrated, restored
from psdmc.dynamics.scalar import Scalar
from psdmc.errors import InputError
from psdmc.model import evaluate
from psdmc.model.random_states import RANGES
from psdmc.reproducible import lengths, times, triangle_solved
from psdmc.robot.graded import graded_pivots, halving_shares
from psdmc.robot.limits import shown
from psdmc.robot.mechanism import Array, Loop, Mechanism, frozen_array

SEED, STARTS, STEPS = 29_199, 64, 40
"""Seed of random numbers; positions from which the loops are closed, and Newton steps of each."""

LONGEST = 0.5
"""rad or m: the largest change of a coordinate in a Newton step."""

CLOSED, STILL = 1e-11, 1e-8
"""rad or m: error of closed loops, and a Newton step after which only rounding is left of it."""

DEPENDENT, REGULAR = 1e-7, 2e-2
"""Share of a row of the loops' Jacobian that the rows before it do not explain. Below the first, the row is redundant.
Between both, the position is near a dead point, where rounding grows."""

WALK, STRIDE, CORRECTIONS = 24, 0.25, 4
"""Steps from the closed position to the random ones; rad or m of a step; at most so many Newton steps close the
loops again."""

STATES, ROWS = 32, 4
"""Random states at least; equations at least for each base parameter of the tree."""

TOLERANCE = 1e-9
"""A column depends on others where they leave less than this share of it. Rounding leaves some 1e-13."""

SMALL = 1e-10
"""Entries of the matrix below this share of the largest one of their row are zero; columns have length one."""

CLEAR = 1e4
"""Ratio of the smallest singular value kept and the largest one left out, from which the rank counts as certain."""


@dataclass(frozen=True, slots=True, eq=False)
class LoopBaseParameters:
    """The k combinations of a model's l base parameters that torques of a mechanism with closed loops identify.

    The torques are those of all joints that are not passive. They depend on theta_b only through `matrix` @ theta_b.

    matrix           (k, l) combinations, SI units; the columns `kept` are those of the identity
    kept             k ascending indices of base parameters that lead the combinations
    singular_values  (l,) of the sampled regressor, in decreasing order and relative to the first one; the columns of the
                     regressor have length one
    """

    matrix: Array
    kept: tuple[int, ...]
    singular_values: Array

    def __post_init__(self) -> None:
        l = len(self.singular_values)
        object.__setattr__(self, "matrix", frozen_array(self.matrix, (len(self.kept), l), "matrix"))
        object.__setattr__(
            self, "singular_values", frozen_array(self.singular_values, (l,), "singular_values")
        )

    @property
    def count(self) -> int:
        """Return the number of combinations, which is the numerical rank of the sampled regressor."""
        return len(self.kept)

    @property
    def gap(self) -> float:
        """Return the smallest singular value that counts, divided by the largest one that does not. If all count, the
        divisor is the rounding of double precision."""
        rounding = float(np.finfo(float).eps)
        below = float(self.singular_values[self.count]) if self.count < len(self.singular_values) else 0.0
        return float(self.singular_values[self.count - 1]) / max(below, rounding) if self.count else math.inf

    @property
    def is_clear(self) -> bool:
        """Return whether the gap is so large that rounding cannot have changed the count."""
        return self.gap > CLEAR

    def combinations(self) -> tuple[str, ...]:
        """Return each combination as text, such as 'theta_b[0] - 0.5 theta_b[3]'."""
        return tuple(_as_text(row) for row in self.matrix)

    def __str__(self) -> str:
        l = len(self.singular_values)
        words = f"{self.count} of {l} base parameters can be identified from the motors' torques (by numerical rank"
        if self.count == l:
            return f"{words}: smallest singular value {self.singular_values[-1]:.1g} of the largest)"
        kept, left = self.singular_values[self.count - 1 : self.count + 1]
        fall = f"singular values fall from {kept:.1g} to {'below 1e-12' if left < 1e-12 else format(left, '.1g')}"
        return f"{words}: {fall})" if self.is_clear else f"{words}, which is uncertain: {fall})"


def _as_text(row: Array) -> str:
    factors = [f"{abs(value):.6g}" for value in row.tolist()]
    text = " ".join(
        f"{'-' if row[k] < 0.0 else '+'} {'' if factor == '1' else factor + ' '}theta_b[{k}]"
        for k, factor in enumerate(factors)
        if row[k]
    )
    return text[2:] if text.startswith("+ ") else f"-{text[2:]}"


def loop_base_parameters(robot: Mechanism, representative: Array) -> LoopBaseParameters:
    """Return the combinations of base parameters that the motors' torques identify, for positions near the zero position of
    the robot, in the same assembly. Without loops, these are all base parameters.

    representative  (11n, l)  matrix from base parameters to standard parameters

    Raises InputError if no closed position of the loops is found.
    """
    l = representative.shape[1]
    rows, whole = _sampled(robot, representative)
    norms, longest = lengths(rows), lengths(whole)
    hidden = norms <= TOLERANCE * longest
    scale = np.where(hidden, 1.0, norms)
    rows = np.where(hidden, 0.0, rows / scale)
    values = np.linalg.svd(rows, compute_uv=False)
    work = rows.copy()
    found, _, _ = graded_pivots(work, np.where(hidden, 0.0, 1.0), halving_shares(TOLERANCE))
    pivots, top = np.array(found, dtype=np.int64), work[: len(found)]
    matrix = triangle_solved(top[:, pivots], top)
    matrix[np.abs(matrix) < SMALL * np.abs(matrix).max(axis=1, keepdims=True, initial=0.0)] = 0.0
    matrix *= scale / scale[pivots][:, None]
    matrix[:, pivots] = np.eye(len(pivots))
    order = np.argsort(pivots)
    kept = tuple(pivots[order].tolist())
    return LoopBaseParameters(matrix[order], kept, values[:l] / (values[0] if len(found) else 1.0))


def _sampled(robot: Mechanism, representative: Array) -> tuple[Array, Array]:
    """The regressor of the closed mechanism and that of the tree, (nv * states, l), at random states that satisfy the
    loops."""
    frames, nv, l = frames_of(robot), robot.nv, representative.shape[1]
    free = max(1, nv - sum(len(loop.rows) for loop in robot.loops))
    count = max(STATES, -(-ROWS * l // free))
    rng = np.random.default_rng(SEED)
    q = _closed_positions(robot, frames, rng, count)
    qd, qdd = (limit * rng.uniform(-1.0, 1.0, (nv, count)) for limit in RANGES[1:])
    blocked = _jacobian(robot, frames, q)
    qd = _allowed(robot.loops, blocked, np.zeros(blocked.shape[::2]), qd).motion
    drift = _over(loop_drift(frames, robot.loops, list(q), list(qd)), count)
    allowed = _allowed(robot.loops, blocked, drift, qdd)
    wanted = np.flatnonzero(representative.any(axis=1))
    tree = evaluate.link_regressor(robot, wanted.tolist(), [q.T, qd.T, allowed.motion.T])
    closed = tree.transpose(1, 2, 0).copy()  # rate, parameter, state
    for direction in allowed.basis:
        share = np.add.reduce(direction[:, None] * closed)
        closed -= direction[:, None] * share
    both = (closed.transpose(2, 0, 1), tree)
    rows, whole = (times(part.reshape(-1, len(wanted)), representative[wanted]) for part in both)
    return rows, whole


# Positions that close the loops. Arrays have the states along their last axis.


class _Allowed(NamedTuple):
    """Motion that the loops allow, at several states.

    motion  (nv, states) rates x, nearest to the wanted ones, with J x + bias = 0
    basis   (rows, nv, states) orthonormal directions that the loops block; zero for a redundant row
    share   (states,) the smallest share of a row that the rows before it do not explain; redundant rows do not count
    """

    motion: Array
    basis: Array
    share: Array


def _allowed(loops: Sequence[Loop], rows: Array, bias: Array, wanted: Array) -> _Allowed:
    """Motion that loops with the Jacobian `rows` (rows, nv, states) allow, by orthonormal rows (Gram-Schmidt)."""
    sizes = np.add.reduce(rows * rows, axis=1)
    kinds = np.array([(number, row >= ANGULAR) for number, loop in enumerate(loops) for row in loop.rows])
    # A row can be zero in a dead point, so it is compared with all linear or angular rows of its loop.
    norms = [np.sqrt(np.add.reduce(sizes[(kinds == kind).all(axis=1)])) for kind in kinds]
    known: list[Array] = []
    shifts: list[Array] = []
    shares = np.ones(rows.shape[2])
    for row, norm, own in zip(rows, norms, bias, strict=True):
        rest, shift = (each / np.maximum(norm, 1e-300) for each in (row, own))
        for _ in range(2):  # twice, so that rounding of the first pass is removed, too
            for direction, other in zip(known, shifts, strict=True):
                part = np.add.reduce(direction * rest)
                rest, shift = rest - part * direction, shift - part * other
        size = np.sqrt(np.add.reduce(rest * rest))
        needed = size > DEPENDENT
        shares = np.where(needed, np.minimum(shares, size), shares)
        size = np.where(needed, size, np.inf)
        known.append(rest / size)
        shifts.append(shift / size)
    motion = wanted
    for direction, shift in zip(known, shifts, strict=True):
        motion = motion - (np.add.reduce(direction * motion) + shift) * direction
    return _Allowed(motion, np.array(known).reshape(rows.shape), shares)


def _over(values: Sequence[Scalar], count: int) -> Array:
    """(values, count) from numbers, and from arrays with a value for each state."""
    return np.array([np.broadcast_to(value, count) for value in values]).reshape(len(values), count)


def _jacobian(robot: Mechanism, frames: Sequence[Frame], q: Array) -> Array:
    rows = loop_jacobian(frames, robot.loops, list(q))
    count = q.shape[1]
    return np.array([_over(row, count) for row in rows]).reshape(len(rows), robot.nv, count)


def _moved(frames: Sequence[Frame], q: Array, step: Array) -> Array:
    return _over(restored(frames, integrated(frames, list(q), list(step))), q.shape[1])


def _newton(robot: Mechanism, frames: Sequence[Frame], q: Array) -> tuple[Array, Array, Array]:
    """q after a Newton step of all joints towards closed loops, the step's largest entry, and the share of `_Allowed`."""
    errors = _over(loop_error(frames, robot.loops, list(q)), q.shape[1])
    step, _, share = _allowed(
        robot.loops, _jacobian(robot, frames, q), errors, np.zeros((robot.nv, q.shape[1]))
    )
    size = np.abs(step).max(axis=0, initial=0.0)
    step = np.where(np.isfinite(size), step * np.minimum(1.0, LONGEST / np.maximum(size, 1e-300)), 0.0)
    return _moved(frames, q, step), size, share


def _open(robot: Mechanism, frames: Sequence[Frame], q: Array) -> Array:
    errors = _over(loop_error(frames, robot.loops, list(q)), q.shape[1])
    found: Array = np.abs(errors).max(axis=0, initial=0.0)
    return found


def _start(robot: Mechanism, frames: Sequence[Frame], rng: np.random.Generator) -> tuple[Array, float]:
    """The closed position (nq, 1) that is found from nearest to the zero position, far from dead points if possible, and
    its share."""
    zero = np.repeat(np.array(neutral(frames), dtype=np.float64)[:, None], STARTS, axis=1)
    away = math.pi * np.arange(STARTS) / STARTS
    q = _moved(frames, zero, away * rng.uniform(-1.0, 1.0, (robot.nv, STARTS)))
    with np.errstate(all="ignore"):
        for _ in range(STEPS):
            q, _, share = _newton(robot, frames, q)
            closed = _open(robot, frames, q) < CLOSED
            if closed[0] and share[0] > REGULAR:
                break
    if not closed.any():
        raise InputError(
            f"{shown(robot.name)}: no closed position of its loops is found near the zero position",
            "choose the zero positions of the joints so that the loops are nearly closed",
        )
    share = np.where(closed, share, 0.0)
    good = np.flatnonzero(share > REGULAR)
    best = int(good[0]) if len(good) else int(np.argmax(share))
    return q[:, best : best + 1], float(share[best])


def _closed_positions(
    robot: Mechanism, frames: Sequence[Frame], rng: np.random.Generator, count: int
) -> Array:
    """Random positions (nq, count) that close the loops.

    Each is the end of a walk in small steps, which never leaves the assembly of the first position. A parallelogram stays
    one, for example, and does not become a crossed one.
    """
    first, share = _start(robot, frames, rng)
    q = np.repeat(first, count, axis=1)
    least = min(REGULAR, 0.5 * share)
    goal = rng.uniform(-1.0, 1.0, (robot.nv, count))
    stride = np.full(count, STRIDE)
    none = np.zeros((sum(len(loop.rows) for loop in robot.loops), count))
    with np.errstate(all="ignore"):
        for _ in range(WALK):
            wanted = goal + 0.5 * rng.uniform(-1.0, 1.0, goal.shape)
            motion = _allowed(robot.loops, _jacobian(robot, frames, q), none, wanted).motion
            motion *= stride / np.maximum(np.abs(motion).max(axis=0, initial=0.0), 1e-300)
            there, size, shares = _newton(robot, frames, _moved(frames, q, motion))
            fits = (size < 0.25 * stride) & (shares > least)
            for _ in range(CORRECTIONS):
                there, size, _ = _newton(robot, frames, there)
                if not (size[fits] > STILL).any():
                    break
            fits &= (size < STILL) & (_open(robot, frames, there) < CLOSED)
            q = np.where(fits, there, q)
            goal = np.where(fits, goal, -goal)
            stride = np.where(fits, np.minimum(STRIDE, 1.5 * stride), 0.5 * stride)
    return q
