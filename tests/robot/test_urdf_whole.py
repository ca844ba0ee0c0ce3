"""Whole URDFs, trees and mimic joints, as data: their dynamics against Pinocchio's own reading."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from installed import in_wheel
from urdf_text import joint, link, urdf

from psdmc.dynamics.composite_body import mass_matrix
from psdmc.dynamics.frames import base_acceleration, frames_of
from psdmc.dynamics.newton_euler import inverse_dynamics
from psdmc.dynamics.parameters import bodies_of
from psdmc.errors import InputError
from psdmc.robot.coordinates import leaders
from psdmc.robot.load import load_robot_text
from psdmc.robot.mechanism import Mechanism

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


def tree_of(text: str, **options: object) -> Mechanism:
    return load_robot_text(text, "urdf", source_name="hand.urdf", **options).mechanism  # type: ignore[arg-type]


@pytest.mark.parametrize("name", REAL)
def test_real_trees_have_pinocchios_joints_torques_and_mass_matrix(name: str) -> None:
    text = in_wheel(name).read_text(encoding="utf-8")
    tree = tree_of(text, snap=0.0)
    # A continuous joint is one angle here, a cosine and a sine in Pinocchio.
    model = pin.buildModelFromXML(text.replace('type="continuous"', 'type="revolute"'), mimic=True)
    data = model.createData()
    assert list(tree.joint_names) == list(model.names)[1:]
    assert (len(tree), len(leaders(tree.coordinates))) == REAL[name]
    assert len(tree.leaves) > 1
    frames, bodies, drives = frames_of(tree), bodies_of(tree, tree.parameters), [0.0] * len(tree)
    for q, qd, qdd in np.random.default_rng(0).uniform(-1.0, 1.0, (3, 3, model.nv)):
        tau = inverse_dynamics(frames, bodies, drives, q, qd, qdd, base_acceleration(tree))
        expected = pin.rnea(model, data, q, qd, qdd)
        np.testing.assert_allclose(tau, expected, rtol=0, atol=1e-12 * np.abs(expected).max())
        M = mass_matrix(frames, bodies, drives, q)
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
    hand = tree_of(HAND)
    assert hand.joint_names == ("wrist", "a_index", "last", "b_thumb")
    assert hand.parents == (-1, 0, 1, 0)
    assert [hand.joints[i].link_name for i in hand.leaves] == ["tip", "thumb"]
    # The follower of a follower has the first leader's coordinate: 3 (-2 q + 0.5).
    assert [(c.leader, c.ratio, c.offset) for c in hand.coordinates] == [
        (0, 1.0, 0.0), (3, -2.0, 0.5), (3, -6.0, 1.5), (3, 1.0, 0.0),
    ]  # fmt: skip
    assert hand.notes[0] == (
        "the whole tree, to its ends 'tip', 'thumb'; --tip LINK takes one chain of it, as --tip tip"
    )


def test_the_frames_of_a_tree_are_its_ends_and_the_first_is_its_tip() -> None:
    hand = tree_of(HAND)
    assert [(frame.name, frame.joint) for frame in hand.frames] == [("tip", 2), ("thumb", 3)]
    assert (hand.tip_name, hand.tip_body) == ("tip", 2)


def test_the_tip_of_a_tree_is_the_first_frame_that_is_named_and_may_carry_others() -> None:
    hand = tree_of(HAND, frames=("flange", "thumb"), tool=(0.0, 0.0, 0.1, 0.0, 0.0, 0.0))
    assert [(frame.name, frame.joint) for frame in hand.frames] == [("flange", 0), ("thumb", 3), ("tool", 0)]
    assert (hand.tip_name, hand.tip_body) == ("flange", 0)
    assert hand.tip.translation.tolist() == [0.1, 0.2, 0.3]


def test_a_frame_that_nothing_moves_is_refused() -> None:
    with pytest.raises(InputError, match="frame 'base' is fixed to the root: no joint moves it"):
        tree_of(HAND, frames=("base",))


def test_base_and_tip_still_cut_a_chain() -> None:
    chain = tree_of(HAND, tip="thumb")
    assert chain.is_serial
    assert chain.joint_names == ("wrist", "b_thumb")
    assert "locked at zero" in chain.notes[0]
    # Of the palm's own body, its flange, and the fingers that are locked.
    assert chain.parameters[0, 0] == pytest.approx(4 * 1.5)


def test_a_follower_needs_its_leader_on_the_chain() -> None:
    with pytest.raises(InputError, match="joint 'a_index' mimics 'b_thumb', which does not move the chain"):
        tree_of(HAND, tip="tip")


def test_fixed_branches_make_no_tree() -> None:
    arm = tree_of(
        urdf(
            link("base"), link("one"), link("two"), link("camera"),
            joint("a", "base", "one"), joint("b", "one", "two"), joint("eye", "one", "camera", kind="fixed"),
        )
    )  # fmt: skip
    assert arm.is_serial
    assert [frame.name for frame in arm.frames] == ["two"]
    assert not arm.notes


def test_a_turn_that_two_joints_lie_beyond_is_snapped_for_both_and_said_once() -> None:
    from psdmc.robot.snap_bound import angles_by_segment

    parts = (
        link("base"), link("torso"), link("left"), link("right"),
        joint("mount", "base", "torso", kind="fixed", rpy="1.5708 0 0"),
        joint("l", "torso", "left"), joint("r", "torso", "right"),
    )  # fmt: skip
    loaded = load_robot_text(urdf(*parts), "urdf", source_name="two.urdf")
    angles = angles_by_segment(loaded.snap_report, 2, 1e-5)
    assert angles[0] == angles[1] == pytest.approx(1.5708 - np.pi / 2, rel=1e-6)
    said = [note for note in loaded.mechanism.notes if "turned by" in note]
    assert said == ["joint 'mount': turned by 3.7e-06 rad to exact zeros"]


@pytest.mark.parametrize(
    ("parts", "message"),
    [
        ((joint("a", "base", "one", extra='<mimic joint="a"/>'),), "joint 'a' mimics itself"),
        (
            (
                joint("a", "base", "one", extra='<mimic joint="b"/>'),
                joint("b", "base", "two", extra='<mimic joint="a"/>'),
            ),
            "joint 'a' mimics itself through 'b'",
        ),
        ((joint("a", "base", "one", extra='<mimic joint="c"/>'),), "mimics 'c', which is no movable joint"),
        ((joint("a", "base", "one", extra='<mimic multiplier="x" joint="a"/>'),), "multiplier='x'"),
        *(
            (
                (joint("a", "base", "one"), joint("b", "base", "two", extra=f'<mimic joint="a" {numbers}/>')),
                f"joint 'b' mimics 'a': its {message} is out of range",
            )
            for numbers, message in (('offset="-2e3"', "offset -2000"), ('multiplier="2e6"', r"ratio 2e\+06"))
        ),
        ((joint("a", "base", "one", kind="ball"),), "joint 'a': type 'ball' is not supported"),
        ((joint("a", "base", "one", kind="fixed"),), "no movable joint below link 'base'"),
    ],
)
def test_what_no_mechanism_has_is_refused(parts: tuple[str, ...], message: str) -> None:
    links = [link("base"), link("one"), *([link("two")] if len(parts) > 1 else [])]
    with pytest.raises(InputError, match=message) as refused:
        tree_of(urdf(*links, *parts))
    assert str(refused.value).startswith("hand.urdf: ")
    assert refused.value.hint


SHAPE = '<collision><geometry><sphere radius="0.02"/></geometry></collision>'


def dog(shape: str) -> str:
    """Two legs as of Unitree's own Go2: along each calf a chain of two shapes, and a foot; a head on the trunk."""
    parts = [link("trunk"), link("head"), link("jaw")]
    parts += [joint("neck", "trunk", "head", kind="fixed"), joint("chin", "head", "jaw", kind="fixed")]
    for side in "LR":
        parts += [
            link(f"{side}_thigh"),
            link(f"{side}_calf"),
            link(f"{side}_lower", shape),
            link(f"{side}_lower1", shape),
        ]
        parts += [link(f"{side}_foot"), link(f"{side}_rotor")]
        parts += [
            joint(f"{side}_hip", "trunk", f"{side}_thigh", axis="0 1 0"),
            joint(f"{side}_knee", f"{side}_thigh", f"{side}_calf", axis="0 1 0"),
            joint(f"{side}_rotor_joint", f"{side}_thigh", f"{side}_rotor", kind="fixed"),
            joint(f"{side}_lower_joint", f"{side}_calf", f"{side}_lower", kind="fixed"),
            joint(f"{side}_lower1_joint", f"{side}_lower", f"{side}_lower1", kind="fixed"),
            joint(f"{side}_foot_joint", f"{side}_calf", f"{side}_foot", kind="fixed"),
        ]
    return urdf(*parts)


@pytest.mark.parametrize("floating", [False, True])
def test_a_shape_along_a_leg_is_no_default_frame_and_neither_is_what_a_moving_body_carries(
    floating: bool,
) -> None:
    """Feet are the ends: not the calves' collision shapes, nor rotors and a head on bodies that carry moving joints."""
    robot = load_robot_text(dog(SHAPE), "urdf", floating=floating).mechanism
    assert [frame.name for frame in robot.frames] == ["L_foot", "R_foot"]
    carriers = {robot.joints[frame.joint].name for frame in robot.frames}
    assert carriers == {"L_knee", "R_knee"}, "none of a body that carries a moving joint"
    asked = load_robot_text(dog(SHAPE), "urdf", floating=floating, frames=["L_lower1", "jaw"][: 1 + floating])
    assert [frame.name for frame in asked.mechanism.frames] == ["L_lower1", "jaw"][: 1 + floating]
    seen = load_robot_text(dog(SHAPE + "<visual/>"), "urdf", floating=floating).mechanism
    assert [frame.name for frame in seen.frames] == ["L_lower1", "R_lower1"]
