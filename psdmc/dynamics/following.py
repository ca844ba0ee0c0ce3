"""Converts between joints and coordinates of robots with mimic joints, whose positions follow that of a leader.

Algorithms compute with one value per joint. Callers give and get values of the robot's coordinates, without mimic
joints. A mimic joint's q is ratio q_leader + offset. The power of all joint torques equals the power of the
coordinates' torques. A mimic joint's torque is therefore multiplied by its ratio and added to its leader's. The same
holds for columns of Jacobians, for derivatives by q, and for any other quantity with one entry per torque. A joint of a
parallelogram can have several leaders, each with its ratio.
"""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any, ParamSpec, TypeVar

from psdmc.dynamics.frames import Follows, Frame
from psdmc.dynamics.scalar import Scalar

P = ParamSpec("P")
R = TypeVar("R")

POSITIONS = ("q",)
RATES = ("qd", "qdd", "qd_r", "qdd_r", "weights")
"""Arguments of algorithms, by name, that have an entry for each coordinate."""

Gather = Callable[[Sequence[Frame], Any], Any]


def any_follows(frames: Sequence[Frame]) -> bool:
    """Whether some joint follows another one's coordinate."""
    return any(frame.follows is not None for frame in frames)


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
            if not any_follows(frames):
                return algorithm(*args, **kwargs)
            given = signature.bind(*args, **kwargs)
            values: dict[str, Any] = given.arguments
            for name in {*POSITIONS, *RATES} & values.keys():
                if values[name] is not None:
                    values[name] = _on_joints(frames, values[name], name in POSITIONS)
            values["frames"] = tuple(replace(frame, follows=None) for frame in frames)
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
        if frame.follows is None:
            count = frame.joint.nq if are_positions else frame.joint.nv
            own[i], rest = rest[:count], rest[count:]
    found: list[Scalar] = []
    for i, frame in enumerate(frames):
        if frame.follows is None:
            found += own[i]
            continue
        value: Scalar = 0.0
        for leader, ratio in frame.follows.shares:
            value = _plus(value, _times(ratio, own[leader][0]))
        offset = frame.follows.offset
        found.append(value + offset if are_positions and offset else value)
    return found


def summed(frames: Sequence[Frame], values: Sequence[Scalar]) -> tuple[Scalar, ...]:
    """Sum one value per joint rate to one value per coordinate: a mimic joint's value, times its ratio, is added to its
    leader's."""
    found: dict[int, list[Scalar]] = {}
    rest = list(values)
    followers: list[tuple[Follows, Scalar]] = []
    for i, frame in enumerate(frames):
        own, rest = rest[: frame.joint.nv], rest[frame.joint.nv :]
        if frame.follows is None:
            found[i] = own
        else:
            followers.append((frame.follows, own[0]))
    for follows, value in followers:
        for leader, ratio in follows.shares:
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
        {} for frame in frames if frame.follows is None for _ in range(frame.joint.nv)
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
