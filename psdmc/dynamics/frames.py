"""Joint frames in a tree, and the rotation of each joint: the input of every algorithm in this folder.

The placement of frame i in its parent's frame has the rotation and translation rotation @ Rz(turn + offset),
translation + rotation @ z slide. The angle `turn` and the displacement `slide` follow from q by the type of the joint.
For a joint of several coordinates, the placement is rotation @ rotation(q), translation + rotation @ displacement(q),
with the functions of the joint type. Each frame has one rigid body, whose parameters are relative to the frame. Parents
come before their children. Multiples of 90 degrees in the offset are stored separately, because they exchange sine and
cosine exactly and need no operations.
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
from psdmc.robot.joints.joint_type import SLIDES, TURNS
from psdmc.robot.mechanism import BASE as BASE
from psdmc.robot.mechanism import Mechanism, Placement

IDENTITY: Matrix = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


class Mimic(NamedTuple):
    """Position of a joint without its own coordinate: the sum of ratio * q_leader over `shares`, plus the offset.

    shares  leaders, each with its ratio; a mimic joint has one
    offset  rad or m
    """

    shares: tuple[tuple[int, Scalar], ...]
    offset: Scalar

    @property
    def leaders(self) -> tuple[int, ...]:
        return tuple(leader for leader, _ in self.shares)


@dataclass(frozen=True, slots=True)
class Frame:
    """One joint's constant geometry as plain floats, so that exact zeros and ones stay visible.

    parent       index of the parent's frame; BASE: the base frame
    rotation     3 x 3, axes of this frame in the parent's frame, without the rotation about z
    translation  m, origin of this frame at q = 0 in the parent's frame
    offset       rad, rotation about z at q = 0, without multiples of 90 degrees
    quarters     number of 90-degree rotations in addition to the offset, 0 to 3
    mimic        for a mimic joint, and for others without their own coordinate: their leaders; None: other joints
    limbs        function that returns the sum of a scalar over equal limbs, such as legs. Only the first frame of a
                 limb that stands for several has it; None for other frames

    Two fields are computed from these. `is_parallel` says whether the joint's axis is parallel to that of the parent
    joint. `inward_rows` and `outward_rows` are the rotation and its transpose without their zeros.
    """

    joint: JointType
    parent: int
    rotation: Matrix
    translation: Vector
    offset: Scalar = 0.0
    quarters: int = 0
    mimic: Mimic | None = None
    limbs: Callable[[Scalar], Scalar] | None = None
    is_parallel: bool = field(init=False, compare=False)
    inward_rows: Fixed = field(init=False, compare=False)
    outward_rows: Fixed = field(init=False, compare=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "is_parallel", self.rotation == IDENTITY)
        object.__setattr__(self, "inward_rows", fixed(self.rotation))
        object.__setattr__(self, "outward_rows", fixed(transpose(self.rotation)))


class Angle(NamedTuple):
    """A rotation about z by the angle `value` (rad) plus `quarters` times 90 degrees. None as `value` stands for zero."""

    value: Scalar | None
    quarters: int

    def __add__(self, other: Angle) -> Angle:  # type: ignore[override]
        if self.value is None or other.value is None:
            value = other.value if self.value is None else self.value
        else:
            value = self.value + other.value
        return Angle(value, (self.quarters + other.quarters) % 4)

    def turn(self) -> Turn | None:
        """Return the angle's sine and cosine as a Turn; None if the angle is zero."""
        if self.value is None and self.quarters == 0:
            return None
        s, c = (0.0, 1.0) if self.value is None else sincos(self.value)
        return Turn(*((s, c), (c, -s), (-s, -c), (-c, s))[self.quarters])


NO_TURN = Angle(None, 0)


class Turn(NamedTuple):
    """The sine and cosine of a rotation about z. In place of a Turn, None stands for no rotation."""

    sine: Scalar
    cosine: Scalar

    def then(self, other: Turn) -> Turn:
        """Return this rotation followed by another one as a single rotation, by the addition theorems."""
        s, c = self.sine, self.cosine
        return Turn(s * other.cosine + c * other.sine, c * other.cosine - s * other.sine)

    def outward(self, v: Vector) -> Vector:
        """Return a vector along the axes after this rotation about z, given along the axes before it: Rz^T v."""
        s, c = self.sine, self.cosine
        return (c * v[0] + s * v[1], c * v[1] - s * v[0], v[2])

    def inward(self, v: Vector) -> Vector:
        """Return a vector along the axes before this rotation about z, given along the axes after it: Rz v."""
        s, c = self.sine, self.cosine
        return (c * v[0] - s * v[1], s * v[0] + c * v[1], v[2])


class Rotation(NamedTuple):
    """A rotation about any axis; its columns are the rotated axes."""

    rows: Matrix

    def outward(self, v: Vector) -> Vector:
        """Return a vector along the axes after this rotation, given along the axes before it."""
        return transform(transpose(self.rows), v)

    def inward(self, v: Vector) -> Vector:
        """Return a vector along the axes before this rotation, given along the axes after it."""
        return transform(self.rows, v)


def as_matrix(values: Sequence[Sequence[float]]) -> Matrix:
    """Return a copy of a 3 x 3 array with Python floats."""
    rows = tuple(tuple(float(x) for x in row) for row in values)
    return rows  # type: ignore[return-value]


def as_vector(values: Sequence[Scalar]) -> Vector:
    """Return three entries, Python floats or symbols, as a vector. Operations with symbols treat floats as constants."""
    x, y, z = values
    return (x, y, z)


def frames_of(chain: Mechanism) -> tuple[Frame, ...]:
    """The robot's own joint frames, none moved."""
    return tuple(
        replace(frame_at(joint.type, parent, joint.placement), mimic=mimic_of(chain, i))
        for i, (joint, parent) in enumerate(zip(chain.joints, chain.parents, strict=True))
    )


def with_carriers(frames: Sequence[Frame], joints: Iterable[int]) -> tuple[int, ...]:
    """Return these joints, the joints that they follow, and all joints that carry them, in ascending order."""
    kept: set[int] = set()
    left = list(joints)
    while left:
        joint = left.pop()
        if joint != BASE and joint not in kept:
            kept.add(joint)
            mimic = frames[joint].mimic
            left += [frames[joint].parent, *(() if mimic is None else mimic.leaders)]
    return tuple(sorted(kept))


def part_of(frames: Sequence[Frame], kept: Sequence[int]) -> tuple[Frame, ...]:
    """Return the frames of the joints in `kept`, with parents and leaders renumbered by their places in `kept`.

    `kept` must include all joints that carry or lead one of the joints in it.
    """
    number = {joint: i for i, joint in enumerate(kept)} | {BASE: BASE}

    def renumbered(mimic: Mimic) -> Mimic:
        return mimic._replace(shares=tuple((number[leader], ratio) for leader, ratio in mimic.shares))

    own = (frames[joint] for joint in kept)
    return tuple(replace(f, parent=number[f.parent], mimic=f.mimic and renumbered(f.mimic)) for f in own)


def mimic_of(chain: Mechanism, i: int) -> Mimic | None:
    """Return the leaders of joint i if it follows other joints, as a mimic joint does. The result is None if the joint
    has its own coordinate."""
    coordinate = chain.coordinates[i]
    if coordinate.leader is None or coordinate.leader == i:
        return None
    return Mimic(coordinate.shares, coordinate.offset)


def frame_at(joint: JointType, parent: int, placement: Placement) -> Frame:
    """Return the frame of a joint with this placement in its parent's frame."""
    rotation = as_matrix(placement.rotation.tolist())
    return Frame(joint, parent, rotation, as_vector(placement.translation.tolist()))


def leaves(frames: Sequence[Frame]) -> tuple[bool, ...]:
    """For each frame, whether no other frame has it as its parent."""
    parents = {frame.parent for frame in frames}
    return tuple(i not in parents for i in range(len(frames)))


def has_floating_base(frames: Sequence[Frame]) -> bool:
    """Return whether a floating joint carries the whole robot, with linear and angular rates along the axes of its
    body."""
    return frames[0].joint.twists == (*SLIDES, *TURNS) and all(frame.parent != BASE for frame in frames[1:])


def base_acceleration(chain: Mechanism) -> Vector:
    """Return gravity as an upward acceleration of the base, m/s^2 in the base frame."""
    gx, gy, gz = chain.gravity.tolist()
    return (-gx, -gy, -gz)


def outward(turn: Turn | Rotation | None, v: Vector) -> Vector:
    """Return a vector along the axes after a joint's rotation, given along the axes before it; None: no rotation."""
    return v if turn is None else turn.outward(v)


def inward(turn: Turn | Rotation | None, v: Vector) -> Vector:
    """Return a vector along the axes before a joint's rotation, given along the axes after it; None: no rotation."""
    return v if turn is None else turn.inward(v)


def joined(first: Turn | None, second: Turn | None) -> Turn | None:
    """One turn after another."""
    return second if first is None else first if second is None else first.then(second)


def joint_turn(frame: Frame, q: Scalar) -> Turn | Rotation | None:
    """Return the joint's rotation at q; q is one value, or a tuple for a joint of several coordinates. None: no
    rotation."""
    if frame.joint.about_z:
        return joint_angle(frame, q).turn()
    rows = frame.joint.rotation(q)
    return None if rows is None else Rotation(rows)


def about_z(turn: Turn | Rotation | None) -> Turn | None:
    """Return the same rotation as a rotation about z. Raises ValueError if it is about another axis."""
    if isinstance(turn, Rotation):
        raise ValueError("a joint of several coordinates, where one that turns about z was expected")
    return turn


def joint_angle(frame: Frame, q: Scalar) -> Angle:
    """Return the angle at q by which the joint's frame is rotated about z."""
    value = frame.offset if frame.offset else None
    turned = frame.joint.turn(q)
    if turned is not None:
        value = turned if value is None else turned + value
    return Angle(value, frame.quarters)


def joint_offset(frame: Frame, q: Scalar) -> Vector:
    """Return the origin (m) of the frame in its parent's frame, at joint position q."""
    if not frame.joint.about_z:
        moved = frame.joint.displacement(q)
        return frame.translation if moved is None else add(frame.translation, to_previous(frame, moved))
    height = frame.joint.slide(q)
    if height is None:
        return frame.translation
    x, y, z = frame.translation
    slide = (frame.rotation[0][2] * height, frame.rotation[1][2] * height, frame.rotation[2][2] * height)
    return (x + slide[0], y + slide[1], z + slide[2])


def handed_on(frame: Frame, values: Iterable[Scalar]) -> Iterator[Scalar]:
    """Return the values that a frame passes to its parent. If the frame stands for several equal limbs, they are
    summed."""
    return iter(values) if frame.limbs is None else map(frame.limbs, values)


def handed_vector(frame: Frame, v: Vector) -> Vector:
    """Return a vector as `handed_on` does."""
    x, y, z = handed_on(frame, v)
    return (x, y, z)


def to_previous(frame: Frame, v: Vector) -> Vector:
    """Return a vector along the axes of the parent's frame, given along those of `frame` before its joint's rotation.

    This rotation is constant: it does not depend on q.
    """
    return v if frame.is_parallel else rotated(frame.inward_rows, v)


def from_previous(frame: Frame, v: Vector) -> Vector:
    """Rotate a vector from the parent's axes to this frame's axes before its joint's rotation."""
    return v if frame.is_parallel else rotated(frame.outward_rows, v)
