"""Divides the vectors q and qd into the values of each joint, also for robots with mimic joints.

Algorithms compute with one value per joint. Callers give and get values of the robot's coordinates, without mimic
joints, whose positions follow that of a leader. A mimic joint's q is ratio q_leader + offset. The power of all joint
torques equals the power of the coordinates' torques. A mimic joint's torque is therefore multiplied by its ratio and
added to its leader's. The same holds for columns of Jacobians, for derivatives by q, and for any other quantity with one
entry per torque. A joint of a parallelogram can have several leaders, each with its ratio."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any, ParamSpec, TypeVar

import numpy as np
from numpy.typing import NDArray

from psdmc.dynamics.frames import Frame, Mimic
from psdmc.dynamics.scalar import Scalar


def positions(frames: Sequence[Frame], q: Sequence[Scalar]) -> list[Scalar]:
    """Return one entry per joint: its coordinate, or a tuple if the joint has several coordinates."""
    return _dealt([frame.joint.nq for frame in leading(frames)], q)


def rates(frames: Sequence[Frame], qd: Sequence[Scalar]) -> list[Scalar]:
    """Return one entry per joint: the joint's rate, or the tuple of rates if the joint has several."""
    return _dealt([frame.joint.nv for frame in leading(frames)], qd)


def first_rates(frames: Sequence[Frame]) -> tuple[int, ...]:
    """Return, for each joint, the index of its first rate in qd; after the last joint, the number of all rates."""
    found = [0]
    for frame in leading(frames):
        found.append(found[-1] + frame.joint.nv)
    return tuple(found)


def neutral(frames: Sequence[Frame]) -> list[Scalar]:
    """q at which no frame has moved."""
    return [value for frame in leading(frames) for value in frame.joint.neutral]


def normalized(frames: Sequence[Frame], q: NDArray[Any]) -> NDArray[Any]:
    """Return the nearest positions that the joints can have, (nq, ...); for example, quaternions get length one."""
    own = leading(frames)
    ends = np.cumsum([frame.joint.nq for frame in own])[:-1]
    return np.concatenate([f.joint.normalized(part) for f, part in zip(own, np.split(q, ends), strict=True)])


def joints_of_rates(frames: Sequence[Frame]) -> tuple[int, ...]:
    """Return the joint of each rate."""
    return tuple(i for i, f in enumerate(frames) if f.mimic is None for _ in range(f.joint.nv))


def flat(values: Iterable[Sequence[Scalar]]) -> list[Scalar]:
    """Flatten values that joints have several of."""
    return [x for own in values for x in own]


def leading(frames: Sequence[Frame]) -> list[Frame]:
    """Return the joints that have their own coordinates, that is, all joints except mimic joints."""
    return [frame for frame in frames if frame.mimic is None]


def as_tuple(own: Scalar) -> tuple[Scalar, ...]:
    """Return the values of one joint as a tuple; a single value becomes a tuple with one entry."""
    return own if isinstance(own, tuple) else (own,)


def _dealt(counts: Sequence[int], values: Sequence[Scalar]) -> list[Scalar]:
    if len(values) != sum(counts):
        raise ValueError(f"{len(values)} values for joints that have {sum(counts)}")
    found: list[Scalar] = []
    used = 0
    for count in counts:
        found.append(values[used] if count == 1 else tuple(values[used : used + count]))
        used += count
    return found


P = ParamSpec("P")
R = TypeVar("R")

POSITIONS = ("q",)
RATES = ("qd", "qdd", "qd_r", "qdd_r", "weights")
"""Arguments of algorithms, by name, that have an entry for each coordinate."""

Gather = Callable[[Sequence[Frame], Any], Any]


def has_mimic_joints(frames: Sequence[Frame]) -> bool:
    """Whether some joint follows another one's coordinate."""
    return any(frame.mimic is not None for frame in frames)


def on_coordinates(gather: Gather | None = None) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """Decorator that makes an algorithm with one value per joint an algorithm on the robot's coordinates, without mimic
    joints.

    The first argument of the algorithm must be the joint frames.

    gather  function that converts the result from joints to coordinates; None: the result has no axis of joints

    For robots without mimic joints, the algorithm runs unchanged.
    """

    def wrap(algorithm: Callable[P, R]) -> Callable[P, R]:
        signature = inspect.signature(algorithm)

        @functools.wraps(algorithm)
        def wrapped(*args: P.args, **kwargs: P.kwargs) -> R:
            frames: Any = args[0]
            if not has_mimic_joints(frames):
                return algorithm(*args, **kwargs)
            given = signature.bind(*args, **kwargs)
            values: dict[str, Any] = given.arguments
            for name in (*POSITIONS, *RATES):  # in this order, as it is the order of the generated code
                if values.get(name) is not None:
                    values[name] = _on_joints(frames, values[name], name in POSITIONS)
            values["frames"] = tuple(replace(frame, mimic=None) for frame in frames)
            found: Any = algorithm(*given.args, **given.kwargs)
            result: R = found if gather is None else gather(frames, found)
            return result

        return wrapped

    return wrap


def _on_joints(frames: Sequence[Frame], values: Sequence[Scalar], are_positions: bool) -> list[Scalar]:
    """One after the other each joint's values from those of the coordinates."""
    own: dict[int, list[Scalar]] = {}
    rest = list(values)
    for i, frame in enumerate(frames):
        if frame.mimic is None:
            count = frame.joint.nq if are_positions else frame.joint.nv
            own[i], rest = rest[:count], rest[count:]
    found: list[Scalar] = []
    for i, frame in enumerate(frames):
        if frame.mimic is None:
            found += own[i]
            continue
        value: Scalar = 0.0
        for leader, ratio in frame.mimic.shares:
            value = _plus(value, _times(ratio, own[leader][0]))
        offset = frame.mimic.offset
        found.append(value + offset if are_positions and offset else value)
    return found


def summed(frames: Sequence[Frame], values: Sequence[Scalar]) -> tuple[Scalar, ...]:
    """Sum one value per joint rate to one value per coordinate: a mimic joint's value, times its ratio, is added to its
    leader's."""
    found: dict[int, list[Scalar]] = {}
    rest = list(values)
    mimics: list[tuple[Mimic, Scalar]] = []
    for i, frame in enumerate(frames):
        own, rest = rest[: frame.joint.nv], rest[frame.joint.nv :]
        if frame.mimic is None:
            found[i] = own
        else:
            mimics.append((frame.mimic, own[0]))
    for mimic, value in mimics:
        for leader, ratio in mimic.shares:
            found[leader] = [_plus(found[leader][0], _times(ratio, value))]
    return tuple(x for own in found.values() for x in own)


def columns_summed(
    frames: Sequence[Frame], rows: Sequence[Sequence[Scalar]]
) -> tuple[tuple[Scalar, ...], ...]:
    """Sum the columns of mimic joints onto their leaders' columns, in a matrix with a column per rate, such as a
    Jacobian."""
    return tuple(summed(frames, row) for row in rows)


def matrices_summed(frames: Sequence[Frame], matrices: Sequence[Any]) -> list[Any]:
    """Several of these."""
    return [columns_summed(frames, rows) for rows in matrices]


def each_summed(gather: Gather) -> Gather:
    """Return the function that converts each block of a named tuple by `gather`."""
    return lambda frames, found: type(found)(*(gather(frames, block) for block in found))


def both_summed(frames: Sequence[Frame], rows: Sequence[Sequence[Scalar]]) -> tuple[tuple[Scalar, ...], ...]:
    """Sum rows and columns of mimic joints onto those of their leaders, in a matrix such as the mass matrix."""
    columns = zip(*columns_summed(frames, rows), strict=True)
    return tuple(zip(*(summed(frames, column) for column in columns), strict=True))


def sparse_rows_summed(
    frames: Sequence[Frame], rows: Sequence[Mapping[int, Scalar]]
) -> tuple[dict[int, Scalar], ...]:
    """Sum the rows of mimic joints onto those of their leaders, in a sparse matrix such as the regressor."""
    wanted = sorted({column for row in rows for column in row})
    found: tuple[dict[int, Scalar], ...] = tuple(
        {} for frame in frames if frame.mimic is None for _ in range(frame.joint.nv)
    )
    for column in wanted:
        for row, value in zip(found, summed(frames, [row.get(column, 0.0) for row in rows]), strict=True):
            if not (isinstance(value, float) and value == 0.0):
                row[column] = value
    return found


def _times(ratio: Scalar, value: Scalar) -> Scalar:
    if isinstance(value, float) and value == 0.0:
        return 0.0
    return value if ratio == 1.0 else value * ratio


def _plus(a: Scalar, b: Scalar) -> Scalar:
    if isinstance(a, float) and a == 0.0:
        return b
    return a if isinstance(b, float) and b == 0.0 else a + b
