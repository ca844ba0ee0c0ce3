"""Computes joint accelerations from torques by articulated bodies (Featherstone 2008, 7.3).

The articulated inertia of a body is the wrench per unit acceleration that it needs if the joints after it are free to
move. A first sweep from the base outward computes each body's motion for zero joint accelerations. A second sweep,
inward, computes the wrench that this motion requires, and the articulated inertia of each body with all bodies that it
carries. Each joint torque balances the part of the wrench along its axis, and the rest acts on the parent. A third
sweep, outward, computes the joint accelerations.

The number of operations per joint is fixed. With a factorized mass matrix, it grows with the square of the number of
joints that carry a body. Articulated bodies take fewer operations on long limbs.

The derivatives of a floating base's linear acceleration by its orientation and linear velocity need no dynamics
(`known_derivatives`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

from psdmc.dynamics.choices import PLAIN, Choices
from psdmc.dynamics.coordinates import as_tuple, first_rates, flat, has_mimic_joints, positions, rates
from psdmc.dynamics.frames import (
    BASE,
    Frame,
    Rotation,
    Turn,
    from_previous,
    handed_on,
    handed_vector,
    joint_turn,
    outward,
)
from psdmc.dynamics.motion import Forward, sweep_outward
from psdmc.dynamics.newton_euler import NO_WRENCHES, Wrench, seen_bodies, sweep_inward
from psdmc.dynamics.scalar import ZERO, Matrix, Scalar, Vector, add, cross, multiply, transpose
from psdmc.dynamics.solve import Factors, SingularMatrix, factorize, inner_product, solve
from psdmc.dynamics.spatial import (
    PLACES,
    Body,
    Six,
    combined,
    efforts,
    full,
    half,
    spun_matrix,
    spun_six,
    weighted,
)

Accelerations = tuple[list[Scalar], tuple[Scalar, ...]]
"""nv accelerations, and the nv pivots of the mass matrix."""


def forward_dynamics(
    frames: Sequence[Frame],
    bodies: Sequence[Body],
    drive_inertia: Sequence[Scalar],
    q: Sequence[Scalar],
    qd: Sequence[Scalar],
    tau: Sequence[Scalar],
    base: Vector,
    choices: Choices = PLAIN,
    external: Mapping[int, Wrench] = NO_WRENCHES,
) -> Accelerations:
    """Compute joint accelerations from torques, and the pivots of the mass matrix.

    The pivots are those of a factorization of the mass matrix. All are positive if the matrix is positive definite. The
    other arguments are those of `inverse_dynamics`. There may be no mimic joints. Raises SingularMatrix if a pivot is a
    constant that is not positive.
    """
    if has_mimic_joints(frames):
        raise ValueError("a joint that follows another: its acceleration is not its own")
    still = [0.0] * first_rates(frames)[-1]
    forward = sweep_outward(frames, q, qd, None, still, base, choices)
    seen = seen_bodies(frames, bodies, q, forward, choices)
    inward = _Inward(frames, seen, drive_inertia, forward, rates(frames, tau))
    sweep_inward(frames, seen, drive_inertia, still, forward, choices, external, inward.yielded)
    return _swept_outward(frames, forward, inward.held), flat(joint.pivots for joint in inward.held)  # type: ignore[return-value]


@dataclass(frozen=True, slots=True)
class _Held:
    """Terms from which a joint's acceleration follows: that of `own`, minus the part of its frame's acceleration.

    own      nv accelerations if the frame before it did not accelerate besides
    loads    nv of six: the joint's own acceleration per unit of the frame's
    pivots   nv, as `factorize` has them
    along    the number of the frame's six accelerations that is the joint's own; None: none is, or it has a drive
    """

    own: list[Scalar]
    loads: list[list[Scalar]]
    pivots: tuple[Scalar, ...]
    along: int | None


@dataclass(slots=True)
class _Inward:
    """The inward sweep: articulated bodies so far, and what is known of each joint, children before parents."""

    frames: Sequence[Frame]
    bodies: Sequence[Body]
    drives: Sequence[Scalar]
    forward: Forward
    torques: Sequence[Scalar]
    beyond: dict[int, Articulated] = field(default_factory=dict)
    found: dict[int, _Held] = field(default_factory=dict)

    @property
    def held(self) -> list[_Held]:
        """Joint by joint."""
        return [self.found[i] for i in range(len(self.frames))]

    def yielded(self, i: int, needed: Sequence[Scalar]) -> Wrench:
        """Return the wrench on the parent that results from the acceleration of joint i, and store what the next sweep
        needs.

        The joint accelerates because its torques differ from `needed`, the torques for constant joint rates.
        """
        frame, whole = self.frames[i], rigid(self.bodies[i])
        if i in self.beyond:
            whole = both(whole, self.beyond[i])
        given = as_tuple(self.torques[i])
        left = [tau - own for tau, own in zip(given, needed, strict=True)]
        # With I the articulated inertia and S the joint's axes: the columns U = I S, factors of D = S^T U, and D^-1 left.
        rows = rows_of(whole)
        columns = [[weighted((*v, *w), row) for row in rows] for v, w in frame.joint.twists]
        factors = self._factors(i, columns)
        drive = self.drives[i]
        along = _along(frame) if isinstance(drive, float) and drive == 0.0 else None
        own = solve(factors, left)
        if frame.parent == BASE:
            self.found[i] = _Held(own, [], factors.pivots, along)
            return ZERO, ZERO
        solved = [solve(factors, [column[k] for column in columns]) for k in range(6)]
        loads = [list(row) for row in zip(*solved, strict=True)]
        self.found[i] = _Held(own, loads, factors.pivots, along)
        # Seen through the joint: I - U D^-1 U^T, its upper triangle; exactly nothing is left along the joint.
        relieved = [
            [
                0.0
                if b < a or along in (a, b)
                else rows[a][b] - inner_product([c[a] for c in columns], [load[b] for load in loads])
                for b in range(6)
            ]
            for a in range(6)
        ]
        self._hand_on(i, from_rows(relieved))
        total = [inner_product(own, [column[k] for column in columns]) for k in range(6)]
        return (total[0], total[1], total[2]), (total[3], total[4], total[5])

    def _factors(self, i: int, columns: Sequence[Sequence[Scalar]]) -> Factors:
        frame = self.frames[i]
        block = [list(efforts(frame.joint, (c[0], c[1], c[2]), (c[3], c[4], c[5]))) for c in columns]
        if frame.joint.about_z:
            block[0][0] = block[0][0] + self.drives[i]
        try:
            return factorize(block)
        except SingularMatrix as singular:
            raise SingularMatrix(first_rates(self.frames)[i] + singular.row) from None

    def _hand_on(self, i: int, inertia: Articulated) -> None:
        frame, state = self.frames[i], self.forward.states[i]
        if not self.forward.folded[i]:
            inertia = before_turn(inertia, state.turn)
        inertia = handed(frame, moved_to(along_parent(frame, inertia), state.offset))
        known = self.beyond.get(frame.parent)
        self.beyond[frame.parent] = inertia if known is None else both(known, inertia)


def _swept_outward(frames: Sequence[Frame], forward: Forward, held: Sequence[_Held]) -> list[Scalar]:
    """Accelerations of joints from those that frames have besides, parents before children."""
    besides: list[tuple[Vector, Vector]] = []
    found: list[Scalar] = []
    for i, (frame, joint) in enumerate(zip(frames, held, strict=True)):
        if frame.parent == BASE:
            besides.append(combined(frame.joint, joint.own))
            found += joint.own
            continue
        linear, angular = besides[frame.parent]
        linear = add(linear, cross(angular, forward.states[i].offset))
        turn = None if forward.folded[i] else forward.states[i].turn
        linear, angular = (outward(turn, from_previous(frame, v)) for v in (linear, angular))
        own, moved = _accelerated(frame, joint, (*linear, *angular))
        found += own
        besides.append(moved)
    return found


def _accelerated(
    frame: Frame, joint: _Held, before: Sequence[Scalar]
) -> tuple[list[Scalar], tuple[Vector, Vector]]:
    """A joint's accelerations, and those of its frame besides; `before`: without the joint's."""
    if joint.along is not None:
        others = [k for k in range(6) if k != joint.along]
        whole = joint.own[0] - inner_product([joint.loads[0][k] for k in others], [before[k] for k in others])
        values = [whole if k == joint.along else x for k, x in enumerate(before)]
        return [whole - before[joint.along]], _halves(values)
    own = [a - inner_product(load, before) for a, load in zip(joint.own, joint.loads, strict=True)]
    linear, angular = combined(frame.joint, own)
    moved, turned = _halves(before)
    return own, (add(moved, linear), add(turned, angular))


def _along(frame: Frame) -> int | None:
    """Index of the frame's acceleration that is the joint's; None if it is not a single one."""
    if not frame.joint.about_z:
        return None
    ((linear, angular),) = frame.joint.twists
    weights = (*linear, *angular)
    return weights.index(1.0) if sorted(weights) == [0.0] * 5 + [1.0] else None


def _halves(values: Sequence[Scalar]) -> tuple[Vector, Vector]:
    return (values[0], values[1], values[2]), (values[3], values[4], values[5])


KNOWN_BY_Q, KNOWN_BY_QD = 6, 3
"""Columns of a floating base, which comes first, that are known without dynamics."""


def known_derivatives(
    frames: Sequence[Frame], q: Sequence[Scalar], qd: Sequence[Scalar], up: Vector
) -> tuple[Matrix, Matrix]:
    """Return the derivatives (3 x 3 each) of a floating base's linear acceleration by its orientation and linear
    velocity.

    The position, orientation and linear velocity v of a floating base enter the equations of motion through one vector
    only. Along the axes of the base, this vector is a = dv/dt + w x v + R^T up. Here w is the angular velocity, R the
    orientation, and up minus gravity. If position, orientation and v change and the torques do not, then a and all other
    accelerations stay the same. dv/dt therefore changes by minus the change of w x v + R^T up.
    """
    root = frames[0]
    turned = outward(joint_turn(root, positions(frames, q)[0]), from_previous(root, up))
    own = rates(frames, qd)[0]
    return _minus_cross(turned), _minus_cross(own[3:])


def _minus_cross(v: Sequence[Scalar]) -> Matrix:
    """The matrix of - v x."""
    x, y, z = v
    return ((0.0, z, -y), (-z, 0.0, x), (y, -x, 0.0))


# Articulated inertias: the wrench per acceleration of a body whose further joints move freely, as symmetric 6 x 6 matrices
# in blocks.
class Articulated(NamedTuple):
    """The articulated inertia of a body: the wrench that accelerates it while the joints after it are free to move.

    The body's frame has the linear acceleration a and the angular acceleration alpha. The wrench consists of force =
    linear a + mixed alpha, and moment = mixed^T a + angular alpha.

    linear   kg, symmetric matrix (xx, yy, zz, xy, xz, yz)
    mixed    kg m, 3 x 3 matrix
    angular  kg m^2, symmetric matrix (xx, yy, zz, xy, xz, yz)
    """

    linear: Six
    mixed: Matrix
    angular: Six


NOTHING = Articulated((0.0,) * 6, (ZERO, ZERO, ZERO), (0.0,) * 6)


def rigid(body: Body) -> Articulated:
    """A body with no joint beyond it."""
    m, (x, y, z), (xx, yy, zz, xy, xz, yz) = body
    return Articulated(
        (m, m, m, 0.0, 0.0, 0.0),
        ((0.0, z, -y), (-z, 0.0, x), (y, -x, 0.0)),
        (yy + zz, xx + zz, xx + yy, -xy, -xz, -yz),
    )


def both(a: Articulated, b: Articulated) -> Articulated:
    """Two about one frame as one."""
    mixed = tuple(add(x, y) for x, y in zip(a.mixed, b.mixed, strict=True))
    return Articulated(_sum(a.linear, b.linear), mixed, _sum(a.angular, b.angular))  # type: ignore[arg-type]


def moved_to(inertia: Articulated, offset: Vector) -> Articulated:
    """Return the articulated inertia relative to another point, from which `offset` p leads to the present reference
    point.

    With G = mixed - linear [p], mixed becomes G, and angular increases by [p] G + ([p] mixed)^T. [p] is the matrix of
    the cross product with p.
    """
    x, y, z = offset
    skew: Matrix = ((0.0, -z, y), (z, 0.0, -x), (-y, x, 0.0))
    pushed = multiply(full(inertia.linear), skew)
    mixed: Matrix = tuple(  # type: ignore[assignment]
        tuple(a - b for a, b in zip(row, other, strict=True))
        for row, other in zip(inertia.mixed, pushed, strict=True)
    )
    near, far = multiply(skew, mixed), multiply(skew, inertia.mixed)
    angular = tuple(
        own + (near[i][j] + far[j][i]) for own, (i, j) in zip(inertia.angular, PLACES, strict=True)
    )
    return Articulated(inertia.linear, mixed, angular)


def handed(frame: Frame, inertia: Articulated) -> Articulated:
    """Return the articulated inertia that a frame passes to its parent, relative to the parent's frame.

    If the frame stands for several equal limbs, such as legs, the result is the sum over them.
    """
    rows = tuple(handed_vector(frame, row) for row in inertia.mixed)
    linear, angular = (tuple(handed_on(frame, part)) for part in (inertia.linear, inertia.angular))
    return Articulated(linear, rows, angular)  # type: ignore[arg-type]


def along_parent(frame: Frame, inertia: Articulated) -> Articulated:
    """Return an articulated inertia along the axes of the parent's frame, given along a joint's axes before its motion."""
    return inertia if frame.is_parallel else rotated(inertia, frame.rotation)


def before_turn(inertia: Articulated, turn: Turn | Rotation | None) -> Articulated:
    """Seen from before a joint's turn."""
    if turn is None:
        return inertia
    if isinstance(turn, Rotation):
        return rotated(inertia, turn.rows)
    linear = spun_six(inertia.linear, turn)
    # The cross block is not symmetric.
    mixed = spun_matrix(inertia.mixed, turn)
    return Articulated(linear, mixed, spun_six(inertia.angular, turn))


def rotated(inertia: Articulated, rows: Matrix) -> Articulated:
    """Return an articulated inertia along other axes.

    rows  rotation matrix from the present axes to the new ones
    """
    back = transpose(rows)
    linear, mixed, angular = (
        multiply(multiply(rows, part), back)
        for part in (full(inertia.linear), inertia.mixed, full(inertia.angular))
    )
    return Articulated(half(linear), mixed, half(angular))


def rows_of(inertia: Articulated) -> list[list[Scalar]]:
    """6 x 6, linear parts first."""
    upper = [[*a, *b] for a, b in zip(full(inertia.linear), inertia.mixed, strict=True)]
    lower = [[*a, *b] for a, b in zip(transpose(inertia.mixed), full(inertia.angular), strict=True)]
    return upper + lower


def from_rows(rows: Sequence[Sequence[Scalar]]) -> Articulated:
    """Build an articulated inertia from a 6 x 6 matrix; of its symmetric blocks only the upper triangles are read."""
    linear = tuple(rows[i][j] for i, j in PLACES)
    mixed = tuple((row[3], row[4], row[5]) for row in rows[:3])
    angular = tuple(rows[i + 3][j + 3] for i, j in PLACES)
    return Articulated(linear, mixed, angular)  # type: ignore[arg-type]


def _sum(a: Six, b: Six) -> Six:
    return tuple(x + y for x, y in zip(a, b, strict=True))
