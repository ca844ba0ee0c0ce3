"""Momentum against Pinocchio and against the generalized momentum of the first joint."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from against_pinocchio import ARM, EVERY, bench, matches_pinocchio
from bundled import bundled_model

from psdmc.errors import InputError
from psdmc.lower.admitted import require


@pytest.mark.parametrize(("robot", "real"), EVERY)
def test_the_momentum_is_pinocchios_about_the_bases_origin(robot: str, real: str) -> None:
    matches_pinocchio("momentum", robot, real)


def test_along_the_first_axis_it_is_what_the_mass_matrix_says() -> None:
    """kr6's first axis is vertical through the base's origin: what turns about it is (M qd)_1."""
    own = bench(ARM)
    first = own.model.chain.joints[0].placement
    axis = first.rotation[:, 2]
    q, qd = own.given["q"], own.given["qd"]
    found = own.robot.momentum(q, qd)
    about = found[:, 3:] - np.cross(first.translation, found[:, :3])
    expected = np.einsum("sj,sj->s", own.model.mass_matrix(q)[:, 0], qd)
    np.testing.assert_allclose(about @ axis, expected, atol=1e-11 * np.abs(expected).max())


def test_a_calibrated_model_has_none() -> None:
    """Base parameters that are not those of the file's links do not say how its mass is spread."""
    model = bundled_model("kr6")
    require(model, ["momentum"])
    moved = replace(model, theta_b=np.asarray(model.theta_b) * 1.01)
    with pytest.raises(InputError, match="no momentum: it needs mass and inertia of every link") as caught:
        require(moved, ["momentum", "gravity"])
    assert "--functions gravity" in str(caught.value.hint)


def test_unknown_inertias_leave_none() -> None:
    model = bundled_model("scara")
    unknown = np.array(model.chain.parameters)
    unknown[1, 0] = np.nan
    with pytest.raises(InputError, match="some are unknown"):
        require(replace(model, mechanism=replace(model.chain, parameters=unknown)), ["momentum"])
