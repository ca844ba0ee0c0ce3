"""The robot's coordinates and its joints' positions, where joints follow others: q_joint = ratio q_leader + offset.

The algorithms take joint values, which `joint_positions` and `joint_rates` compute from the coordinates. The joints'
torques and the coordinates' torques have equal power, so that torques, and rows and columns of the mass matrix, are
summed with the same ratios.
"""

from __future__ import annotations

from collections.abc import Sequence

from psdmc.dynamics.scalar import Scalar
from psdmc.robot.coordinates import Coordinate, leaders

Rows = Sequence[Sequence[Scalar]]


def joint_positions(coordinates: Sequence[Coordinate], q: Sequence[Scalar]) -> list[Scalar]:
    """Position of every joint from the coordinates, one coordinate for each leader."""
    return [
        value + coordinate.offset if coordinate.offset else value
        for value, coordinate in zip(joint_rates(coordinates, q), coordinates, strict=True)
    ]


def joint_rates(coordinates: Sequence[Coordinate], qd: Sequence[Scalar]) -> list[Scalar]:
    """Rate (or acceleration) of every joint from the coordinates'; zero for a joint that is held."""
    own = dict(zip(leaders(coordinates), qd, strict=True))
    return [
        _times(coordinate, own[coordinate.leader]) if coordinate.leader is not None else 0.0
        for coordinate in coordinates
    ]


def gathered_torques(coordinates: Sequence[Coordinate], tau: Sequence[Scalar]) -> list[Scalar]:
    """Torques of the coordinates from those of all joints."""
    found: dict[int, Scalar] = dict.fromkeys(leaders(coordinates), 0.0)
    for coordinate, torque in zip(coordinates, tau, strict=True):
        if coordinate.leader is not None:
            found[coordinate.leader] = found[coordinate.leader] + _times(coordinate, torque)
    return list(found.values())


def _times(coordinate: Coordinate, value: Scalar) -> Scalar:
    return value if coordinate.ratio == 1.0 else value * coordinate.ratio
