"""Standard parameters moved between frames, against Pinocchio."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from random_chains import random_chain

from psdmc.dynamics.parameters import bodies_of, drive_inertia_of, inertia_matrix, joint_frame_map, moved
from psdmc.robot.mechanism import Placement


@pytest.mark.parametrize("seed", range(5))
def test_joint_frame_map(seed: int) -> None:
    chain = random_chain(seed, "R")
    place, x = chain.joints[0].link_frame, chain.parameters[0, :10]
    body = pin.Inertia.FromDynamicParameters(x.copy())
    outer = pin.SE3(place.rotation.copy(), place.translation.copy()).act(body).toDynamicParameters()
    assert np.allclose(joint_frame_map(place) @ x, outer, rtol=1e-13, atol=1e-14)
    assert np.allclose(moved(joint_frame_map(place) @ x, place.inverse()), x, rtol=1e-13, atol=1e-14)


def test_a_frame_that_stays_changes_no_bit() -> None:
    assert np.array_equal(joint_frame_map(Placement.identity()), np.eye(10))


def test_bodies_hold_integrals_over_the_mass() -> None:
    chain = random_chain(0, "RP")
    for form in (chain.parameters, chain.parameters.reshape(-1)):
        for body, joint, x in zip(bodies_of(chain, form), chain.joints, chain.parameters, strict=True):
            about = joint_frame_map(joint.link_frame) @ x[:10]
            second = 0.5 * np.trace(inertia_matrix(about)) * np.eye(3) - inertia_matrix(about)
            assert body.mass == x[0]
            assert np.allclose(body.moment, about[1:4])
            xx, yy, zz, xy, xz, yz = body.second
            assert np.allclose([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]], second)


def test_drive_inertias() -> None:
    assert drive_inertia_of(np.arange(22.0)) == [10.0, 21.0]
