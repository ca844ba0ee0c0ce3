"""Joint frames in a tree, and the turn that each joint makes: the input of every algorithm here.

Frame i sits in its parent's frame at   rotation @ Rz(turn + offset), translation + rotation @ z slide
where turn and slide follow from q by its joint's type; a joint of several coordinates puts it at
rotation @ rotation(q), translation + rotation @ way(q). It carries one rigid body, whose parameters are about frame i
itself. Parents come before their children. Whole quarter turns of the offset are kept apart, so that they exchange sine
and cosine exactly and cost nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

from psdmc.dynamics.scalar import (
    Fixed,
    Matrix,
    Scalar,
    Vector,
    add,
    fixed,
    rotated,
    sincos,
    transform,
    transpose,
)
from psdmc.robot.joints import JointType
from psdmc.robot.mechanism import BASE as BASE
from psdmc.robot.mechanism import Mechanism, Placement

IDENTITY: Matrix = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


@dataclass(frozen=True, slots=True)
class Frame:
    """One joint's constant geometry as plain floats, so that exact zeros and ones stay visible.

    parent       index of the frame that it sits in; BASE: the base frame
    rotation     3 x 3, this frame's axes in the parent's, without the turn about z
    translation  m, origin of this frame at q = 0 in the parent's
    offset       rad, turn about z at q = 0, beside
    quarters     whole quarter turns, 0 to 3
    follows      leader, ratio and offset where its joint's q is that of another: ratio q_leader + offset (following.py)
    limbs        of a limb's first frame that stands for those of several limbs at once: gives the sum over them of a scalar
                 that is one for each; None: it stands for itself

    Made of these: whether its axis has the direction of the joint's that it hangs on (`is_parallel`), and the rotation and
    its transpose without their zeros (`inward_rows`, `outward_rows`).
    """

    joint: JointType
    parent: int
    rotation: Matrix
    translation: Vector
    offset: Scalar = 0.0
    quarters: int = 0
    follows: tuple[int, Scalar, Scalar] | None = None
    limbs: Callable[[Scalar], Scalar] | None = None
    is_parallel: bool = field(init=False, compare=False)
    inward_rows: Fixed = field(init=False, compare=False)
    outward_rows: Fixed = field(init=False, compare=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "is_parallel", self.rotation == IDENTITY)
        object.__setattr__(self, "inward_rows", fixed(self.rotation))
        object.__setattr__(self, "outward_rows", fixed(transpose(self.rotation)))


class Angle(NamedTuple):
    """A turn about z: `value` rad and `quarters` quarter turns; a value of None is zero."""

    value: Scalar | None
    quarters: int

    def __add__(self, other: Angle) -> Angle:  # type: ignore[override]
        if self.value is None or other.value is None:
            value = other.value if self.value is None else self.value
        else:
            value = self.value + other.value
        return Angle(value, (self.quarters + other.quarters) % 4)

    def turn(self) -> Turn | None:
        """Its sine and cosine; None where it is no turn at all."""
        if self.value is None and self.quarters == 0:
            return None
        s, c = (0.0, 1.0) if self.value is None else sincos(self.value)
        return Turn(*((s, c), (c, -s), (-s, -c), (-c, s))[self.quarters])


NO_TURN = Angle(None, 0)


class Turn(NamedTuple):
    """A rotation about z by its sine and cosine; None stands for no rotation at all."""

    sine: Scalar
    cosine: Scalar

    def then(self, other: Turn) -> Turn:
        """Both turns as one, by the addition theorems."""
        s, c = self.sine, self.cosine
        return Turn(s * other.cosine + c * other.sine, c * other.cosine - s * other.sine)

    def outward(self, v: Vector) -> Vector:
        """Rz^T v: from the frame before the turn into the frame after it."""
        s, c = self.sine, self.cosine
        return (c * v[0] + s * v[1], c * v[1] - s * v[0], v[2])

    def inward(self, v: Vector) -> Vector:
        """Rz v: from the frame after the turn into the frame before it."""
        s, c = self.sine, self.cosine
        return (c * v[0] - s * v[1], s * v[0] + c * v[1], v[2])


class Rotation(NamedTuple):
    """A rotation about any axis; its columns are the turned axes."""

    rows: Matrix

    def outward(self, v: Vector) -> Vector:
        """Rotate a vector from the frame before the joint's rotation into the frame after it."""
        return transform(transpose(self.rows), v)

    def inward(self, v: Vector) -> Vector:
        """Rotate a vector from the frame after the joint's rotation into the frame before it."""
        return transform(self.rows, v)


def as_matrix(values: Sequence[Sequence[float]]) -> Matrix:
    """Plain-float copy of a 3 x 3 array."""
    rows = tuple(tuple(float(x) for x in row) for row in values)
    return rows  # type: ignore[return-value]


def as_vector(values: Sequence[Scalar]) -> Vector:
    """Three Python floats, which symbols take as constants, or symbols as a vector."""
    x, y, z = values
    return (x, y, z)


def frames_of(chain: Mechanism) -> tuple[Frame, ...]:
    """The robot's own joint frames, none moved."""
    return tuple(
        replace(frame_at(joint.type, parent, joint.placement), follows=what_follows(chain, i))
        for i, (joint, parent) in enumerate(zip(chain.joints, chain.parents, strict=True))
    )


def with_carriers(frames: Sequence[Frame], joints: Iterable[int]) -> tuple[int, ...]:
    """These joints, those that they follow, and all that carry them, ascending."""
    kept: set[int] = set()
    left = list(joints)
    while left:
        joint = left.pop()
        if joint != BASE and joint not in kept:
            kept.add(joint)
            follows = frames[joint].follows
            left += [frames[joint].parent] if follows is None else [frames[joint].parent, follows[0]]
    return tuple(sorted(kept))


def part_of(frames: Sequence[Frame], kept: Sequence[int]) -> tuple[Frame, ...]:
    """The frames of some joints, with which all that carry them and that they follow are kept, numbered anew."""
    number = {joint: i for i, joint in enumerate(kept)} | {BASE: BASE}
    own = (frames[joint] for joint in kept)
    return tuple(
        replace(f, parent=number[f.parent], follows=f.follows and (number[f.follows[0]], *f.follows[1:]))
        for f in own
    )


def what_follows(chain: Mechanism, i: int) -> tuple[int, float, float] | None:
    """A frame's `follows`; None where joint i has a coordinate of its own."""
    coordinate = chain.coordinates[i]
    if coordinate.leader is None or coordinate.leader == i:
        return None
    return coordinate.leader, coordinate.ratio, coordinate.offset


def frame_at(joint: JointType, parent: int, placement: Placement) -> Frame:
    """A joint frame that is placed so in its parent's."""
    rotation = as_matrix(placement.rotation.tolist())
    return Frame(joint, parent, rotation, as_vector(placement.translation.tolist()))


def leaves(frames: Sequence[Frame]) -> tuple[bool, ...]:
    """For each frame, whether no other frame sits in it."""
    parents = {frame.parent for frame in frames}
    return tuple(i not in parents for i in range(len(frames)))


def base_acceleration(chain: Mechanism) -> Vector:
    """Gravity as an upward acceleration of the base, m/s^2 in the base frame."""
    gx, gy, gz = chain.gravity.tolist()
    return (-gx, -gy, -gz)


def outward(turn: Turn | Rotation | None, v: Vector) -> Vector:
    """A vector along the axes before the turn, along those after it; None: no turn."""
    return v if turn is None else turn.outward(v)


def inward(turn: Turn | Rotation | None, v: Vector) -> Vector:
    """A vector along the axes after the turn, along those before it; None: no turn."""
    return v if turn is None else turn.inward(v)


def joined(first: Turn | None, second: Turn | None) -> Turn | None:
    """One turn after another."""
    return second if first is None else first if second is None else first.then(second)


def joint_turn(frame: Frame, q: Scalar) -> Turn | Rotation | None:
    """How the frame is turned at q: one value, or the tuple of the joint's."""
    if frame.joint.about_z:
        return joint_angle(frame, q).turn()
    rows = frame.joint.rotation(q)
    return None if rows is None else Rotation(rows)


def about_z(turn: Turn | Rotation | None) -> Turn | None:
    """Return the same rotation about z; ValueError if it is about another axis."""
    if isinstance(turn, Rotation):
        raise ValueError("a joint of several coordinates, where one that turns about z was expected")
    return turn


def joint_angle(frame: Frame, q: Scalar) -> Angle:
    """The turn about z at q of a frame whose joint moves about it."""
    value = frame.offset if frame.offset else None
    turned = frame.joint.turn(q)
    if turned is not None:
        value = turned if value is None else turned + value
    return Angle(value, frame.quarters)


def joint_offset(frame: Frame, q: Scalar) -> Vector:
    """Origin of the frame in its parent's, m."""
    if not frame.joint.about_z:
        moved = frame.joint.way(q)
        return frame.translation if moved is None else add(frame.translation, to_previous(frame, moved))
    way = frame.joint.slide(q)
    if way is None:
        return frame.translation
    x, y, z = frame.translation
    slide = (frame.rotation[0][2] * way, frame.rotation[1][2] * way, frame.rotation[2][2] * way)
    return (x + slide[0], y + slide[1], z + slide[2])


def handed_on(frame: Frame, values: Iterable[Scalar]) -> Iterator[Scalar]:
    """Return what a frame passes to its parent: the value itself, or the sums over all limbs that it represents."""
    return iter(values) if frame.limbs is None else map(frame.limbs, values)


def handed_vector(frame: Frame, v: Vector) -> Vector:
    """Return a vector as `handed_on` does."""
    x, y, z = handed_on(frame, v)
    return (x, y, z)


def to_previous(frame: Frame, v: Vector) -> Vector:
    """Constant part of the rotation, from a frame (before its turn) into its parent's."""
    return v if frame.is_parallel else rotated(frame.inward_rows, v)


def from_previous(frame: Frame, v: Vector) -> Vector:
    """A vector along the parent's axes, along this frame's before its joint's turn."""
    return v if frame.is_parallel else rotated(frame.outward_rows, v)
