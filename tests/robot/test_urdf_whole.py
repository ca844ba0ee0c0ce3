"""Whole URDFs, trees and mimic joints, as data: their dynamics against Pinocchio's own reading."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from small_robots import joint, link, robot_data, urdf

from psdmc.dynamics.composite_body import mass_matrix
from psdmc.dynamics.coordinates import gathered_matrix, gathered_torques, joint_positions, joint_rates
from psdmc.dynamics.frames import base_acceleration, frames_of
from psdmc.dynamics.newton_euler import inverse_dynamics
from psdmc.dynamics.parameters import bodies_of
from psdmc.errors import InputError
from psdmc.robot.coordinates import leaders
from psdmc.robot.derivable import require_derivable
from psdmc.robot.urdf_whole import urdf_mechanism, whole_robot

REAL = {
    "allegro_right_hand.urdf": (16, 16),
    "a1.urdf": (12, 12),
    "baxter.urdf": (19, 17),
    "panda.urdf": (9, 8),
    "pr2.urdf": (30, 20),
    "talos_reduced.urdf": (32, 32),
    "tiago_pro.urdf": (33, 23),
}
"""Movable joints, and those that mimic none."""


@pytest.mark.parametrize("name", REAL)
def test_real_trees_have_pinocchios_joints_torques_and_mass_matrix(name: str) -> None:
    text = robot_data(name).read_text(encoding="utf-8")
    tree = urdf_mechanism(text, name, snap=0.0)
    # A continuous joint is one angle here, a cosine and a sine in Pinocchio.
    model = pin.buildModelFromXML(text.replace('type="continuous"', 'type="revolute"'), mimic=True)
    data = model.createData()
    assert list(tree.joint_names) == list(model.names)[1:]
    assert (len(tree), len(leaders(tree.coordinates))) == REAL[name]
    assert len(tree.leaves) > 1
    frames, bodies, drives = frames_of(tree), bodies_of(tree, tree.parameters), [0.0] * len(tree)
    for q, qd, qdd in np.random.default_rng(0).uniform(-1.0, 1.0, (3, 3, model.nv)):
        states = (
            joint_positions(tree.coordinates, q),
            joint_rates(tree.coordinates, qd),
            joint_rates(tree.coordinates, qdd),
        )
        tau = gathered_torques(
            tree.coordinates, inverse_dynamics(frames, bodies, drives, *states, base_acceleration(tree))
        )
        expected = pin.rnea(model, data, q, qd, qdd)
        np.testing.assert_allclose(tau, expected, rtol=0, atol=1e-12 * np.abs(expected).max())
        M = gathered_matrix(tree.coordinates, mass_matrix(frames, bodies, drives, states[0]))
        upper = np.triu(pin.crba(model, data, q))
        whole = upper + np.triu(upper, 1).T
        np.testing.assert_allclose(M, whole, rtol=0, atol=1e-12 * np.abs(whole).max())


HAND = urdf(
    link("base"), link("palm"), link("flange"), link("thumb"), link("index"), link("tip"),
    joint("wrist", "base", "palm"),
    joint("mount", "palm", "flange", kind="fixed"),
    joint("b_thumb", "flange", "thumb", kind="prismatic"),
    joint("a_index", "palm", "index", extra='<limit lower="0" upper="1" velocity="1" effort="1"/>'
          '<mimic joint="b_thumb" multiplier="-2" offset="0.5"/>'),
    joint("last", "index", "tip", extra='<mimic joint="a_index" multiplier="3"/>'),
)  # fmt: skip


def test_a_hand_as_data() -> None:
    hand = urdf_mechanism(HAND, "hand.urdf")
    assert hand.joint_names == ("wrist", "a_index", "last", "b_thumb")
    assert hand.parents == (-1, 0, 1, 0)
    assert [hand.joints[i].link_name for i in hand.leaves] == ["tip", "thumb"]
    # The follower of a follower has the first leader's coordinate: 3 (-2 q + 0.5).
    assert [(c.leader, c.ratio, c.offset) for c in hand.coordinates] == [
        (0, 1.0, 0.0), (3, -2.0, 0.5), (3, -6.0, 1.5), (3, 1.0, 0.0),
    ]  # fmt: skip
    with pytest.raises(InputError, match="link 'palm' carries joints 'a_index' and 'b_thumb'"):
        require_derivable(hand)


@pytest.mark.parametrize(
    ("parts", "message"),
    [
        ((joint("a", "base", "one", extra='<mimic joint="a"/>'),), "joint 'a' mimics itself"),
        (
            (
                joint("a", "base", "one", extra='<mimic joint="b"/>'),
                joint("b", "base", "two", extra='<mimic joint="a"/>'),
            ),
            "joint 'a' mimics itself, by way of 'b'",
        ),
        ((joint("a", "base", "one", extra='<mimic joint="c"/>'),), "mimics 'c', which is no movable joint"),
        ((joint("a", "base", "one", extra='<mimic multiplier="x" joint="a"/>'),), "multiplier='x'"),
        ((joint("a", "base", "one", kind="floating"),), "joint 'a': type 'floating' is not supported"),
        ((joint("a", "base", "one", kind="fixed"),), "no movable joint"),
    ],
)
def test_what_no_mechanism_has_is_refused(parts: tuple[str, ...], message: str) -> None:
    links = [link("base"), link("one"), *([link("two")] if len(parts) > 1 else [])]
    with pytest.raises(InputError, match=message) as refused:
        urdf_mechanism(urdf(*links, *parts), "arm.urdf")
    assert str(refused.value).startswith("arm.urdf: ")
    assert refused.value.hint


def test_a_chain_is_read_whole_as_it_is_read_alone(tmp_path) -> None:
    from psdmc.robot.load import load_robot

    path = tmp_path / "arm.urdf"
    path.write_text(
        urdf(link("base"), link("one"), link("two"), joint("a", "base", "one", rpy="1.5708 0 0"),
             joint("b", "one", "two", kind="prismatic", axis="0 1 0")), encoding="utf-8"
    )  # fmt: skip
    whole, alone = whole_robot(path), load_robot(path).chain
    assert whole.is_serial
    require_derivable(whole)
    for one, other in zip(whole.joints, alone.joints, strict=True):
        assert (one.name, one.link_name, one.type, one.limits) == (
            other.name,
            other.link_name,
            other.type,
            other.limits,
        )
        np.testing.assert_array_equal(one.placement.rotation, other.placement.rotation)
        np.testing.assert_array_equal(one.placement.translation, other.placement.translation)
    np.testing.assert_array_equal(whole.parameters, alone.parameters)
