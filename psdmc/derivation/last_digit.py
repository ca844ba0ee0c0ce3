"""The change of a robot's torques when the last digits of its numbers change: no model can be more accurate.

A direction that a file gives to 16 digits is uncertain by 1e-16 rad. That changes the moment about an axis of 100 N
that act 3 m away by some 1e-14 N m: negligible, unless that axis itself moves no more than a gram at a micrometre.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from psdmc.derivation.extended import orthonormal
from psdmc.dynamics.body import body_from_parameters
from psdmc.dynamics.frames import Frame, base_acceleration, frames_of
from psdmc.dynamics.newton_euler import inverse_dynamics
from psdmc.dynamics.parameters import moving_map
from psdmc.reproducible import times
from psdmc.robot.mechanism import BODY_PARAMETERS, PARAMETERS_PER_LINK, Mechanism, Placement

Array = NDArray[np.float64]
Long = NDArray[Any]
States = Sequence[Sequence[Long]]
"""q, qd and qdd, a list of n arrays each."""

SEED = 18_890_401
DRAWS = 4
"""How many robots with changed numbers are computed."""

LAST = 2.0**-53
"""Half a unit in the last place of a double between one and two: in rad for a direction, as a share for any other
number."""

STEP = 2.0**-36
"""The change that is computed and then scaled down to LAST: far above rounding, and small enough for torques to be
linear in it."""


class Numbers(NamedTuple):
    """A chain's numbers, all in one precision.

    places, link_frames   n rotations (3, 3) and translations (3,) each, m: joint frames in their parents', and link
                          frames in joint frames
    parameters            (n, 11)
    """

    places: Sequence[tuple[Long, Long]]
    link_frames: Sequence[tuple[Long, Long]]
    parameters: Long


def last_digit_effect(chain: Mechanism, x: Array, states: States) -> Array:
    """Largest change (n,) of each joint's torque if all numbers of the robot change by LAST, up or down at random. It
    is relative to that joint's largest torque, or absolute if that is zero."""
    rng = np.random.default_rng(SEED)
    numbers = _numbers(chain, x, _as_it_is, np.dtype(np.float64))
    torques = _torques(chain, numbers, states)
    largest = np.abs(torques).max(axis=0)
    changes = [
        np.abs(_torques(chain, _changed(numbers, rng), states) - torques).max(axis=0) for _ in range(DRAWS)
    ]
    effect: Array = LAST / STEP * np.max(changes, axis=0) / np.where(largest > 0, largest, 1.0)
    return effect


def extended_torques(chain: Mechanism, x: Array, states: States) -> Array:
    """(states, n) N m or N: Newton-Euler in extended precision, rotations orthonormal to all of its digits."""
    long = np.dtype(np.longdouble)
    numbers = _numbers(chain, x, orthonormal, long)
    vectors = [[vector.astype(long) for vector in one] for one in states]
    return _torques(chain, numbers, vectors).astype(np.float64)


def _as_it_is(rotation: Array) -> Long:
    return rotation


def _numbers(
    chain: Mechanism, x: Array, turned: Callable[[Array], Long], precision: np.dtype[Any]
) -> Numbers:
    def placed(place: Placement) -> tuple[Long, Long]:
        return turned(place.rotation), place.translation.astype(precision)

    return Numbers(
        [placed(joint.placement) for joint in chain.joints],
        [placed(joint.link_frame) for joint in chain.joints],
        x.reshape(-1, PARAMETERS_PER_LINK).astype(precision),
    )


def _changed(numbers: Numbers, rng: np.random.Generator) -> Numbers:
    """The numbers, each changed by STEP up or down. Zeros stay, except those of rotations, which are cosines of right
    angles; a frame that is not turned at all stays so, as nothing in it was rounded."""

    def scaled(values: Long) -> Long:
        return np.asarray(values * (1.0 + STEP * rng.choice([-1.0, 1.0], values.shape)))

    def turned(rotation: Long) -> Long:
        if np.array_equal(rotation, np.eye(3)):
            return rotation
        a, b, c = STEP * rng.choice([-1.0, 1.0], 3)
        return np.asarray(rotation + times(np.array([[0.0, -c, b], [c, 0.0, -a], [-b, a, 0.0]]), rotation))

    return Numbers(
        [(turned(rotation), scaled(translation)) for rotation, translation in numbers.places],
        [(rotation, scaled(translation)) for rotation, translation in numbers.link_frames],
        scaled(numbers.parameters),
    )


def _torques(chain: Mechanism, numbers: Numbers, states: States) -> Long:
    frames = [_frame(frame, *place) for frame, place in zip(frames_of(chain), numbers.places, strict=True)]
    bodies = [
        body_from_parameters(list(times(moving_map(*place), row[:BODY_PARAMETERS])))
        for place, row in zip(numbers.link_frames, numbers.parameters, strict=True)
    ]
    drives = list(numbers.parameters[:, BODY_PARAMETERS])
    q, qd, qdd = states
    torques = inverse_dynamics(frames, bodies, drives, q, qd, qdd, base_acceleration(chain))
    count = len(q[0])
    return np.stack([np.broadcast_to(torque, (count,)) for torque in torques], axis=1)


def _frame(frame: Frame, rotation: Long, translation: Long) -> Frame:
    rows = tuple(tuple(row) for row in rotation)
    return replace(frame, rotation=rows, translation=tuple(translation))  # type: ignore[arg-type]
