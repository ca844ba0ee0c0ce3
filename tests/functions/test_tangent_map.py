"""The map from the entries of q to the tangent, against Pinocchio, differences of positions, and its null space."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from against_pinocchio import ARM, EVERY, bench, matches_pinocchio
from wide_robots import KINDS, is_pinocchios, wide_robot


@pytest.mark.parametrize(("robot", "real"), EVERY)
def test_it_is_pinocchios(robot: str, real: str) -> None:
    matches_pinocchio("tangent_map", robot, real)


def test_a_chains_is_the_identity() -> None:
    own = bench(ARM)
    found = own.robot.tangent_map(own.given["q"])
    assert np.array_equal(found, np.broadcast_to(np.eye(own.model.n), found.shape))


@pytest.mark.parametrize("name", KINDS)
def test_of_wide_joints_it_is_pinocchios(name: str) -> None:
    is_pinocchios("tangent_map", name, in_c=name == "free")


@pytest.mark.parametrize("length", [1e-3, 1.0, 7.0])
def test_it_is_the_way_between_positions_made_of_length_one(length: float) -> None:
    """Also for a quaternion of another length, along which nothing moves."""
    own = wide_robot("free")
    robot, model = own.compiled("tangent_map"), own.pinocchio.model
    q, unit = own.given["q"][0].copy(), own.model.mechanism.types[0].unit
    q[unit] *= length
    found = robot.tangent_map(q)
    step = 1e-5 * length
    for k, way in enumerate(step * np.eye(own.model.nq)):
        slope = pin.difference(model, pin.normalize(model, q - way), pin.normalize(model, q + way)) / (
            2 * step
        )
        np.testing.assert_allclose(found[:, k], slope, rtol=0.0, atol=1e-8 / min(length, 1.0))
    along = np.zeros(own.model.nq)
    along[unit] = q[unit]
    assert np.abs(found @ along).max() < 1e-15 * np.abs(found).max() * max(1.0, length)
    assert np.isnan(robot.tangent_map(np.where(np.isin(np.arange(own.model.nq), range(3, 7)), 0.0, q))).any()
