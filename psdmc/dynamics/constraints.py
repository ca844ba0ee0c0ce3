"""Contacts and closed loops are rows of one Jacobian: first the rows of the contacts, then those of the loops."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from psdmc.dynamics import contacts
from psdmc.dynamics.closed_loops import loop_jacobian
from psdmc.dynamics.frames import Frame
from psdmc.dynamics.kinematics import AT_BASE
from psdmc.dynamics.loop_slopes import loop_error_slopes, loop_pushes, loop_slopes
from psdmc.dynamics.named_frames import Root
from psdmc.dynamics.scalar import Scalar
from psdmc.robot.mechanism import Loop, NamedFrame

Rows = list[list[Scalar]]


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

    def jacobian(self, q: Sequence[Scalar]) -> Rows:
        """Return the Jacobian's rows, nv entries each."""
        rows = contacts.contact_jacobian(self.frames, self.named, q, self.root)
        if self.loops:
            rows += loop_jacobian(self.frames, self.loops, q, self.root)
        return rows

    def slopes(
        self,
        q: Sequence[Scalar],
        qd: Sequence[Scalar],
        qdd: Sequence[Scalar],
        of_loops: Sequence[Scalar] | None = None,
    ) -> tuple[Rows, Rows]:
        """Return the derivatives of J qdd + dJ/dt qd by q, along its tangent, and by qd.

        of_loops  accelerations in the loops' rows; left out: qdd
        """
        by_q, by_qd = contacts.contact_slopes(self.frames, self.named, q, qd, qdd, self.root)
        if not self.loops:
            return list(map(list, by_q)), list(map(list, by_qd))
        own = loop_slopes(self.frames, self.loops, q, qd, qdd if of_loops is None else of_loops, self.root)
        return [*map(list, by_q), *own[0]], [*map(list, by_qd), *own[1]]

    def drawn_closed(self, by_q: Rows, q: Sequence[Scalar], kp: Scalar) -> Rows:
        """Return `by_q` with kp times the derivatives of the loops' errors added to the loops' rows."""
        if not self.loops:
            return by_q
        first, own = self.contact_rows, loop_error_slopes(self.frames, self.loops, q, self.root)
        held = [
            [x + kp * y for x, y in zip(*rows, strict=True)] for rows in zip(by_q[first:], own, strict=True)
        ]
        return [*by_q[:first], *held]

    def pushes(self, q: Sequence[Scalar], forces: Sequence[Scalar]) -> Rows:
        """Return the derivatives of J^T f by q, along its tangent: nv x nv, at constant forces f."""
        first = self.contact_rows
        turn = contacts.pushed_slopes(self.frames, self.named, q, forces[:first], self.root)
        if not self.loops:
            return turn
        own = loop_pushes(self.frames, self.loops, q, forces[first:], self.root)
        return [[x + y for x, y in zip(*rows, strict=True)] for rows in zip(turn, own, strict=True)]
