"""Every way of reading a robot gives the torques of Pinocchio's own reading of the same text."""

from __future__ import annotations

import numpy as np
import pinocchio
import pytest
from installed import in_wheel
from small_robots import EXAMPLES, largest_difference, load_dh, load_urdf
from urdf_text import joint, link

from psdmc.dynamics.composite_body import mass_matrix
from psdmc.dynamics.frames import frames_of
from psdmc.dynamics.kinematics import jacobian
from psdmc.dynamics.parameters import bodies_of
from psdmc.errors import InternalError
from psdmc.robot.load import load_robot
from psdmc.robot.reference import Reference, reference
from psdmc.robot.reference_model import reference_model

TOLERANCE = 1e-12

FOREIGN = {
    "ur5_robot.urdf": 6,
    "ur10_robot.urdf": 6,
    "quadruped.urdf": 8,
    "kinova.urdf": 6,
    "z1.urdf": 7,
    "xarm7.urdf": 7,
    "anymal.urdf": 12,
    "b1-z1.urdf": 19,
}


@pytest.mark.parametrize("file", sorted(path.name for path in EXAMPLES.iterdir()))
def test_bundled_robots(file):
    loaded = load_robot(EXAMPLES / file)

    assert largest_difference(loaded, snapped=True) < TOLERANCE
    assert largest_difference(loaded.unsnapped(), snapped=False) < TOLERANCE


@pytest.mark.parametrize(("file", "joints"), FOREIGN.items())
def test_robots_of_other_people(file, joints):
    loaded = load_robot(in_wheel(file))

    assert len(loaded.chain) == joints
    assert largest_difference(loaded, snapped=True) < TOLERANCE
    assert largest_difference(loaded.unsnapped(), snapped=False) < TOLERANCE


def test_snapping_changes_a_rounded_robot_by_about_its_rounding():
    loaded = load_robot(EXAMPLES / "rounded_arm.urdf")

    assert 1e-7 < largest_difference(loaded, snapped=False) < 1e-4


@pytest.mark.parametrize("kind", ["revolute", "continuous", "prismatic"])
@pytest.mark.parametrize(
    "axis", ["1 0 0", "0 1 0", "0 0 1", "-1 0 0", "0 -1 0", "0 0 -1", "0 2 2", "-0.3 0.5 -0.7", "0.6 0 -0.8"]
)
def test_any_axis(kind, axis):
    loaded = load_urdf(
        *(link(name) for name in ("base", "a", "b", "c")),
        joint("j1", "base", "a", axis="0 1 0", rpy="0.4 0.1 -0.3"),
        joint("j2", "a", "b", kind=kind, axis=axis, rpy="-0.2 0.7 0.1"),
        joint("j3", "b", "c", axis="1 0 0", rpy="1.1 0 0.2"),
        snap=0.0,
    )

    assert largest_difference(loaded, snapped=False) < TOLERANCE


def test_fixed_joints_and_bodies_beside_the_chain_are_merged():
    loaded = load_urdf(
        *(link(name) for name in ("base", "arm", "bracket", "hand", "camera", "finger", "lamp")),
        joint("shoulder", "base", "arm", rpy="0.1 0.2 0.3"),
        joint("plate", "arm", "bracket", kind="fixed", rpy="0.3 0 0.1"),
        joint("wrist", "bracket", "hand", axis="1 0 0"),
        joint("mount", "arm", "camera", kind="fixed", xyz="0.3 0 0"),
        joint("grip", "hand", "finger", kind="prismatic"),
        joint("lamp_ball", "arm", "lamp", kind="floating"),
        tip="hand",
        snap=0.0,
    )

    assert loaded.chain.joint_names == ("shoulder", "wrist")
    assert loaded.chain.parameters[:, 0].tolist() == pytest.approx([6.0, 3.0])
    assert largest_difference(loaded, snapped=False) < TOLERANCE
    assert any("'grip', 'lamp_ball'" in note for note in loaded.chain.notes)


def test_a_base_turned_in_the_root_turns_gravity_with_it():
    parts = (
        *(link(name) for name in ("world", "cart", "base", "arm", "hand")),
        joint("rail", "world", "cart", kind="prismatic"),
        joint("mount", "cart", "base", kind="fixed", rpy="0 1.5708 0"),
        joint("shoulder", "base", "arm", axis="0 1 0"),
        joint("wrist", "arm", "hand", axis="1 0 0", rpy="0.2 0 0"),
    )
    loaded = load_urdf(*parts, base="base")
    plain = load_urdf(*parts, base="base", gravity=(1.0, 2.0, 3.0), snap=0.0)

    assert loaded.chain.joint_names == ("shoulder", "wrist")
    assert loaded.chain.gravity.tolist() == [9.81, 0.0, 0.0]
    assert largest_difference(loaded, snapped=True) < TOLERANCE
    assert largest_difference(plain, snapped=False) < TOLERANCE


ROWS = (
    """name = "one"
a = 0.3
alpha = "-90 deg"
d = 0.2
theta = 0.4
drive_inertia = 0.7
link = { mass = 2.0, com = [0.1, -0.2, 0.05],
 inertia_com = { xx = 0.03, yy = 0.04, zz = 0.05, xy = 0.001, xz = -0.002, yz = 0.003 } }""",
    """name = "two"
type = "prismatic"
a = -0.1
alpha = 0.7
d = 0.4
theta = "30 deg"
link = { mass = 1.0, com = [0.0, 0.1, 0.3],
 inertia_com = { xx = 0.02, yy = 0.03, zz = 0.02, xy = 0.0, xz = 0.0, yz = 0.001 } }""",
    """name = "three"
a = 0.2
alpha = "45 deg"
d = -0.1
theta = -0.2
link = { mass = 0.5, com = [0.02, 0.0, 0.1],
 inertia_com = { xx = 0.002, yy = 0.003, zz = 0.002, xy = 0.0, xz = 0.0, yz = 0.0001 } }""",
)


@pytest.mark.parametrize("convention", ["standard", "modified"])
def test_both_dh_conventions_and_both_kinds_of_joint(convention):
    loaded = load_dh(*(row.replace("\n inertia", " inertia") for row in ROWS), convention=convention)

    assert loaded.chain.convention == convention
    assert largest_difference(loaded, snapped=False) < TOLERANCE
    assert largest_difference(loaded, snapped=True) < TOLERANCE


def test_standard_dh_tip_is_the_product_of_the_rows():
    def row(angle, d, a, alpha):
        s, c, sa, ca = np.sin(angle), np.cos(angle), np.sin(alpha), np.cos(alpha)
        return np.array(
            [[c, -s * ca, s * sa, a * c], [s, c * ca, -c * sa, a * s], [0, sa, ca, d], [0, 0, 0, 1]]
        )

    chain = load_dh(*(text.replace("\n inertia", " inertia") for text in ROWS)).chain
    q = np.array([0.3, 0.15, -0.8])
    expected = row(0.4 + q[0], 0.2, 0.3, -np.pi / 2) @ row(np.pi / 6, 0.4 + q[1], -0.1, 0.7)
    expected = expected @ row(-0.2 + q[2], -0.1, 0.2, np.pi / 4)

    found = np.eye(4)
    for each, value in zip(chain.joints, q, strict=True):
        turn = row(value, 0, 0, 0) if each.kind == "revolute" else row(0, value, 0, 0)
        found = found @ matrix(each.placement) @ turn

    np.testing.assert_allclose(found @ matrix(chain.tip), expected, atol=1e-15)


def matrix(placement):
    result = np.eye(4)
    result[:3, :3], result[:3, 3] = placement.rotation, placement.translation
    return result


@pytest.mark.parametrize("snapped", [True, False])
def test_mass_matrix_and_jacobian(snapped):
    loaded = load_robot(in_wheel("quadruped.urdf"), snap=1e-5 if snapped else 0.0, drive_inertia=[0.1] * 8)
    chain, oracle = loaded.chain, reference(loaded, snapped=snapped)
    q = np.random.default_rng(3).normal(size=8)

    found = mass_matrix(frames_of(chain), bodies_of(chain, chain.parameters), [0.1] * 8, q)

    np.testing.assert_allclose(found, oracle.mass_matrix(q), atol=1e-13)
    np.testing.assert_allclose(
        jacobian(frames_of(chain), chain.tip_body, chain.tip, q), oracle.jacobian(q), atol=1e-14
    )


def test_the_reference_agrees_with_itself():
    oracle = reference(load_robot(EXAMPLES / "denso_wall.toml"))
    q, qd, qdd = np.random.default_rng(5).normal(size=(3, 4, 6))

    tau = oracle.inverse_dynamics(q, qd, qdd)

    np.testing.assert_allclose(oracle.forward_dynamics(q, qd, tau), qdd, rtol=1e-9)
    bias = oracle.nonlinear_effects(q, qd)
    np.testing.assert_allclose(np.einsum("kij,kj->ki", oracle.mass_matrix(q), qdd) + bias, tau, rtol=1e-11)
    by_parts = np.einsum("kij,kj->ki", oracle.coriolis_matrix(q, qd), qd) + oracle.gravity(q)
    np.testing.assert_allclose(by_parts, bias, rtol=1e-11)


def test_the_reference_takes_other_parameters():
    loaded = load_dh('name = "one"\na = 0.5', 'name = "two"\na = 0.4')
    x = np.random.default_rng(2).normal(size=(2, 11))

    model = reference_model(loaded, parameters=x)

    assert model.nq == model.nv == 2
    assert model.armature.tolist() == x[:, 10].tolist()
    with pytest.raises(ValueError, match="unknown"):
        reference_model(loaded)


@pytest.mark.parametrize("snapped", [False, True])
def test_the_longest_way_is_that_over_all_links(snapped: bool):
    urdf = load_urdf(
        *(link(name) for name in ("base", "a", "b", "c")),
        joint("j1", "base", "a", xyz="0 0 3"),
        joint("j2", "a", "b", xyz="4 0 0"),
        joint("j3", "a", "c", xyz="1 0 0"),
    )
    dh = load_dh("[[joint]]\nd = 3.0\nname = 'a'\n[[joint]]\na = 4.0\n[[joint]]\nparent = 'a'\na = 1.0\n")

    for robot in (urdf, dh):
        parameters = np.zeros(robot.mechanism.parameters.shape)
        assert reference(robot, snapped=snapped, parameters=parameters).path_length == pytest.approx(7.0)


@pytest.mark.parametrize("parents", [{1: 2, 2: 1}, {2: 2}, {2: 1000}, {2: 2**64 - 1}])
def test_frames_that_hang_on_no_root_are_an_error_and_no_endless_loop(parents: dict[int, int]):
    model = pinocchio.buildSampleModelManipulator()
    for frame, parent in parents.items():
        model.frames[frame].parentFrame = parent

    with pytest.raises(InternalError, match="hangs on no root"):
        _ = Reference(model, model.frames[2].name).path_length
