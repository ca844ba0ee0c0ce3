"""A robot with two arms on a torso, from its URDF to a tested library, as a user types it; and from Python."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from command_line import typed
from unoptimised import without_optimisation, wrapper

import psdmc
from psdmc.model.dynamics_model import DynamicsModel

INERTIA = '<inertia ixx="0.02" iyy="0.03" izz="0.025" ixy="0.001" ixz="-0.002" iyz="0.0015"/>'


def link(name: str, mass: float) -> str:
    return (
        f'<link name="{name}"><inertial><origin xyz="0.05 -0.02 0.1" rpy="0.1 0.2 0.3"/><mass value="{mass}"/>'
        f"{INERTIA}</inertial></link>"
    )


def joint(name: str, parent: str, child: str, kind: str, xyz: str, axis: str) -> str:
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{xyz}" rpy="0 1.5707963267948966 0"/><axis xyz="{axis}"/>'
        '<limit lower="-1" upper="1" velocity="2" effort="9"/></joint>'
    )


TORSO = "".join(
    [
        '<robot name="torso">',
        *(link(name, mass) for mass, name in enumerate(("base", "torso", "arm_l", "hand_l", "arm_r", "hand_r", "eye"), 1)),
        joint("waist", "base", "torso", "revolute", "0 0 0.4", "0 0 1"),
        joint("shoulder_r", "torso", "arm_r", "revolute", "0 -0.2 0.3", "0 1 0"),
        joint("shoulder_l", "torso", "arm_l", "revolute", "0 0.2 0.3", "0 1 0"),
        joint("wrist_l", "arm_l", "hand_l", "prismatic", "0.1 0 0.25", "1 0 0"),
        joint("wrist_r", "arm_r", "hand_r", "continuous", "0.1 0 0.25", "0.6 0 0.8"),
        joint("look", "torso", "eye", "fixed", "0.1 0 0.5", "1 0 0"),
        "</robot>",
    ]
)  # fmt: skip
JOINTS = ["waist", "shoulder_l", "wrist_l", "shoulder_r", "wrist_r"]


@pytest.fixture(scope="module")
def work(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("tree")
    (folder / "torso.urdf").write_text(TORSO, encoding="utf-8")
    done = typed("derive", "torso.urdf", cwd=folder)
    assert done.returncode == 0, done.stderr
    assert "torso.npz: 5 joints, l = " in done.stdout
    assert (
        "note: the whole tree, to its ends 'hand_l', 'hand_r'; --tip LINK takes one chain of it"
        in done.stdout
    )
    return folder


@pytest.fixture(scope="module")
def model(work: Path) -> DynamicsModel:
    return psdmc.load(work / "torso.npz")


@pytest.fixture(scope="module")
def oracle() -> pin.Model:
    found = pin.buildModelFromXML(TORSO.replace("continuous", "revolute"))
    assert list(found.names)[1:] == JOINTS
    return found


def test_show_says_what_each_joint_hangs_on(work: Path) -> None:
    shown = typed("show", "torso.npz", cwd=work).stdout
    assert "base to 2 ends, tip hand_l" in shown
    assert "monomials not expanded (a tree's are only with --expand)" in shown
    lines = [re.split(" {2,}", line) for line in shown.splitlines()]
    first = next(k for k, line in enumerate(lines) if line[:3] == ["joint", "link", "hangs on"]) + 1
    hanging = {line[0]: line[2] for line in lines[first : first + len(JOINTS)]}
    assert hanging == dict(zip(JOINTS, ("base", "torso", "arm_l", "torso", "arm_r"), strict=True))


def test_check_passes_pinocchio_and_mujoco(work: Path) -> None:
    done = typed("check", "torso.npz", cwd=work)
    assert done.returncode == 0, done.stdout
    assert "FAIL" not in done.stdout
    assert "the mass matrix is positive definite" in done.stdout


def test_its_package_is_built_and_passes_its_own_test(work: Path) -> None:
    names = "inverse_dynamics,forward_dynamics,forward_kinematics,frame_jacobian"
    done = typed("emit-c", "torso.npz", "-o", "torso", "--functions", names, cwd=work)
    assert done.returncode == 0, done.stderr
    assert "torso_FRAMES 2" in (work / "torso/include/torso/torso.h").read_text(encoding="utf-8")
    built = typed("build", "torso", cwd=work, CC=str(wrapper(work)))
    assert built.returncode == 0, built.stderr
    assert "self-test passed" in built.stdout


def test_compiled_functions_are_pinocchios(model: DynamicsModel, oracle: pin.Model) -> None:
    with without_optimisation():
        robot, data = psdmc.compile(model), oracle.createData()
    q, qd, qdd = np.random.default_rng(1).uniform(-2.0, 2.0, (3, 20, 5))
    tau = np.array([pin.rnea(oracle, data, *state) for state in zip(q, qd, qdd, strict=True)])
    np.testing.assert_allclose(
        robot.inverse_dynamics(q, qd, qdd), tau, rtol=0, atol=1e-12 * np.abs(tau).max()
    )
    np.testing.assert_allclose(robot.forward_dynamics(q, qd, tau), qdd, rtol=0, atol=1e-10)
    upper = np.triu([pin.crba(oracle, data, row).copy() for row in q])
    mass = upper + np.triu(upper, 1).transpose(0, 2, 1)
    np.testing.assert_allclose(robot.mass_matrix(q), mass, rtol=0, atol=1e-12 * np.abs(mass).max())
    assert not robot.mass_matrix(q)[:, 1:3, 3:].any()
    position, _ = robot.forward_kinematics(q)
    for row, places in zip(q, position, strict=True):
        pin.framesForwardKinematics(oracle, data, row)
        for name, place in zip(("hand_l", "hand_r"), places, strict=True):
            np.testing.assert_allclose(place, data.oMf[oracle.getFrameId(name)].translation, atol=1e-13)


@pytest.mark.parametrize("frame", ["hand_l", "hand_r", None])
def test_a_payload_goes_to_any_frame(model: DynamicsModel, oracle: pin.Model, frame: str | None) -> None:
    """Without a frame to the first, which is the tree's tip."""
    loaded = model.with_payload(2.0, (0.1, 0.0, 0.2), frame=frame)
    there = oracle.frames[oracle.getFrameId(frame or "hand_l")]
    with_load = oracle.copy()
    load = pin.Inertia(2.0, np.array([0.1, 0.0, 0.2]), np.zeros((3, 3)))
    with_load.inertias[there.parentJoint] += there.placement.act(load)
    data = with_load.createData()
    for q, qd, qdd in np.random.default_rng(2).uniform(-2.0, 2.0, (5, 3, 5)):
        expected = pin.rnea(with_load, data, q, qd, qdd)
        np.testing.assert_allclose(
            loaded.inverse_dynamics(q, qd, qdd), expected, atol=1e-12 * np.abs(expected).max()
        )


def test_a_tip_cuts_the_chain_out(work: Path) -> None:
    done = typed("derive", "torso.urdf", "--tip", "hand_r", "-o", "arm.npz", cwd=work)
    assert done.returncode == 0, done.stderr
    chain = psdmc.load(work / "arm.npz")
    assert chain.joint_names == ("waist", "shoulder_r", "wrist_r")
    assert chain.p is not None
