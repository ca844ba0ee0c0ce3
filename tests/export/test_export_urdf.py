"""Written robots, read by Pinocchio and MuJoCo alone, have the torques of theta_b."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from bundled import robot_path
from command_line import status
from pendulum import pendulum
from pinocchio_robots import path_of
from shared_data import UR10_LOG

import psdmc
from psdmc.dynamics.parameters import inertia_of, standard_parameters
from psdmc.errors import InputError
from psdmc.friction.laws import LAWS
from psdmc.links.physical_links import NoSuchLinks
from psdmc.model.calibrated import by_joint
from psdmc.model.calibrated_json import from_json
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.robot.inertia import leading_rows

AGREEMENT = 1e-9
"""Share of a joint's largest torque: what the command promises."""

ARM = """<?xml version="1.0"?>
<robot name="arm &amp; hand">
  <material name="grey"><color rgba="0.5 0.5 0.5 1"/></material>
  <link name="base"/>
  <link name="upper &quot;arm&quot;">
    <inertial><origin xyz="0.1 0.02 0.3" rpy="0.1 0.2 0.3"/><mass value="3"/>
      <inertia ixx="0.05" ixy="0.001" ixz="0" iyy="0.04" iyz="0" izz="0.03"/></inertial>
    <visual><geometry><mesh filename="../../../etc/passwd"/></geometry><material name="grey"/></visual>
  </link>
  <link name="gauge">
    <inertial><mass value="0.4"/><inertia ixx="0.001" ixy="0" ixz="0" iyy="0.001" iyz="0" izz="0.001"/></inertial>
  </link>
  <link name="left"><inertial><origin xyz="0 0.1 0"/><mass value="1"/>
    <inertia ixx="0.02" ixy="0" ixz="0.001" iyy="0.02" iyz="0" izz="0.02"/></inertial></link>
  <link name="right"><inertial><origin xyz="0.1 0 0"/><mass value="1.2"/>
    <inertia ixx="0.02" ixy="0" ixz="0" iyy="0.03" iyz="0.002" izz="0.02"/></inertial></link>
  <link name="finger tip"/>
  <joint name="lift &lt;1&gt;" type="revolute"><origin xyz="0 0 0.2" rpy="0 1.5708 0"/><parent link="base"/>
    <child link="upper &quot;arm&quot;"/><axis xyz="0 0 1"/><limit lower="-2" upper="2" effort="80" velocity="3"/>
    <dynamics damping="0.3" friction="0.2"/></joint>
  <joint name="gauge" type="fixed"><origin xyz="0.2 0 0.1" rpy="0 0 0.4"/><parent link="upper &quot;arm&quot;"/>
    <child link="gauge"/></joint>
  <joint name="spread" type="continuous"><origin xyz="0 0 0.1" rpy="0.3 0 0"/><parent link="gauge"/>
    <child link="left"/><axis xyz="0 1 0"/><limit effort="5" velocity="9"/></joint>
  <joint name="slide" type="prismatic"><origin xyz="0.1 0.2 0"/><parent link="upper &quot;arm&quot;"/>
    <child link="right"/><axis xyz="1 0 0.5"/><limit lower="0" upper="0.3" effort="50" velocity="1"/></joint>
  <joint name="tip" type="fixed"><origin xyz="0.05 0 0"/><parent link="right"/><child link="finger tip"/></joint>
</robot>
"""


@pytest.fixture
def arm(tmp_path: Path) -> DynamicsModel:
    (tmp_path / "arm.urdf").write_text(ARM, encoding="utf-8")
    return psdmc.derive(tmp_path / "arm.urdf", frames=("finger tip", "gauge"))


def of_random_links(model: DynamicsModel, seed: int) -> DynamicsModel:
    """The model with base parameters of random bodies, drawn as points of mass: physical by their making."""
    rng = np.random.default_rng(seed)
    x = np.array(model.mechanism.parameters)
    for link in x:
        masses, places = rng.uniform(0.05, 0.5, 12), rng.normal(scale=0.1, size=(12, 3))
        second = (places.T * masses) @ places
        link[:10] = standard_parameters(masses.sum(), masses @ places, inertia_of(second))
        link[10] = rng.uniform(0.05, 0.5)
    span = model.mechanism.parameter_span
    return replace(model, theta_b=model.B @ span @ x.reshape(-1)[leading_rows(span)])


def states(model: DynamicsModel, count: int = 30) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(7)
    return tuple(rng.uniform(-2.0, 2.0, (count, model.nv)) for _ in range(3))  # type: ignore[return-value]


def by_pinocchio(text: str, model: DynamicsModel, states) -> np.ndarray:
    """Torques of the text as Pinocchio reads it; a joint that follows another adds its share to that one's."""
    found = pin.buildModelFromXML(text)
    data, torques = found.createData(), np.zeros((len(states[0]), model.nv))
    joints = [found.joints[found.getJointId(name)] for name in model.joint_names]
    own = model.mechanism.own_joints
    for row, (q, qd, qdd) in enumerate(zip(*states, strict=True)):
        their_q, their_v, their_a = pin.neutral(found), np.zeros(found.nv), np.zeros(found.nv)
        for joint, follows in zip(joints, model.mechanism.coordinates, strict=True):
            k, ratio = own.index(follows.leader), follows.ratio
            at = ratio * q[k] + follows.offset
            their_q[joint.idx_q : joint.idx_q + joint.nq] = [np.cos(at), np.sin(at)] if joint.nq == 2 else at
            their_v[joint.idx_v], their_a[joint.idx_v] = ratio * qd[k], ratio * qdd[k]
        tau = pin.rnea(found, data, their_q, their_v, their_a)
        for joint, follows in zip(joints, model.mechanism.coordinates, strict=True):
            torques[row, own.index(follows.leader)] += follows.ratio * tau[joint.idx_v]
    return torques


def by_mujoco(text: str, model: DynamicsModel, states) -> np.ndarray:
    mujoco = pytest.importorskip("mujoco")
    found = mujoco.MjModel.from_xml_string(text)
    found.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
    found.dof_damping[:] = 0.0
    ids = [mujoco.mj_name2id(found, mujoco.mjtObj.mjOBJ_JOINT, name) for name in model.joint_names]
    places, rates = found.jnt_qposadr[ids], found.jnt_dofadr[ids]
    data, torques = mujoco.MjData(found), np.zeros((len(states[0]), model.nv))
    for row, (q, qd, qdd) in enumerate(zip(*states, strict=True)):
        data.qpos[places], data.qvel[rates], data.qacc[rates] = q, qd, qdd
        mujoco.mj_inverse(found, data)
        torques[row] = data.qfrc_inverse[rates]
    return torques


def without_shapes(text: str) -> str:
    """MuJoCo opens the files of meshes, which a test does not have."""
    root = ET.fromstring(text)
    for link in root.findall("link"):
        for tag in ("visual", "collision"):
            for shape in link.findall(tag):
                link.remove(shape)
    return ET.tostring(root, encoding="unicode")


def error(found: np.ndarray, expected: np.ndarray) -> float:
    return float((np.abs(found - expected).max(axis=0) / np.abs(expected).max(axis=0)).max())


def drive_torque(text: str, model: DynamicsModel, qdd: np.ndarray) -> np.ndarray:
    """What the drives whose armature an MJCF states take."""
    drives = {j.get("name"): float(j.get("armature", "0")) for j in ET.fromstring(text).iter("joint")}
    return qdd * np.array([drives[name] for name in model.joint_names])


@pytest.mark.parametrize("name", ["kr6", "lbr7", "denso_floor", "denso_wall"])
@pytest.mark.parametrize("seed", [0, 1])
def test_a_dh_robot_of_random_links_is_written_from_the_model(name: str, seed: int, tmp_path: Path) -> None:
    model = of_random_links(psdmc.derive(robot_path(name), expand=False), seed)
    written = psdmc.export_urdf(model, tmp_path / "robot.urdf", mjcf=True)
    at = states(model)
    expected = model.inverse_dynamics(*at)
    mjcf = written.mjcf.read_text(encoding="utf-8")
    by_urdf = by_pinocchio(written.urdf.read_text(encoding="utf-8"), model, at)
    assert error(by_urdf + drive_torque(mjcf, model, at[2]), expected) < AGREEMENT
    assert error(by_mujoco(mjcf, model, at), expected) < AGREEMENT
    assert all(link[0] >= 0.0 for link in written.links.parameters)


def test_drive_inertia_is_said_and_is_armature_in_the_mjcf(tmp_path: Path) -> None:
    model = psdmc.derive(robot_path("denso_wall"), expand=False)
    written = psdmc.export_urdf(model, tmp_path / "robot.urdf")
    armatures = [joint.get("armature") for joint in ET.parse(written.mjcf).iter("joint")]
    assert armatures == ["0.7", "0.8", "0.561", "0.0838", "0.092", "0.0306"]
    assert "drive inertia, which a URDF cannot hold" in written.notes[0]


def test_a_tree_keeps_its_names_shapes_limits_and_frames(arm: DynamicsModel, tmp_path: Path) -> None:
    model = of_random_links(arm, 3)
    written = psdmc.export_urdf(model, tmp_path / "back.urdf")
    text = written.urdf.read_text(encoding="utf-8")
    at = states(model)
    expected = model.inverse_dynamics(*at)
    assert written.mjcf is None
    assert error(by_pinocchio(text, model, at), expected) < AGREEMENT
    assert error(by_mujoco(without_shapes(text), model, at), expected) < AGREEMENT
    root, before = ET.fromstring(text), ET.fromstring(ARM)
    for tag in ("link", "joint"):
        assert [e.get("name") for e in root.findall(tag)] == [e.get("name") for e in before.findall(tag)]
    assert [e.attrib for e in root.iter("limit")] == [e.attrib for e in before.iter("limit")]
    assert [e.attrib for e in root.iter("dynamics")] == [{"damping": "0.3", "friction": "0.2"}]
    assert [e.get("filename") for e in root.iter("mesh")] == ["../../../etc/passwd"]
    again = psdmc.derive(written.urdf, frames=("finger tip", "gauge"))
    theirs, ours = again.mechanism.frames, model.mechanism.frames
    for there, here in zip(theirs, ours, strict=True):
        assert np.allclose(there.placement.translation, here.placement.translation, atol=1e-15)
        assert np.allclose(there.placement.rotation, here.placement.rotation, atol=1e-15)


def test_what_the_file_says_is_kept_to_the_last_digit(arm: DynamicsModel, tmp_path: Path) -> None:
    written = psdmc.export_urdf(arm, tmp_path / "back.urdf")
    assert np.array_equal(written.links.parameters, arm.mechanism.parameters)
    assert not written.links.divergence.any()


@pytest.mark.parametrize("name", ["solo12", "baxter", "panda"])
def test_whole_robots_of_others(name: str, tmp_path: Path) -> None:
    model = psdmc.derive(path_of(name), expand=False)
    written = psdmc.export_urdf(model, tmp_path / "back.urdf")
    at = states(model)
    found = by_pinocchio(written.urdf.read_text(encoding="utf-8"), model, at)
    assert error(found, model.inverse_dynamics(*at)) < AGREEMENT


def test_a_floating_robot(tmp_path: Path) -> None:
    model = psdmc.derive(path_of("solo12"), expand=False, floating=True)
    written = psdmc.export_urdf(model, tmp_path / "back.urdf")
    before = pin.buildModelFromUrdf(path_of("solo12"), pin.JointModelFreeFlyer())
    after = pin.buildModelFromXML(written.urdf.read_text(encoding="utf-8"), pin.JointModelFreeFlyer())
    rng = np.random.default_rng(0)
    for _ in range(10):
        q = pin.integrate(before, pin.neutral(before), rng.uniform(-2.0, 2.0, before.nv))
        rates = rng.uniform(-2.0, 2.0, (2, before.nv))
        expected = pin.rnea(before, before.createData(), q, *rates)
        found = pin.rnea(after, after.createData(), q, *rates)
        assert np.abs(found - expected).max() < AGREEMENT * np.abs(expected).max()


def test_a_chain_cut_out_of_a_tree(arm: DynamicsModel, tmp_path: Path) -> None:
    (tmp_path / "arm.urdf").write_text(ARM, encoding="utf-8")
    model = of_random_links(psdmc.derive(tmp_path / "arm.urdf", base='upper "arm"', tip="right"), 0)
    written = psdmc.export_urdf(model, tmp_path / "back.urdf")
    text = written.urdf.read_text(encoding="utf-8")
    at = states(model)
    assert error(by_pinocchio(text, model, at), model.inverse_dynamics(*at)) < AGREEMENT
    types = {e.get("name"): e.get("type") for e in ET.fromstring(text).findall("joint")}
    assert types["spread"] == "fixed"
    assert "lift <1>" not in types


def test_base_parameters_of_no_links_are_refused_with_a_distance(tmp_path: Path) -> None:
    model = psdmc.derive(robot_path("denso_wall"), expand=False)
    assert model.theta_b is not None
    drive = model.base_parameters[-1]
    assert drive.equation == "Im6"
    wrong = replace(model, theta_b=np.append(model.theta_b[:-1], -0.05))
    with pytest.raises(NoSuchLinks, match="the nearest that some have changes torques by 0") as refused:
        psdmc.export_urdf(wrong, tmp_path / "robot.urdf")
    assert 1e-4 < refused.value.distance < 1.0
    assert not list(tmp_path.iterdir())


PENDULUM = pendulum(mass=1.0, x=-0.1, yy=0.01, zz=0.01)


def test_the_distance_is_that_of_the_nearest_pendulum(tmp_path: Path) -> None:
    """Of a pendulum with inertia -0.1 kg m^2 and no moment the torque is all wrong: the nearest that exists has none, and
    the difference is as large as the torque, which is even over its range: 1 / sqrt(3) of its largest."""
    (tmp_path / "pendulum.toml").write_text(PENDULUM, encoding="utf-8")
    model = psdmc.derive(tmp_path / "pendulum.toml")
    is_inertia = np.array([parameter.unit == "kg m^2" for parameter in model.base_parameters])
    assert is_inertia.sum() == 1
    with pytest.raises(NoSuchLinks) as refused:
        psdmc.export_urdf(replace(model, theta_b=np.where(is_inertia, -0.1, 0.0)), tmp_path / "robot.urdf")
    assert refused.value.distance == pytest.approx(1.0 / np.sqrt(3.0), rel=0.1)


def test_friction_of_a_linear_fit_is_in_dynamics_and_its_offset_is_said(
    arm: DynamicsModel, tmp_path: Path
) -> None:
    rows = [
        {"joint": "slide", "name": name, "value": value, "unit": "", "std": None, "seen": True}
        for name, value in (("coulomb", 1.5), ("viscous", 0.25), ("offset", 0.4))
    ]
    kept = {"friction": rows, "prediction": {"law": "linear", "exponents": [1.0]}}
    model = replace(arm, calibrated=from_json(kept))
    written = psdmc.export_urdf(model, tmp_path / "back.urdf")
    dynamics = {j.get("name"): j.find("dynamics") for j in ET.parse(written.urdf).getroot().findall("joint")}
    assert dynamics["slide"].attrib == {"damping": "0.25", "friction": "1.5"}
    assert any("in either direction (offset): joint 'slide'" in note for note in written.notes)


def test_the_line_nearest_to_a_viscous_law_that_is_none() -> None:
    """By numbers: the least-squares slope through the origin of 2 v^0.5 over 0 to 3 rad/s."""
    line = LAWS["viscous"].line
    assert line is not None
    v = np.linspace(0.0, 3.0, 200_001)
    constant, slope, lost = line([2.0], 0.5, 3.0)
    assert (constant, lost != "") == (0.0, True)
    assert slope / 2.0 == pytest.approx(np.sum(v * np.sqrt(v)) / np.sum(v * v), rel=1e-5)


def test_the_command_says_what_it_read_back(arm: DynamicsModel, tmp_path: Path, capsys) -> None:
    arm.save(tmp_path / "arm.npz")
    assert status("export-urdf", tmp_path / "arm.npz", "-o", tmp_path / "back.urdf", "--mjcf") == 0
    said = capsys.readouterr().out
    assert "back.urdf: Pinocchio's torques are theta_b's to" in said
    assert (tmp_path / "back.xml").exists()


def test_outputs_that_would_overwrite_something(arm: DynamicsModel, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="psdmc writes the MJCF to this file"):
        psdmc.export_urdf(arm, tmp_path / "robot.xml", mjcf=True)
    with pytest.raises(InputError, match="No such file or directory"):
        psdmc.export_urdf(arm, tmp_path / "missing" / "robot.urdf")
    unknown = replace(arm, theta_b=None)
    with pytest.raises(InputError, match="unknown"):
        psdmc.export_urdf(unknown, tmp_path / "robot.urdf")


@pytest.mark.skipif(not UR10_LOG.exists(), reason="the UR10's log is not part of the project")
def test_a_calibrated_ur10_keeps_its_drives_and_friction(tmp_path: Path) -> None:
    model = psdmc.derive(path_of("ur10"), expand=False, drive_inertia=True)
    found = psdmc.calibrate(model, UR10_LOG / "exciting_trajectory.csv").model
    written = psdmc.export_urdf(found, tmp_path / "ur10.urdf")
    at = states(found)
    mjcf = written.mjcf.read_text(encoding="utf-8")
    by_urdf = by_pinocchio(written.urdf.read_text(encoding="utf-8"), found, at)
    assert error(by_urdf + drive_torque(mjcf, found, at[2]), found.inverse_dynamics(*at)) < AGREEMENT
    assert error(by_mujoco(mjcf, found, at), found.inverse_dynamics(*at)) < AGREEMENT
    assert found.calibrated is not None
    rows = by_joint(found.calibrated.friction)
    for joint in ET.parse(written.mjcf).iter("joint"):
        assert float(joint.get("frictionloss", "nan")) == rows[joint.get("name"), "coulomb"]
        assert float(joint.get("damping", "nan")) == rows[joint.get("name"), "viscous"]


def test_an_mjcf_with_armature_is_written(tmp_path: Path) -> None:
    """psdmc's own words for drives in the text made of an MJCF must not stay in the URDF: it was read back with them."""
    pytest.importorskip("mujoco")
    text = """<mujoco><worldbody><body name="a"><joint name="j" axis="0 1 0" armature=".3"/>
    <geom size=".1" pos=".1 0 0"/></body></worldbody></mujoco>"""
    (tmp_path / "arm.xml").write_text(text)

    found = psdmc.export_urdf(psdmc.derive(tmp_path / "arm.xml"), tmp_path / "out.urdf")

    assert found.readings[0].error < 1e-12
    assert ":drive" not in found.urdf.read_text()


def test_the_mjcf_beside_replaces_no_file_of_the_users(arm: DynamicsModel, tmp_path: Path) -> None:
    mine = tmp_path / "back.xml"
    mine.write_text("<mujoco/>", encoding="utf-8")

    with pytest.raises(InputError, match=r"back\.xml: psdmc did not write this file") as refused:
        psdmc.export_urdf(arm, tmp_path / "back.urdf", mjcf=True)

    assert "--no-mjcf" in str(refused.value.hint)
    assert not (tmp_path / "back.urdf").exists()
    assert psdmc.export_urdf(arm, tmp_path / "back.urdf", mjcf=False).mjcf is None
    assert mine.read_text(encoding="utf-8") == "<mujoco/>"
    mine.unlink()
    for _ in range(2):  # its own it replaces
        assert psdmc.export_urdf(arm, tmp_path / "back.urdf", mjcf=True).mjcf == mine
