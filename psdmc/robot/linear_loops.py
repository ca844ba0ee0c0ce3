"""Closed loops that make joints follow others linearly, such as parallelograms. Their joints get shared coordinates.

In a parallelogram, the position of some joints is a sum of the positions of the others, each with a whole ratio, plus an
offset. The loop is then closed in all positions, and needs no constraint forces. psdmc finds the ratios where the loop is
closed, from the derivatives of its error. It then tests at random positions whether the loop stays closed.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from psdmc.errors import InputError
from psdmc.reproducible import cosine, cross, sine, times
from psdmc.robot.coordinates import Coordinate
from psdmc.robot.limits import shown
from psdmc.robot.mechanism import Array, Loop, Mechanism, NamedFrame, Placement

STEPS, STARTS, TESTS, SEED = 40, 24, 24, 29_013
"""Newton steps, starts near a singular position, random positions of the test, and the seed of both."""

NEAR = 0.4
"""rad or m: starts are at most this far from q = 0."""

STEP = 1e-6
"""rad or m: step of the difference quotients. Their error, about 1e-10, only slows Newton's method down."""

DEPENDENT = 1e-5
"""Entry of an eliminated Jacobian, relative to its largest entry, that counts as zero."""

CLOSED = 1e-10
"""rad or m: error of a closed loop."""

WHOLE = 1e-4
"""Largest distance of a ratio from a whole number: difference quotients at a closed position are more exact."""

QUARTER = math.pi / 2


class Relations(NamedTuple):
    """Equations rows @ q = offsets between the coordinates of joints.

    rows     (k, columns) ratios; each row has a column in which it has a one and all others zeros
    offsets  (k,) rad or m
    pivots   k, these columns
    """

    rows: Array
    offsets: Array
    pivots: tuple[int, ...]


def with_linear_loops(robot: Mechanism, follows: Sequence[Sequence[str] | None], source: str) -> Mechanism:
    """Return the robot without the loops that close linearly. The joints of these loops follow other joints instead.

    Of the joints of a loop, those far from the base follow those near the base, where the motors usually are. Joints that
    a loop calls passive follow before all others.

    follows  for each loop, the names of joints that must follow; empty: the loop stays; None: psdmc chooses

    Raises InputError if a joint cannot follow.
    """
    columns = tuple(i for i in robot.own_joints if robot.joints[i].type.about_z)
    if len(robot.loops) > len(columns):
        return robot  # an error for whoever closes them
    named = {name for names in follows for name in names or ()}
    first = named | {robot.joints[i].name for loop in robot.loops for i in loop.passive}
    depths = [len(robot.path_to(i)) for i in range(len(robot))]
    order = sorted(
        range(len(columns)),
        key=lambda k: (robot.joints[columns[k]].name in first, depths[columns[k]], columns[k]),
        reverse=True,
    )
    known = Relations(np.zeros((0, len(columns))), np.zeros(0), ())
    kept: list[Loop] = []
    linear: list[Loop] = []
    for loop, names in zip(robot.loops, follows, strict=True):
        own = None if names is not None and not names else _linear(robot, loop, columns, order)
        more = None if own is None else _joined(known, own, order)
        if more is None:
            kept.append(loop)
            if names:
                raise InputError(
                    f"{source}: loop {shown(loop.name)}: joints cannot follow linearly: the loop is no parallelogram",
                    "leave `follows` out",
                )
            continue
        known = more
        linear.append(loop)
    if not linear:
        return robot
    found = {}
    for row, offset, pivot in zip(known.rows, known.offsets.tolist(), known.pivots, strict=True):
        shares = [(columns[k], -row[k]) for k in np.flatnonzero(row).tolist() if k != pivot]
        found[columns[pivot]] = _sum(shares, offset)
    if kept:  # a passive joint that follows none may belong to one of these
        passive = {i for loop in robot.loops for i in loop.passive} - {*found}
        kept = [replace(loop, passive=() if k else tuple(sorted(passive))) for k, loop in enumerate(kept)]
    mimics = {robot.joints[i].name for i in found}
    strange = (named if kept else first) - mimics
    if strange:
        raise InputError(
            f"{source}: loops: joint {shown(min(strange))} cannot follow others: found {', '.join(sorted(mimics))}",
            "name joints of the parallelogram, and leave as many others as it has degrees of freedom",
        )
    coordinates = tuple(_composed(coordinate, found) for coordinate in robot.coordinates)
    notes = (_note(robot, linear, coordinates),)
    return replace(robot, coordinates=coordinates, loops=tuple(kept), notes=(*robot.notes, *notes))


def _sum(shares: Sequence[tuple[int, float]], offset: float) -> Coordinate:
    """The coordinate of a joint that follows the sum of several, each with its ratio."""
    (leader, ratio), *others = shares
    return Coordinate(leader, float(ratio), offset, tuple((k, float(each)) for k, each in others))


def _composed(coordinate: Coordinate, found: Mapping[int, Coordinate]) -> Coordinate:
    """The coordinate in terms of joints that follow none."""
    offset, sums = coordinate.offset, dict[int, float]()
    for leader, ratio in coordinate.shares:
        target = found.get(leader, Coordinate(leader))
        offset += ratio * target.offset
        for k, share in target.shares:
            sums[k] = sums.get(k, 0.0) + ratio * share
    shares = [(k, ratio) for k, ratio in sorted(sums.items()) if ratio != 0.0]
    return _sum(shares, offset) if shares else Coordinate(None, 1.0, offset)


def _note(robot: Mechanism, loops: Sequence[Loop], coordinates: Sequence[Coordinate]) -> str:
    names = ", ".join(f"'{loop.name}'" for loop in loops)
    sums = "; ".join(
        f"{robot.joints[i].name} = {coordinate.in_words(robot.joint_names)}"
        for i, coordinate in enumerate(coordinates)
        if coordinate != robot.coordinates[i]
    )
    return (
        f"parallelograms {names} are closed in all positions: {sums}. These joints follow as mimic joints do; "
        "follows = [] in [[loop]] keeps a loop with forces"
    )


# One loop: where it is closed, and whether it stays closed along the relations found there.
Gaps = Callable[[Array], Array]
"""From positions (states, columns) to how far the loop is from closed, in its rows, then in rotations of half a turn."""

Placements = tuple[Array, Array]
"""Rotations (3, 3, states) and translations (3, states); one state may stand for all."""


def _linear(robot: Mechanism, loop: Loop, columns: Sequence[int], order: Sequence[int]) -> Relations | None:
    """The relations between the positions of the loop's joints; None if the loop does not close linearly."""
    ends = [robot.path_to(end.joint) for end in (loop.first, loop.second)]
    moving = {*ends[0]} ^ {*ends[1]}
    place = {joint: k for k, joint in enumerate(columns)}
    shares = {i: robot.coordinates[i].shares for i in moving}
    if any(not own or any(leader not in place for leader, _ in own) for own in shares.values()):
        return None
    used = {place[leader] for own in shares.values() for leader, _ in own}
    mine = [k for k in order if k in used]

    def gaps(q: Array) -> Array:
        values = {
            i: sum((ratio * q[:, place[leader]] for leader, ratio in own), np.zeros(len(q)))
            + robot.coordinates[i].offset
            for i, own in shares.items()
        }
        first, second = (
            _placed(robot, end, path, values)
            for end, path in zip((loop.first, loop.second), ends, strict=True)
        )
        return _gaps(first, second, loop.rows)

    count, rng = len(loop.rows), np.random.default_rng(SEED)
    near = np.zeros((1 + STARTS, len(columns)))
    near[1:, mine] = rng.uniform(-NEAR, NEAR, (STARTS, len(mine)))
    rank = max(len(_eliminated(_slopes(gaps, start, count, mine), mine).pivots) for start in near)
    for k, start in enumerate(near):
        q = _assembled(gaps, start, count, mine)
        if q is None:
            continue
        found = _eliminated(_slopes(gaps, q, count, mine), mine)
        if len(found.pivots) < rank:
            continue  # a singular position: several motions lead from it
        whole = np.round(found.rows)
        if np.abs(found.rows - whole).max(initial=0.0) < WHOLE:
            offsets = np.array(
                [_wrapped(robot, columns[p], x) for p, x in zip(found.pivots, times(whole, q), strict=True)]
            )
            relations = Relations(whole, offsets, found.pivots)
            if _stays_closed(gaps, relations, mine, rng):
                return relations
        if k == 0:
            return None  # closed and regular at q = 0 of the leaders: this decides how the loop is assembled
    return None


def _placed(
    robot: Mechanism, end: NamedFrame, path: Sequence[int], values: Mapping[int, Array]
) -> Placements:
    """The end of a loop, seen from the last body that carries both ends."""
    found = _fixed(Placement.identity())
    for i in path:
        if i in values:
            joint = robot.joints[i]
            angle, height = joint.type.turn(values[i]), joint.type.slide(values[i])
            found = _moved(_moved(found, _fixed(joint.placement)), _about_z(angle, height, len(values[i])))
    return _moved(found, _fixed(end.placement))


def _fixed(placement: Placement) -> Placements:
    return placement.rotation[..., None], placement.translation[:, None]


def _moved(outer: Placements, inner: Placements) -> Placements:
    rotation, translation = outer
    return _product(rotation, inner[0]), _product(rotation, inner[1]) + translation


def _product(a: Array, b: Array) -> Array:
    """Matrices (3, 3, states) times matrices or vectors (3, ..., states), terms added in order."""
    terms: list[Array] = [(a[:, k, None] if b.ndim == 3 else a[:, k]) * b[k] for k in range(3)]
    return terms[0] + terms[1] + terms[2]


def _about_z(angle: Array | None, height: Array | None, count: int) -> Placements:
    turn, shift = np.repeat(np.eye(3)[..., None], count, axis=2), np.zeros((3, count))
    if angle is not None:
        turn[0, 0] = turn[1, 1] = cosine(angle)
        turn[1, 0] = sine(angle)
        turn[0, 1] = -turn[1, 0]
    if height is not None:
        shift[2] = height
    return turn, shift


def _gaps(first: Placements, second: Placements, rows: Sequence[int]) -> Array:
    back = np.swapaxes(first[0], 0, 1)
    turn, apart = _moved((back, -_product(back, first[1])), second)
    about = [row - 3 for row in rows if row >= 3]
    if len(about) == 2:
        (free,) = {0, 1, 2} - {*about}
        error, turned = cross(np.eye(3)[free], turn[:, free]), 1.0 - turn[free, free]
    else:
        error = np.stack([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]]) / 2.0
        turned = 3.0 - turn[0, 0] - turn[1, 1] - turn[2, 2] if about else 0.0 * apart[0]
    closed = [apart[row] if row < 3 else error[row - 3] for row in rows]
    return np.stack(np.broadcast_arrays(*closed, turned), axis=1)


def _slopes(gaps: Gaps, q: Array, count: int, moving: Sequence[int]) -> Array:
    """(count, columns) derivatives of the loop's rows, which depend on the columns `moving` only."""
    found = np.zeros((count, len(q)))
    steps = STEP * np.eye(len(q))[list(moving)]
    ahead, behind = np.split(gaps(np.vstack([q + steps, q - steps]))[:, :count], 2)
    found[:, moving] = ((ahead - behind) / (2.0 * STEP)).T
    return found


def _eliminated(rows: Array, order: Sequence[int], right: Array | None = None) -> Relations:
    """Gauss-Jordan elimination: pivots are the first possible columns of `order`. Dependent rows are left out."""
    work = np.column_stack([rows, np.zeros(len(rows)) if right is None else right])
    zero = DEPENDENT * np.abs(rows).max(initial=0.0)
    pivots: list[int] = []
    for column in order:
        top = len(pivots)
        if top == len(work):
            break
        best = top + int(np.argmax(np.abs(work[top:, column])))
        if abs(work[best, column]) <= zero:
            continue
        work[[top, best]] = work[[best, top]]
        work[top] /= work[top, column]
        for other in range(len(work)):
            if other != top:
                work[other] -= work[other, column] * work[top]
        pivots.append(column)
    return Relations(work[: len(pivots), :-1], work[:, -1], tuple(pivots))


def _assembled(gaps: Gaps, start: Array, count: int, order: Sequence[int]) -> Array | None:
    """A closed position near `start`, by Newton's method; None if there is none. The leaders stay where they are, unless
    the pivots change."""
    q = start.copy()
    for _ in range(STEPS):
        error = gaps(q[None])[0]
        is_closed = np.abs(error).max() < CLOSED
        found = _eliminated(_slopes(gaps, q, count, order), order, error[:count])
        step = found.offsets[: len(found.pivots)]
        q[list(found.pivots)] -= step * min(1.0, 0.5 / max(np.abs(step).max(initial=0.0), 1e-300))
        if is_closed:  # and with this step to the last digits
            return q
    return None


def _wrapped(robot: Mechanism, joint: int, offset: float) -> float:
    """An offset, of at most half a turn if it is an angle; multiples of a right angle are exact."""
    if robot.joints[joint].type.length_order:
        return 0.0 if abs(offset) < CLOSED else float(offset)
    angle = math.remainder(float(offset), 2.0 * math.pi)
    quarters = round(angle / QUARTER)
    return quarters * QUARTER if abs(angle - quarters * QUARTER) < CLOSED else angle


def _stays_closed(gaps: Gaps, relations: Relations, mine: Sequence[int], rng: np.random.Generator) -> bool:
    leaders = [k for k in mine if k not in relations.pivots]
    for _ in range(TESTS):
        q = np.zeros(relations.rows.shape[1])
        q[leaders] = rng.uniform(-math.pi, math.pi, len(leaders))
        q[list(relations.pivots)] = relations.offsets - times(relations.rows, q)
        if np.abs(gaps(q[None])).max() > 10.0 * CLOSED:
            return False
    return bool(leaders)


def _joined(known: Relations, own: Relations, order: Sequence[int]) -> Relations | None:
    """All relations, eliminated together; None if they contradict each other, or hold a joint at one position."""
    rows, right = np.vstack([known.rows, own.rows]), np.append(known.offsets, own.offsets)
    found = _eliminated(rows, order, right)
    count = len(found.pivots)
    rest = [math.remainder(x, 2.0 * math.pi) for x in found.offsets[count:].tolist()]
    if np.abs(rest).max(initial=0.0) > 10.0 * CLOSED or (np.count_nonzero(found.rows, axis=1) < 2).any():
        return None
    return Relations(found.rows, found.offsets[:count], found.pivots)
