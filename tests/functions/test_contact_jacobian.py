"""Jacobians of contacts against Pinocchio, and the rows of each frame's Jacobian."""

from __future__ import annotations

import pytest
from against_pinocchio import EVERY, bench, matches_pinocchio


@pytest.mark.parametrize(("robot", "real"), EVERY)
def test_jacobians_are_pinocchios(robot: str, real: str) -> None:
    matches_pinocchio("contact_jacobian", robot, real)


def test_a_frame_is_a_point_where_no_contacts_are_declared() -> None:
    own = bench("two_link")
    q = own.given["q"]
    frames = own.robot.frame_jacobian(q)
    assert (own.robot.contact_jacobian(q) == frames[:, :, :3].reshape(len(q), -1, own.model.nv)).all()
