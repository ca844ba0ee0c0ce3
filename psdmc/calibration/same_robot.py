"""Checks whether two models are of the same robot, so that their values can be compared."""

from __future__ import annotations

import numpy as np

from psdmc.calibration.logs.wording import listed
from psdmc.errors import InputError
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.robot.mechanism import Mechanism, Placement

SAME_PLACE = 1e-6
"""m, and rad: farther apart, two joints are not the same."""


def require_same_robot(a: Mechanism, b: Mechanism) -> None:
    """Raise InputError unless two robots have equal joints, axes, link frames and gravity. The error says what differs."""
    hint = "compare two models of one robot, derived with the same --base, --tip, --lock and --gravity"
    if a.joint_names != b.joint_names:
        pairs = (("first", a.joint_names, b.joint_names), ("second", b.joint_names, a.joint_names))
        alone = [(which, [name for name in own if name not in other]) for which, own, other in pairs]
        what = "; ".join(f"only in the {which}: {listed(names)}" for which, names in alone if names)
        raise InputError(f"different robots: joints {what or 'in another order'}", hint)
    other = [x.name for x, y in zip(a.joints, b.joints, strict=True) if x.type is not y.type]
    other += [name for name, x, y in zip(a.joint_names, a.parents, b.parents, strict=True) if x != y]
    if other:
        raise InputError(
            f"different robots: joint(s) {listed(other)} of another type or on another link", hint
        )
    moved = [
        name
        for name, (axis, frame), (axis_b, frame_b) in zip(a.joint_names, _places(a), _places(b), strict=True)
        if max(
            np.abs(axis.rotation[:, 2] - axis_b.rotation[:, 2]).max(),
            np.abs(np.cross(axis.translation - axis_b.translation, axis.rotation[:, 2])).max(),
            np.abs(frame.rotation - frame_b.rotation).max(),
            np.abs(frame.translation - frame_b.translation).max(),
        )
        > SAME_PLACE
    ]
    if moved:
        raise InputError(f"different robots: joint(s) {listed(moved)} have other axes or link frames", hint)
    if np.abs(a.gravity - b.gravity).max() > SAME_PLACE:
        raise InputError(f"different gravity: {a.gravity.tolist()} and {b.gravity.tolist()} m/s^2", hint)


def _places(chain: Mechanism) -> list[tuple[Placement, Placement]]:
    """Of each joint its axis, and its link's frame, in the base frame at q = 0."""
    found: list[Placement] = []
    for joint, parent in zip(chain.joints, chain.parents, strict=True):
        found.append(joint.placement if parent < 0 else found[parent] @ joint.placement)
    return [(place, place @ joint.link_frame) for place, joint in zip(found, chain.joints, strict=True)]


def require_same_base_parameters(a: DynamicsModel, b: DynamicsModel) -> None:
    """Raise InputError unless two models number the same base parameters. The matrix B in echelon form is the same for
    the same assumptions."""
    if a.B.shape != b.B.shape or not np.allclose(a.B, b.B, rtol=SAME_PLACE, atol=SAME_PLACE):
        raise InputError(
            f"the models have other base parameters: {a.l} and {b.l}",
            "derive both with the same --drive-inertia, --assume-zero and --unknown",
        )
