"""Checks that the closed loops of a mechanism can be assembled, and that no closed row is redundant.

Both are found at configurations in which all loops are closed, by Newton's method from random ones. A row is redundant
if its row of the Jacobian depends on the other rows in all of these configurations. Contact forces would not be unique.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from psdmc.derivation.scaled import length_unit
from psdmc.dynamics.closed_loops import loop_error, loop_jacobian
from psdmc.dynamics.frames import frames_of
from psdmc.dynamics.manifold import integrated, restored
from psdmc.errors import InputError
from psdmc.model.evaluate import columns
from psdmc.model.random_states import states_of
from psdmc.robot.mechanism import ROW_NAMES, Array, Loop, Mechanism

STARTS, STEPS, SEED = 256, 60, 29_175
"""Random configurations from which loops are closed, and Newton steps of each."""

DAMPING = 1e-6
"""Share of the error that is added to the diagonal of J J^T (Levenberg 1944), relative to the squared largest entry."""

LONGEST = 0.5
"""rad, or share of the unit of length: the largest change of a rate's coordinate in a step."""

CLOSED = 1e-11
"""rad, or share of the unit of length: error of a closed loop."""

DEPENDENT = 1e-7
"""Share of the largest row below which the part of a row that other rows do not explain is nothing."""


def require_closable(robot: Mechanism) -> Array:
    """Return configurations (states, nq) in which all loops are closed.

    Raises InputError if loops of the robot cannot be assembled, or if rows of them are redundant. Raises InputError also
    if a loop closes one rotation of several: this holds a rate to zero, but no angle.
    """
    if not robot.loops:
        return np.zeros((0, robot.nq))
    if len(robot.loops) > robot.nv:
        raise InputError(
            f"'{robot.name}': {len(robot.loops)} loops close a robot with {robot.nv} joint rates: some are redundant",
            "describe each closed loop once; a robot has at most one loop per rate",
        )
    rows = [row for loop in robot.loops for row in loop.rows]
    scales = _scales(robot)
    q, errors = _assembled(robot, scales)
    sizes = np.abs(errors).max(axis=1)
    found = sizes < CLOSED
    if not found.any():
        least = int(np.argmin(np.where(np.isnan(sizes), np.inf, sizes)))
        owners = [loop for loop in robot.loops for _ in loop.rows]
        worst = int(np.argmax(np.abs(errors[least])))
        raise InputError(
            f"'{robot.name}': loop '{owners[worst].name}' cannot be assembled: in {STARTS} tries, the smallest gap along "
            f"{ROW_NAMES[rows[worst]]} is {abs(errors[least, worst] / scales[worst]):.2g}",
            _fewer_rows(robot, owners[worst], q, owners),
        )
    q = q[found]
    _refuse_redundant(robot, q, scales)
    for loop in robot.loops:
        _refuse_one_rotation(robot, loop, q)
    return np.asarray(q)


def _fewer_rows(robot: Mechanism, loop: Loop, q: Array, owners: Sequence[Loop]) -> str:
    """Say what to change in a loop that cannot be assembled: rows in which no joint moves, and a weld in place of a pin."""
    sizes = np.nanmax(np.abs(_jacobian(robot, q)), axis=(0, 2))[[each is loop for each in owners]]
    still = [
        ROW_NAMES[row]
        for row, size in zip(loop.rows, sizes, strict=True)
        if size <= DEPENDENT * np.max(sizes)
    ]
    hint = "correct the frames of the loop, or close fewer rows"
    if still:
        hint += f": without {', '.join(still)}, which joints prevent already"
    if {3, 4, 5} <= {*loop.rows}:
        hint += "; its rows rx, ry and rz weld the frames, and a pin leaves out the one about its axis"
    return hint


def with_passive_joints(robot: Mechanism, q: Array) -> Mechanism:
    """Return the robot with passive joints, whose motion follows from that of the others.

    They have one rate for each row of the loops. If no table [[loop]] names passive joints, psdmc chooses joints of one
    coordinate. Their columns of the loops' Jacobian are as independent as possible in one of the closed configurations q
    (states, nq). If there are too few such joints, no joint is passive. Raises InputError if the motion of declared
    passive joints does not follow from that of the others.
    """
    if not robot.loops:
        return robot
    following = {joint for loop in robot.loops for joint in loop.passive} - {*robot.own_joints}
    if following:
        raise InputError(
            f"'{robot.name}': joint '{robot.joints[min(following)].name}' follows others and cannot be passive",
            "leave it out of passive in [[loop]]",
        )
    unit = length_unit(robot)
    scales = _scales(robot)
    types = [robot.joints[joint].type for joint in robot.own_joints]
    units = [unit if order else 1.0 for kind in types for order in kind.v_orders]
    rows = _jacobian(robot, q) * scales[:, None] * np.array(units)
    single = [robot.joints[joint].type.nv == 1 for joint in robot.rate_joints]
    chosen, share = _independent(rows, np.flatnonzero(single))
    declared = robot.passive_rates
    if not declared:
        if share < DEPENDENT:
            return robot
        joints = tuple(robot.rate_joints[k] for k in chosen)
        first, *others = robot.loops
        names = ", ".join(robot.joints[j].name for j in joints)
        note = (
            f"passive joints, chosen: {names}; to choose others, write passive = [...] into a table [[loop]]"
        )
        loops = (replace(first, passive=joints), *others)
        return replace(robot, loops=loops, notes=(*robot.notes, note))
    names = ", ".join(
        robot.joints[joint].name for joint in dict.fromkeys(robot.rate_joints[k] for k in declared)
    )
    hint = "name others in [[loop]]"
    if share >= DEPENDENT:
        listed = ", ".join(f'"{robot.joints[robot.rate_joints[k]].name}"' for k in chosen)
        hint = f"for example passive = [{listed}]"
    if len(declared) != len(scales):
        raise InputError(
            f"'{robot.name}': passive joints {names} have {len(declared)} rates, expected {len(scales)}: one for each row "
            "of the loops",
            hint,
        )
    if _independent(rows, np.array(declared))[1] < DEPENDENT:
        raise InputError(
            f"'{robot.name}': the motion of passive joints {names} does not follow from that of the other joints",
            hint,
        )
    return robot


def _independent(rows: Array, candidates: NDArray[np.intp]) -> tuple[list[int], float]:
    """Return as many independent columns of matrices (states, rows, nv) as they have rows, and a measure of independence.

    The measure is the smallest share of a column that those before it do not explain. The columns are those of the state
    where it is largest. In each state, the column with the largest unexplained rest is next.
    """
    best: tuple[list[int], float] = ([], 0.0)
    if len(candidates) < rows.shape[1]:
        return best
    for matrix in rows:
        rest, chosen, least = matrix[:, candidates].copy(), [], np.inf
        largest = float(np.sqrt(np.sum(rest * rest, axis=0)).max())
        if not largest:
            continue
        for _ in range(len(matrix)):
            sizes = np.sqrt(np.sum(rest * rest, axis=0))
            next_one = int(np.argmax(np.round(sizes / largest, 9)))
            least = min(least, float(sizes[next_one]) / largest)
            chosen.append(int(candidates[next_one]))
            basis = rest[:, next_one] / max(float(sizes[next_one]), 1e-300)
            rest -= basis[:, None] * np.sum(basis[:, None] * rest, axis=0)
        if least > best[1] * (1.0 + 1e-6):
            best = sorted(chosen), least
    return best


def _assembled(robot: Mechanism, scales: Array) -> tuple[Array, Array]:
    """Configurations (STARTS, nq) and their errors (STARTS, rows), multiplied by `scales`."""
    frames = frames_of(robot)
    q, _, _ = states_of(robot, np.random.default_rng(SEED), STARTS)
    with np.errstate(all="ignore"):
        for _ in range(STEPS):
            errors = _errors(robot, q) * scales
            rows = _jacobian(robot, q) * scales[:, None]
            wide = rows @ np.swapaxes(rows, 1, 2)
            largest = np.max(np.abs(wide), axis=(1, 2), initial=1e-300)
            share = DAMPING * np.minimum(1.0, np.linalg.norm(errors, axis=1)) + 1e-15
            wide += (share * largest)[:, None, None] * np.eye(len(scales))
            bad = ~np.isfinite(wide).all(axis=(1, 2)) | ~np.isfinite(errors).all(axis=1)
            wide[bad], errors[bad] = np.eye(len(scales)), 0.0
            step = -np.einsum("sij,si->sj", rows, np.linalg.solve(wide, errors[..., None])[..., 0])
            step[bad] = 0.0
            largest = np.abs(step).max(axis=1, initial=0.0)
            step *= np.minimum(1.0, LONGEST / np.maximum(largest, 1e-300))[:, None]
            q = columns(restored(frames, integrated(frames, list(q.T), list(step.T))), len(q))
        return q, _errors(robot, q) * scales


def _scales(robot: Mechanism) -> Array:
    """(rows,) factors that convert errors of the loops' rows: lengths to shares of the unit of length."""
    unit = length_unit(robot)
    return np.array([1.0 / unit if row < 3 else 1.0 for loop in robot.loops for row in loop.rows])


def _errors(robot: Mechanism, q: Array) -> Array:
    return columns(loop_error(frames_of(robot), robot.loops, list(q.T)), len(q))


def _jacobian(robot: Mechanism, q: Array) -> Array:
    rows = loop_jacobian(frames_of(robot), robot.loops, list(q.T))
    return np.stack([columns(row, len(q)) for row in rows], axis=1)


def _refuse_redundant(robot: Mechanism, q: Array, scales: Array) -> None:
    rows = _jacobian(robot, q) * scales[:, None]
    largest = np.linalg.norm(rows, axis=2).max(axis=1)
    basis: list[Array] = []
    needed: list[bool] = []
    for k in range(rows.shape[1]):
        rest = rows[:, k].copy()
        for _ in range(2):  # twice, so that rounding of the first pass is removed, too
            for known in basis:
                rest -= np.sum(rest * known, axis=1, keepdims=True) * known
        size = np.linalg.norm(rest, axis=1)
        needed.append(bool(np.any(size > DEPENDENT * largest)))
        if needed[-1]:
            basis.append(rest / np.maximum(size, 1e-300)[:, None])
    if all(needed):
        return
    redundant, kept, first = [], [], 0
    for loop in robot.loops:
        own = list(zip(loop.rows, needed[first : first + len(loop.rows)], strict=True))
        first += len(own)
        lost = [ROW_NAMES[row] for row, is_needed in own if not is_needed]
        if lost:
            left = ", ".join(f'"{ROW_NAMES[row]}"' for row, is_needed in own if is_needed)
            redundant.append(f"{', '.join(lost)} of loop '{loop.name}'")
            kept.append(f"rows = [{left}] in loop '{loop.name}'" if left else f"no loop '{loop.name}'")
    raise InputError(
        f"'{robot.name}': redundant rows: {'; '.join(redundant)}: joints and other rows prevent these motions already",
        f"leave them out: {'; '.join(kept)}",
    )


def _refuse_one_rotation(robot: Mechanism, loop: Loop, q: Array) -> None:
    """InputError if a loop closes one rotation, and its frames can turn about several axes."""
    closed = [row for row in loop.rows if row >= 3]
    if len(closed) != 1:
        return
    whole = Loop(loop.name, loop.first, loop.second, tuple(range(6)))
    turns = _jacobian(replace(robot, loops=(whole,)), q)[:, 3:]
    others = np.delete(turns, closed[0] - 3, axis=1)
    if np.abs(others).max() > DEPENDENT * np.abs(turns).max():
        raise InputError(
            f"'{robot.name}': loop '{loop.name}' closes {ROW_NAMES[closed[0]]} alone, and its frames turn about other axes, "
            "too: this holds no angle",
            "close two rotations, as a hinge does, or three, or none",
        )
