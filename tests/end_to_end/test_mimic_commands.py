"""A gripper whose fingers close together, from its URDF to a tested library, as a user types it."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from command_line import typed
from slow_cases import slow_but_for
from test_tree_commands import joint, link
from unoptimised import without_optimisation, wrapper

import psdmc
from psdmc.errors import DerivationError, InputError
from psdmc.robot.load import load_robot_text

MIMIC = '<mimic joint="left" multiplier="-0.8" offset="0.02"/></joint>'
AGAIN = '<mimic joint="right" multiplier="2"/></joint>'
GRIPPER = "".join(
    [
        '<robot name="gripper">',
        *(link(name, mass) for mass, name in enumerate(("base", "arm", "palm", "finger_l", "finger_r", "pad"), 1)),
        joint("shoulder", "base", "arm", "revolute", "0 0 0.4", "0 1 0"),
        joint("wrist", "arm", "palm", "continuous", "0.3 0 0", "0.6 0 0.8"),
        joint("left", "palm", "finger_l", "prismatic", "0 0.1 0.1", "0 1 0"),
        joint("right", "palm", "finger_r", "prismatic", "0 -0.1 0.1", "0 1 0").replace("</joint>", MIMIC),
        joint("tilt", "finger_r", "pad", "revolute", "0 0 0.1", "1 0 0").replace("</joint>", AGAIN),
        "</robot>",
    ]
)  # fmt: skip
COORDINATES = ("shoulder", "wrist", "left")


@pytest.fixture(scope="module")
def work(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("gripper")
    (folder / "gripper.urdf").write_text(GRIPPER, encoding="utf-8")
    done = typed("derive", "gripper.urdf", cwd=folder)
    assert done.returncode == 0, done.stderr
    assert "gripper.npz: 5 joints with 3 coordinates, l = " in done.stdout
    return folder


@pytest.fixture(scope="module")
def oracle() -> pin.Model:
    """Pinocchio's own mimic joints; it has none that follow a follower."""
    direct = '<mimic joint="left" multiplier="-1.6" offset="0.04"/></joint>'
    return pin.buildModelFromXML(GRIPPER.replace("continuous", "revolute").replace(AGAIN, direct), mimic=True)


def test_show_says_what_each_joint_follows(work: Path) -> None:
    shown = typed("show", "gripper.npz", cwd=work).stdout
    rows = {
        row[0]: row[3]
        for line in reversed(shown.splitlines())  # of several pieces of the table the first counts
        if len(row := re.split(" {2,}", line)) > 3
    }
    assert rows["left"] == "its own"
    assert rows["right"] == "-0.8 q of left + 0.02"
    assert rows["tilt"] == "-1.6 q of left + 0.04"


def test_check_passes_with_both_readers(work: Path) -> None:
    done = typed("check", "gripper.npz", cwd=work)
    assert done.returncode == 0, done.stdout
    assert "FAIL" not in done.stdout
    assert "and with MuJoCo" in done.stdout


@pytest.mark.parametrize("functions", slow_but_for(["default"], ["default", "all"]))
def test_its_package_has_an_entry_for_each_coordinate_and_passes_its_own_test(
    work: Path, tmp_path: Path, functions: str
) -> None:
    folder = tmp_path / "gripper"
    done = typed("emit-c", "gripper.npz", "-o", folder, "--functions", functions, cwd=work)
    assert done.returncode == 0, done.stderr
    header = (folder / "include/gripper/gripper.h").read_text(encoding="utf-8")
    assert "#define gripper_DOF 3" in header
    assert "right follows left: q = -0.8 q_left + 0.02" in header
    built = typed("build", folder, cwd=work, CC=str(wrapper(tmp_path)))
    assert built.returncode == 0, built.stderr
    assert "self-test passed" in built.stdout


def test_compiled_functions_are_pinocchios_mimic_joints(work: Path, oracle: pin.Model) -> None:
    model = psdmc.load(work / "gripper.npz")
    with without_optimisation():
        robot, data = psdmc.compile(model), oracle.createData()
    q, qd, qdd = np.random.default_rng(1).uniform(-2.0, 2.0, (3, 20, 3))
    tau = np.array([pin.rnea(oracle, data, *state) for state in zip(q, qd, qdd, strict=True)])
    upper = np.triu([pin.crba(oracle, data, row).copy() for row in q])
    mass = upper + np.triu(upper, 1).transpose(0, 2, 1)
    np.testing.assert_allclose(
        robot.inverse_dynamics(q, qd, qdd), tau, rtol=0, atol=1e-12 * np.abs(tau).max()
    )
    np.testing.assert_allclose(robot.mass_matrix(q), mass, rtol=0, atol=1e-12 * np.abs(mass).max())
    np.testing.assert_allclose(robot.forward_dynamics(q, qd, tau), qdd, rtol=0, atol=1e-10)
    for row, jacobians in zip(q, robot.frame_jacobian(q), strict=True):
        for name, found in zip(("finger_l", "pad"), jacobians, strict=True):
            frame = oracle.getFrameId(name)
            expected = pin.computeFrameJacobian(oracle, data, row, frame, pin.LOCAL_WORLD_ALIGNED)
            np.testing.assert_allclose(found, expected, atol=1e-13)


def test_derivatives_are_differences(work: Path) -> None:
    model = psdmc.load(work / "gripper.npz")
    with without_optimisation():
        robot = psdmc.compile(
            model, functions=["inverse_dynamics_derivatives", "forward_dynamics_derivatives"]
        )
    q, qd, qdd = np.random.default_rng(2).uniform(-1.0, 1.0, (3, 3))
    tau = model.inverse_dynamics(q, qd, qdd)
    step = 1e-6 * np.eye(3)
    by_q = (model.inverse_dynamics(q + step, qd, qdd) - model.inverse_dynamics(q - step, qd, qdd)).T / 2e-6
    found = robot.inverse_dynamics_derivatives(q, qd, qdd)
    np.testing.assert_allclose(found[0], by_q, atol=1e-7 * np.abs(by_q).max())
    np.testing.assert_allclose(found[2], model.mass_matrix(q), atol=1e-12)
    solved = robot.forward_dynamics_derivatives(q, qd, tau)
    np.testing.assert_allclose(solved[0], qdd, atol=1e-11)
    np.testing.assert_allclose(solved[1], -np.linalg.solve(model.mass_matrix(q), by_q), atol=1e-5)


def test_a_payload_on_a_follower_counts(work: Path, oracle: pin.Model) -> None:
    loaded = psdmc.load(work / "gripper.npz").with_payload(0.5, (0.0, 0.1, 0.0), frame="pad")
    there = oracle.frames[oracle.getFrameId("pad")]
    with_load = oracle.copy()
    with_load.inertias[there.parentJoint] += there.placement.act(
        pin.Inertia(0.5, np.array([0.0, 0.1, 0.0]), np.zeros((3, 3)))
    )
    data = with_load.createData()
    for q, qd, qdd in np.random.default_rng(2).uniform(-2.0, 2.0, (5, 3, 3)):
        expected = pin.rnea(with_load, data, q, qd, qdd)
        np.testing.assert_allclose(
            loaded.inverse_dynamics(q, qd, qdd), expected, atol=1e-12 * np.abs(expected).max()
        )


def test_a_wrong_shape_names_the_coordinates(work: Path) -> None:
    model = psdmc.load(work / "gripper.npz")
    with pytest.raises(InputError, match=r"q has shape \(5,\), expected \(\.\.\., 3\)") as refused:
        model.inverse_dynamics(np.zeros(5), np.zeros(5), np.zeros(5))
    assert "shoulder, wrist, left" in str(refused.value.hint)


def test_e_and_p_of_an_angle_that_follows_a_sliding_joint_are_refused() -> None:
    from psdmc.derivation.derive import derive_model

    with pytest.raises(DerivationError, match="E and P: an angle follows a sliding joint"):
        derive_model(load_robot_text(GRIPPER, "urdf").mechanism, expand=True)
