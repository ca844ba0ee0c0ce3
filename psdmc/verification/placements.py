"""The placements of a model's links compared with those by an independent reader of the file."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from psdmc.robot.mechanism import BASE, Mechanism, Placement

Array = NDArray[np.float64]


def chain_poses(chain: Mechanism, q: Array) -> Array:
    """(k, n + 1, 4, 4) of the links' frames and the tip's in the base frame, at q of all joints, followers too."""
    return np.array([_poses_at(chain, row) for row in q])


def placement_errors(found: Array, expected: Array, above: Sequence[int]) -> Array:
    """(n + 1,) largest error of each link's pose in the one that it hangs on, and the tip's in its link.

    found, expected   (k, n + 1, 4, 4), poses in the base frame
    above             n + 1 of these that each hangs on, or BASE

    The larger of the angle between (rad) and the distance between, relative to the robot's reach.
    """
    reach = reach_of(expected, above)
    own, other = _in_the_one_above(found, above), _in_the_one_above(expected, above)
    chord = np.linalg.norm((own - other)[..., :3, :3], axis=(-2, -1)) / np.sqrt(8.0)
    angle = 2.0 * np.arcsin(np.minimum(1.0, chord))
    distance = np.linalg.norm((own - other)[..., :3, 3], axis=-1) / reach
    return np.asarray(np.maximum(angle, distance).max(axis=0))


def gravity_error(found: Array, expected: Array) -> float:
    """Distance between two vectors (3,), relative to the larger."""
    size = max(float(np.linalg.norm(found)), float(np.linalg.norm(expected)), np.finfo(float).tiny)
    return float(np.linalg.norm(found - expected)) / size


def reach_of(poses: Array, above: Sequence[int]) -> float:
    """Longest way outward over the largest distances from each frame to the next, m; one where there are none."""
    steps = np.linalg.norm(_in_the_one_above(poses, above)[..., :3, 3], axis=-1).max(axis=0)
    far: list[float] = []
    for step, outer in zip(steps.tolist(), above, strict=True):
        far.append(step + (0.0 if outer == BASE else far[outer]))
    return max(far) or 1.0


def frames_above(chain: Mechanism) -> tuple[int, ...]:
    """What each of chain_poses hangs on: the joints' parents, and the tip's body."""
    return (*chain.parents, chain.tip_body)


def _in_the_one_above(poses: Array, above: Sequence[int]) -> Array:
    base = np.broadcast_to(np.eye(4), (len(poses), 1, 4, 4))
    return np.linalg.inv(np.concatenate([poses, base], axis=1)[:, list(above)]) @ poses


def _poses_at(chain: Mechanism, q: Array) -> list[Array]:
    frames: list[Placement] = []
    values = np.split(q, np.cumsum([kind.nq for kind in chain.types])[:-1])
    for joint, parent, value in zip(chain.joints, chain.parents, values, strict=True):
        before = Placement.identity() if parent == BASE else frames[parent]
        frames.append(before @ joint.placement @ joint.type.transform(value.tolist()))
    links = [_matrix(frame @ joint.link_frame) for frame, joint in zip(frames, chain.joints, strict=True)]
    return [*links, _matrix(frames[chain.tip_body] @ chain.tip)]


def _matrix(place: Placement) -> Array:
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = place.rotation, place.translation
    return matrix
