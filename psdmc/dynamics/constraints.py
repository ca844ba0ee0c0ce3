"""Computes contact forces of a robot, and the Jacobian of its contacts and closed loops.

A contact is a named frame whose acceleration the world prescribes, such as a foot. The rows of the Jacobian are first
those of the contacts, then those of the loops.

Sources: Featherstone 2008, chapters 8 and 11; Carpentier, Budhiraja and Mansard 2021."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from psdmc.dynamics.closed_loops import loop_error_slopes, loop_jacobian, loop_pushes, loop_slopes
from psdmc.dynamics.coordinates import both_summed, first_rates, on_coordinates
from psdmc.dynamics.frames import Frame, as_vector
from psdmc.dynamics.kinematics import (
    AT_BASE,
    Root,
    frame_acceleration_slopes,
    frame_accelerations,
    frame_jacobians,
    path_to,
    twists_along,
)
from psdmc.dynamics.scalar import Scalar, add, cross, dot
from psdmc.dynamics.solve import (
    Factors,
    factorize,
    half_products,
    half_solved,
    inner_product,
    less,
    plus,
    product,
    rest_solved,
    solve,
)
from psdmc.robot.mechanism import Loop, NamedFrame

Rows = Sequence[Sequence[Scalar]]


def contact_jacobian(
    frames: Sequence[Frame], named: Sequence[NamedFrame], q: Sequence[Scalar], root: Root = AT_BASE
) -> list[list[Scalar]]:
    """Compute the Jacobian's rows of all contacts, nv entries each, along the base's axes.

    The first three rows of a contact are the linear velocity of its origin. A surface contact has three more rows, its
    angular velocity.
    """
    found = zip(named, frame_jacobians(frames, named, q, root), strict=True)
    return [row for each, rows in found for row in rows[: each.rows]]


def contact_drift(
    frames: Sequence[Frame],
    named: Sequence[NamedFrame],
    q: Sequence[Scalar],
    qd: Sequence[Scalar],
    root: Root = AT_BASE,
) -> list[Scalar]:
    """Compute the accelerations of all contacts at constant joint rates, dJ/dt qd, row by row."""
    return contact_accelerations(frames, named, q, qd, [0.0] * len(qd), root)


def contact_accelerations(
    frames: Sequence[Frame],
    named: Sequence[NamedFrame],
    q: Sequence[Scalar],
    qd: Sequence[Scalar],
    qdd: Sequence[Scalar],
    root: Root = AT_BASE,
) -> list[Scalar]:
    """Compute the accelerations of all contacts, J qdd + dJ/dt qd, row by row."""
    found = zip(named, frame_accelerations(frames, named, q, qd, qdd, root), strict=True)
    return [value for each, own in found for value in own[: each.rows]]


class Constrained(NamedTuple):
    """The accelerations and contact forces that solve M x = load + J^T f for a robot with contacts.

    motion   x, nv entries
    forces   f, one entry per row of the contact Jacobian J
    matrix   matrix A of the linear equations for f, both triangles
    factors  factors of A
    halves   for each row of J, y with L^T y = row, where M = L^T D L
    """

    motion: list[Scalar]
    forces: list[Scalar]
    matrix: Rows
    factors: Factors
    halves: Rows


def constrained(
    factors: Factors,
    jacobian: Rows,
    load: Sequence[Scalar],
    wanted: Sequence[Scalar],
    active: Sequence[Scalar],
    shift: Sequence[Scalar],
    one: Sequence[Scalar],
) -> Constrained:
    """Solve M x = load + J^T f for the motion x and the contact forces f of a robot with mass matrix M.

    J is the Jacobian of the contacts. Active rows satisfy J x + shift f = wanted. In the other rows, f is zero.

    factors  factors of M
    load     (nv) right side without contacts
    wanted   for each row of J, the prescribed value, such as an acceleration
    active   for each row of J, 1 if the contact acts, else 0
    shift    for each row, a compliance, added to the diagonal of the equations for f if the row is active
    one      for each row, the diagonal entry if the row is not active; it has the value 1 in the unit of the diagonal

    The matrix of the equations for f is J M^-1 J^T + shift in active rows, and a unit matrix in the others. Every
    choice of active rows executes the same operations.
    """
    halves = [half_solved(factors, row) for row in jacobian]
    free = half_solved(factors, load)
    matrix = of_active(half_products(factors, halves), active, shift, one)
    own = factorize(matrix)
    motion, forces = _answer(factors, own, halves, free, wanted, active)
    return Constrained(motion, forces, matrix, own, halves)


def solved_again(
    factors: Factors,
    found: Constrained,
    load: Sequence[Scalar],
    wanted: Sequence[Scalar],
    active: Sequence[Scalar],
) -> tuple[list[Scalar], list[Scalar]]:
    """Return the motion and the forces for another load and another prescribed motion."""
    free = half_solved(factors, load)
    return _answer(factors, found.factors, found.halves, free, wanted, active)


def _answer(
    factors: Factors,
    own: Factors,
    halves: Rows,
    free: Sequence[Scalar],
    wanted: Sequence[Scalar],
    active: Sequence[Scalar],
) -> tuple[list[Scalar], list[Scalar]]:
    scaled = [value * inverse for value, inverse in zip(free, factors.inverses, strict=True)]
    lacking = [
        on * (end - inner_product(half, scaled)) for on, end, half in zip(active, wanted, halves, strict=True)
    ]
    forces = solve(own, lacking)
    pushed = list(free)
    for force, half in zip(forces, halves, strict=True):
        pushed = [value + force * share for value, share in zip(pushed, half, strict=True)]
    return rest_solved(factors, pushed), forces


def of_active(
    seen: Rows, active: Sequence[Scalar], shift: Sequence[Scalar], one: Sequence[Scalar]
) -> list[list[Scalar]]:
    """Return J M^-1 J^T + shift in the active rows and columns, and the diagonal entries `one` in the others. `seen` is
    J M^-1 J^T."""
    return [
        [
            active[i] * (entry + shift[i]) + (1.0 - active[i]) * one[i]
            if i == j
            else (active[i] if active[i] is active[j] else active[i] * active[j]) * entry
            for j, entry in enumerate(row)
        ]
        for i, row in enumerate(seen)
    ]


def contact_slopes(
    frames: Sequence[Frame],
    named: Sequence[NamedFrame],
    q: Sequence[Scalar],
    qd: Sequence[Scalar],
    qdd: Sequence[Scalar],
    root: Root = AT_BASE,
) -> tuple[Rows, Rows]:
    """Compute the derivatives of the accelerations of all contacts, J qdd + dJ/dt qd, by q, along its tangent, and by
    qd. Each has the rows of `contact_jacobian`."""
    found = frame_acceleration_slopes(frames, named, q, qd, qdd, root)
    by_q, by_qd = (
        [row for each, rows in zip(named, block, strict=True) for row in rows[: each.rows]]
        for block in (found.by_q, found.by_qd)
    )
    return by_q, by_qd


@on_coordinates(both_summed)
def pushed_slopes(
    frames: Sequence[Frame],
    named: Sequence[NamedFrame],
    q: Sequence[Scalar],
    forces: Sequence[Scalar],
    root: Root = AT_BASE,
) -> list[list[Scalar]]:
    """Compute the derivatives of J^T f by q, along its tangent: nv x nv. The contact forces f are constant along the axes
    of the base.

    Joint i moves the contact along the twist (v, z) of its column of J. A force F and a moment M then have the torque
    v . F + z . M. A motion of joint j, which carries joint i or is the same, turns the twist by z_j. The derivative is
    z_j . (v_i x F + z_i x M). A motion of joint j, which joint i carries, moves the contact by v_j. The derivative is
    z_i . (v_j x F).
    """
    first, used = first_rates(frames), 0
    found: list[list[Scalar]] = [[0.0] * first[-1] for _ in range(first[-1])]
    for each, rows in zip(named, frame_jacobians(frames, named, q, root), strict=True):
        if not each.rows:
            continue
        own = list(forces[used : used + each.rows])
        used += each.rows
        force, moment = as_vector(own[:3]), as_vector(own[3:]) if each.rows > 3 else None
        path = path_to(frames, each.joint)
        numbers, twists = twists_along(path, frames, first, rows)
        pushed = {k: cross(along, force) for k, (along, _) in twists.items()}
        bent = {
            k: pushed[k] if moment is None else add(pushed[k], cross(about, moment))
            for k, (_, about) in twists.items()
        }
        for place, joint in enumerate(path):
            inner = [k for other in path[: place + 1] for k in numbers[other]]
            outer = [k for other in path[place + 1 :] for k in numbers[other]]
            for i in numbers[joint]:
                for j in inner:
                    found[i][j] = found[i][j] + dot(twists[j][1], bent[i])
                for j in outer:
                    found[i][j] = found[i][j] + dot(twists[i][1], pushed[j])
    return found


class Response(NamedTuple):
    """How a robot on its active contacts responds to a small change of its load r and of the prescribed motion w of
    the contacts.

    With the changes dr and dw, the equations M x - J^T f = r and J x + shift f = w change by
    dx = inverse dr + push^T dw, and df = compliance dw - push dr.

    inverse     nv x nv, the inverse mass matrix on the contacts
    push        a row per row of J, nv columns
    compliance  the inverse of J M^-1 J^T + shift in the active rows and columns, zero in the others
    """

    inverse: list[list[Scalar]]
    push: list[list[Scalar]]
    compliance: list[list[Scalar]]


def response(inverse: Rows, jacobian: Rows, compliance: Rows) -> Response:
    """Return the response from M^-1, J, and the inverse of J M^-1 J^T + shift, with zeros where a row is not active."""
    seen = [[inner_product(row, column) for column in inverse] for row in jacobian]
    push = product(compliance, seen)
    held = less(inverse, product(list(zip(*push, strict=True)), seen))
    return Response(held, push, [list(row) for row in compliance])


def changed(own: Response, load: Rows, wanted: Rows) -> tuple[list[list[Scalar]], list[list[Scalar]]]:
    """Return dx (nv rows) and df from the changes dr (nv rows) and dw of a `Response`, with a column per change."""
    kicked, asked = product(own.inverse, load), product(list(zip(*own.push, strict=True)), wanted)
    held, lost = product(own.compliance, wanted), product(own.push, load)
    return plus(kicked, asked), less(held, lost)


class Constraints(NamedTuple):
    """The contacts and the closed loops of a robot.

    frames  joint frames
    named   the named frames, some of which are contacts
    loops   the closed loops
    root    the axes and the origin to which the first joint's placement refers
    """

    frames: Sequence[Frame]
    named: Sequence[NamedFrame]
    loops: Sequence[Loop] = ()
    root: Root = AT_BASE

    @property
    def contact_rows(self) -> int:
        """The number of rows of all contacts."""
        return sum(each.rows for each in self.named)

    def jacobian(self, q: Sequence[Scalar]) -> list[list[Scalar]]:
        """Return the Jacobian's rows, nv entries each."""
        rows = contact_jacobian(self.frames, self.named, q, self.root)
        if self.loops:
            rows += loop_jacobian(self.frames, self.loops, q, self.root)
        return rows

    def slopes(
        self,
        q: Sequence[Scalar],
        qd: Sequence[Scalar],
        qdd: Sequence[Scalar],
        of_loops: Sequence[Scalar] | None = None,
    ) -> tuple[list[list[Scalar]], list[list[Scalar]]]:
        """Return the derivatives of J qdd + dJ/dt qd by q, along its tangent, and by qd.

        of_loops  accelerations in the loops' rows; left out: qdd
        """
        by_q, by_qd = contact_slopes(self.frames, self.named, q, qd, qdd, self.root)
        if not self.loops:
            return list(map(list, by_q)), list(map(list, by_qd))
        own = loop_slopes(self.frames, self.loops, q, qd, qdd if of_loops is None else of_loops, self.root)
        return [*map(list, by_q), *own[0]], [*map(list, by_qd), *own[1]]

    def drawn_closed(self, by_q: list[list[Scalar]], q: Sequence[Scalar], kp: Scalar) -> list[list[Scalar]]:
        """Return `by_q` with kp times the derivatives of the loops' errors added to the loops' rows."""
        if not self.loops:
            return by_q
        first, own = self.contact_rows, loop_error_slopes(self.frames, self.loops, q, self.root)
        held = [
            [x + kp * y for x, y in zip(*rows, strict=True)] for rows in zip(by_q[first:], own, strict=True)
        ]
        return [*by_q[:first], *held]

    def pushes(self, q: Sequence[Scalar], forces: Sequence[Scalar]) -> list[list[Scalar]]:
        """Return the derivatives of J^T f by q, along its tangent: nv x nv, at constant forces f."""
        first = self.contact_rows
        turn = pushed_slopes(self.frames, self.named, q, forces[:first], self.root)
        if not self.loops:
            return turn
        own = loop_pushes(self.frames, self.loops, q, forces[first:], self.root)
        return plus(turn, own)
