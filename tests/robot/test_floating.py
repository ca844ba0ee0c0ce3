"""URDFs whose root link is on a free joint, against Pinocchio's free flyer and MuJoCo's free joint."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from small_robots import torques
from urdf_text import joint, link, urdf

import psdmc
from psdmc.compiler import derive
from psdmc.errors import InputError
from psdmc.model.random_states import states_of
from psdmc.robot.joints import FREE, PRISMATIC, REVOLUTE
from psdmc.robot.load import LoadedRobot, load_robot_text
from psdmc.robot.reference import reference
from psdmc.verification.check import MUJOCO, check_model

BEAST = urdf(
    link("hull"), link("trunk"), link("leg"), link("foot"), link("boom"),
    joint("weld", "hull", "trunk", kind="fixed", rpy="0.4 -0.7 1.1"),
    joint("hip", "trunk", "leg", axis="0.6 0 0.8", rpy="0.3 0.1 -0.2"),
    joint("knee", "leg", "foot", axis="0 1 0", rpy="0 0 0.7"),
    joint("lift", "hull", "boom", kind="prismatic", axis="0 0 1", rpy="0 0.4 0"),
)  # fmt: skip
"""Its root link carries another by a fixed joint, so that the free body is merged."""

FIRST_OPTIONS = {"base", "tip", "gravity", "drive_inertia", "assume_zero", "snap"}
"""Of the first version: a model's hash is of its options, too."""


def floating(text: str = BEAST, **options: object) -> LoadedRobot:
    return load_robot_text(text, "urdf", source_name="beast.urdf", floating=True, **options)  # type: ignore[arg-type]


def free_flyer(text: str = BEAST) -> pin.Model:
    return pin.buildModelFromXML(text, pin.JointModelFreeFlyer())


def on_free_flyer(oracle: pin.Model, *states: np.ndarray) -> np.ndarray:
    data = oracle.createData()
    return np.array([pin.rnea(oracle, data, *state) for state in zip(*states, strict=True)])


def assert_is(robot: LoadedRobot, oracle: pin.Model) -> None:
    assert list(oracle.names)[1:] == list(robot.mechanism.joint_names)
    states = states_of(robot.mechanism, np.random.default_rng(3), 20)
    expected = on_free_flyer(oracle, *states)
    largest = np.abs(expected).max(axis=0)
    assert np.all(np.abs(torques(robot.mechanism, *states) - expected).max(axis=0) <= 1e-12 * largest)


@pytest.mark.parametrize("snap", [0.0, 1e-5])
def test_torques_are_those_of_pinocchios_free_flyer(snap: float) -> None:
    robot = floating(snap=snap)
    assert_is(robot, free_flyer())
    assert robot.mechanism.types == (FREE, PRISMATIC, REVOLUTE, REVOLUTE)
    assert (robot.mechanism.nq, robot.mechanism.nv) == (10, 9)
    assert robot.mechanism.base_name == "universe"
    assert not np.isfinite(
        [robot.mechanism.joints[0].limits.lower, robot.mechanism.joints[0].limits.upper]
    ).any()


def test_gravity_is_along_the_world_frame() -> None:
    oracle = free_flyer()
    oracle.gravity.linear = np.array([1.0, -2.0, 3.0])
    assert_is(floating(gravity=(1.0, -2.0, 3.0)), oracle)


def test_joints_are_held_where_lock_says() -> None:
    whole = free_flyer()
    q = pin.neutral(whole)
    q[whole.joints[whole.getJointId("hip")].idx_q] = 0.7
    oracle = pin.buildReducedModel(whole, [whole.getJointId("hip")], q)
    assert_is(floating(lock={"hip": 0.7}), oracle)


def test_a_single_body_flies() -> None:
    text = urdf(link("drone"))
    robot = floating(text)
    assert_is(robot, free_flyer(text))
    with pytest.raises(InputError, match="no movable joint"):
        load_robot_text(text, "urdf", source_name="drone.urdf")


def test_base_parameters_are_ten_a_body_less_what_joints_hide(tmp_path: Path) -> None:
    file = tmp_path / "beast.urdf"
    file.write_text(BEAST, encoding="utf-8")
    model = derive(file, floating=True)
    assert model.l == 10 * 4 - 3 * 2 - 6 * 1
    assert model.certificate.max() < 1e-13
    model.save(tmp_path / "beast.npz")
    again = psdmc.load(tmp_path / "beast.npz")
    assert again.content_hash == model.content_hash
    assert again.mechanism.types == model.mechanism.types
    states = states_of(model.mechanism, np.random.default_rng(5), 20)
    expected = on_free_flyer(free_flyer(), *states)
    np.testing.assert_allclose(
        again.inverse_dynamics(*states), expected, rtol=0, atol=1e-12 * np.abs(expected).max()
    )


def test_check_compares_with_the_free_flyer_and_with_mujocos_free_joint(tmp_path: Path) -> None:
    pytest.importorskip("mujoco")
    file = tmp_path / "beast.urdf"
    file.write_text(BEAST, encoding="utf-8")
    rows = check_model(derive(file, floating=True, drive_inertia=(0.1, 0.2, 0.3)))
    assert all(row.passed for row in rows)
    by_mujoco = next(row for row in rows if row.against == MUJOCO)
    assert by_mujoco.limit is not None
    assert by_mujoco.error < 1e-12
    assert [row.name for row in rows if row.limit is None] == []
    compared = {row.name for row in rows}
    assert compared >= {
        "derivatives of frame velocities",
        "derivatives of inverse dynamics",
        "forward kinematics",
    }


def test_check_finds_a_robot_that_was_read_wrongly(tmp_path: Path) -> None:
    """A turn between the root link and what is fixed to it."""
    file = tmp_path / "beast.urdf"
    file.write_text(BEAST, encoding="utf-8")
    model = derive(file, floating=True)
    turned = floating(BEAST.replace('rpy="0.4 -0.7 1.1"', 'rpy="0.4 -0.7 1.2"'))
    rows = check_model(model, turned)
    assert any(not row.passed for row in rows)


def test_mimic_joints_follow_on_a_floating_robot(tmp_path: Path) -> None:
    mimic = '<mimic joint="hip" multiplier="-2" offset="0.25"/>'
    file = tmp_path / "beast.urdf"
    file.write_text(
        BEAST.replace('<joint name="knee" type="revolute">', f'<joint name="knee" type="revolute">{mimic}'),
        encoding="utf-8",
    )
    model = derive(file, floating=True)
    assert (model.n, model.nq, model.nv) == (4, 9, 8)
    q, qd, qdd = states_of(model.mechanism, np.random.default_rng(6), 20)
    ratio = np.vstack([np.eye(8), -2.0 * np.eye(8)[7]])
    every_q = np.column_stack([q, -2.0 * q[:, 8] + 0.25])
    expected = on_free_flyer(free_flyer(), every_q, qd @ ratio.T, qdd @ ratio.T) @ ratio
    np.testing.assert_allclose(
        model.inverse_dynamics(q, qd, qdd), expected, rtol=0, atol=1e-12 * np.abs(expected).max()
    )


def test_drive_inertias_are_of_the_joints_alone() -> None:
    robot = floating(drive_inertia=(0.1, 0.2, 0.3))
    np.testing.assert_array_equal(robot.mechanism.parameters[:, -1], [0.0, 0.1, 0.2, 0.3])
    oracle = free_flyer()
    oracle.armature = np.array([0.0] * 6 + [0.1, 0.2, 0.3])
    assert_is(robot, oracle)
    span = robot.mechanism.parameter_span
    assert not span[10].any()
    assert span[21].any()
    with pytest.raises(InputError, match="4 drive inertias for 3 joints"):
        floating(drive_inertia=(0.1, 0.1, 0.2, 0.3))


def test_the_world_has_a_name_of_its_own() -> None:
    text = BEAST.replace('"hull"', '"universe"').replace('"boom"', '"universe_"')
    robot = floating(text)
    assert robot.mechanism.base_name == "universe__"
    assert_is(robot, free_flyer(text))


def test_the_root_link_can_be_a_frame() -> None:
    robot = floating(frames=("hull", "foot"))
    assert [frame.joint for frame in robot.mechanism.frames] == [0, 3]
    np.testing.assert_array_equal(robot.mechanism.frames[0].placement.rotation, np.eye(3))
    assert reference(robot).frame_ids


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"tip": "foot"}, "--floating puts the whole robot on a free joint, --base and --tip cut a chain"),
        ({"base": "trunk"}, "--floating puts the whole robot on a free joint, --base and --tip cut a chain"),
        ({"lock": {"root_joint": 0.0}}, "joint 'root_joint', to be locked, does not exist"),
    ],
)
def test_what_makes_no_sense_with_a_floating_base_is_refused(options: dict[str, object], said: str) -> None:
    with pytest.raises(InputError, match=said):
        floating(**options)


def test_names_and_kinds_of_the_file_do_not_meet_the_free_joints(tmp_path: Path) -> None:
    taken = BEAST.replace('"knee"', '"root_joint"')
    robot = floating(taken)
    assert robot.mechanism.joint_names == ("root_joint_", "lift", "hip", "root_joint")
    oracle = pin.buildModelFromXML(taken, pin.JointModelFreeFlyer(), "root_joint_")
    assert_is(robot, oracle)
    (tmp_path / "x.urdf").write_text(taken, encoding="utf-8")
    assert all(row.passed for row in check_model(derive(tmp_path / "x.urdf", floating=True)))
    assert "root_joint" in load_robot_text(taken, "urdf", source_name="x.urdf").mechanism.joint_names
    free = BEAST.replace('name="knee" type="revolute"', 'name="knee" type="free"')
    for is_floating in (True, False):
        with pytest.raises(InputError, match="joint 'knee': type 'free' is not supported"):
            load_robot_text(free, "urdf", source_name="x.urdf", floating=is_floating)


def test_a_dh_tables_base_stands() -> None:
    with pytest.raises(InputError, match="--floating frees the root link of a URDF"):
        load_robot_text("convention = 'standard'", "dh", source_name="x.toml", floating=True)


def test_floating_is_a_yes_or_no() -> None:
    with pytest.raises(InputError, match="floating is 1"):
        load_robot_text(BEAST, "urdf", source_name="x.urdf", floating=1)  # type: ignore[arg-type]


def test_options_of_other_models_do_not_speak_of_it() -> None:
    fixed = load_robot_text(BEAST, "urdf", source_name="x.urdf")
    assert set(fixed.options.as_json()) == FIRST_OPTIONS
    assert set(floating().options.as_json()) == {*FIRST_OPTIONS, "floating"}
