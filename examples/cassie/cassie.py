"""Cassie's closed loops: accelerations by psdmc beside Pinocchio's and MuJoCo's.

    python examples/cassie/cassie.py CASSIE.sdf

The file is cassie.sdf of the Python package example-robot-data. It describes a tree, and joints that close its loops: the
achilles rods and the plantar rods. The program writes the tree and the loops as an MJCF, which the three programs read.
It leaves out the gearboxes with their rotors, and the springs of the knees.
"""

from __future__ import annotations

import argparse
import xml.etree.ElementTree as ET
from pathlib import Path

import mujoco
import numpy as np
import pinocchio

import psdmc
from psdmc.mujoco import from_qvel, to_qpos

STATES, SEED = 20, 3
SOFTNESS = 1e-6
"""Share of MuJoCo's own softness of constraints that is left."""

LOOPS = ("achilles-spring-joint", "plantar-foot-joint")


def numbers(element: ET.Element, path: str, default: str = "0 0 0 0 0 0") -> np.ndarray:
    return np.array((element.findtext(path) or default).split(), dtype=float)


def placed(pose: np.ndarray) -> pinocchio.SE3:
    return pinocchio.SE3(pinocchio.rpy.rpyToMatrix(*pose[3:]), pose[:3])


def words(values: np.ndarray) -> str:
    return " ".join(repr(float(value)) for value in values)


def place_of(inner: pinocchio.SE3) -> dict[str, str]:
    x, y, z, w = pinocchio.Quaternion(inner.rotation).coeffs()
    return {"pos": words(inner.translation), "quat": words(np.array([w, x, y, z]))}


def mjcf_of(sdf: Path) -> str:
    """The tree of an SDF with its loops as constraints `connect`. Poses of links are in the frame of the model."""
    model = ET.parse(sdf).getroot().find(".//model")
    links = {link.get("name"): link for link in model.findall("link")}
    place = {name: placed(numbers(link, "pose")) for name, link in links.items()}
    joints = [j for j in model.findall("joint") if j.get("type") in ("revolute", "ball")]
    closing = [j for j in joints if j.get("name").endswith(LOOPS)]
    tree = [j for j in joints if j not in closing and not j.findtext("child").endswith("reference")]
    root = ET.Element("mujoco", model="cassie")
    ET.SubElement(root, "compiler", angle="radian", balanceinertia="false", inertiafromgeom="false")
    ET.SubElement(root, "option", gravity="0 0 -9.81", timestep="1e-3")
    bodies = {"pelvis": ET.SubElement(ET.SubElement(root, "worldbody"), "body", name="pelvis")}
    ET.SubElement(bodies["pelvis"], "freejoint", name="root")
    for joint in tree:
        parent, child = joint.findtext("parent"), joint.findtext("child")
        bodies[child] = ET.SubElement(
            bodies[parent], "body", name=child, **place_of(place[parent].inverse() * place[child])
        )
        if joint.get("type") == "ball":
            ET.SubElement(bodies[child], "joint", name=joint.get("name"), type="ball")
            continue
        axis = place[child].rotation.T @ numbers(joint, "axis/xyz")
        ET.SubElement(bodies[child], "joint", name=joint.get("name"), axis=words(axis))
    for name, body in bodies.items():
        inertial, keys = links[name].find("inertial"), ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
        own = placed(numbers(inertial, "pose"))
        xx, yy, zz, xy, xz, yz = (float(inertial.findtext(f"inertia/{key}")) for key in keys)
        matrix = own.rotation @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ own.rotation.T
        full = matrix[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
        values = {
            "pos": words(own.translation),
            "mass": inertial.findtext("mass"),
            "fullinertia": words(full),
        }
        body.insert(0, ET.Element("inertial", values))
    equality = ET.SubElement(root, "equality")
    for joint in closing:  # the pose of the joint is in its child
        parent, child = joint.findtext("parent"), joint.findtext("child")
        at = numbers(joint, "pose")
        before = place[parent].inverse() * place[child] * placed(at)
        own = {"body1": parent, "body2": child, "anchor": words(before.translation)}
        stiff = {"solref": "0.002 1", "solimp": "0.9999999 0.9999999 0.001"}
        ET.SubElement(equality, "connect", name=joint.get("name"), **own, **stiff)
    return ET.tostring(root, encoding="unicode")


def loaded(mjcf: Path) -> psdmc.DynamicsModel:
    """The robot with its loops. A plantar rod moves in a plane, so its loop has no row across the plane."""
    planar = [{"name": f"{side}-plantar-foot-joint", "rows": ["x", "y"]} for side in ("left", "right")]
    return psdmc.derive(mjcf, loops=planar, snap=0.0)


def neutral(robot: psdmc.DynamicsModel) -> np.ndarray:
    return np.concatenate([joint.type.neutral for joint in robot.mechanism.joints])


def closed_state(robot: psdmc.DynamicsModel, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Random positions and rates that all loops allow."""
    q = robot.integrate(neutral(robot), rng.uniform(-0.3, 0.3, robot.nv))
    for _ in range(30):
        q = robot.integrate(q, -np.linalg.pinv(robot.loop_jacobian(q)) @ robot.loop_error(q))
    jacobian, qd = robot.loop_jacobian(q), rng.uniform(-1.0, 1.0, robot.nv)
    return q, qd - np.linalg.pinv(jacobian) @ (jacobian @ qd)


class InPinocchio:
    """The same file, read by Pinocchio, with its own closed loops."""

    def __init__(self, mjcf: Path, robot: psdmc.DynamicsModel) -> None:
        self.model, self.loops = pinocchio.buildModelAndLegacyConstraintsFromMJCF(str(mjcf))
        self.data = self.model.createData()
        self.datas = pinocchio.StdVec_RigidConstraintData()
        self.datas.extend(loop.createData() for loop in self.loops)
        pinocchio.initConstraintDynamics(self.model, self.data, self.loops, self.datas)
        own = [self.model.joints[self._number(name)] for name in robot.joint_names]
        self.positions = np.concatenate([np.arange(j.idx_q, j.idx_q + j.nq) for j in own])
        self.rates = np.concatenate([np.arange(j.idx_v, j.idx_v + j.nv) for j in own])

    def _number(self, name: str) -> int:
        return self.model.getJointId("root" if name == "root_joint" else name)

    def accelerations(self, q: np.ndarray, qd: np.ndarray, tau: np.ndarray) -> np.ndarray:
        theirs = np.zeros(self.model.nq), np.zeros(self.model.nv), np.zeros(self.model.nv)
        theirs[0][self.positions], theirs[1][self.rates], theirs[2][self.rates] = q, qd, tau
        settings = pinocchio.ProximalSettings(1e-14, 1e-14, 1e-9, 50)
        found = pinocchio.constraintDynamics(self.model, self.data, *theirs, self.loops, self.datas, settings)
        return np.asarray(found)[self.rates]


class InMujoco:
    """The same file in MuJoCo. Its constraints `connect` are soft: solimp reaches 0.9999 at most. Smaller weights in
    body_invweight0 make them stiffer. Their acceleration lacks the part of
    the rates, so states are compared at rest."""

    def __init__(self, mjcf: Path, robot: psdmc.DynamicsModel) -> None:
        self.robot, self.model = robot, mujoco.MjModel.from_xml_path(str(mjcf))
        self.model.opt.tolerance, self.model.opt.iterations = 1e-16, 500
        self.model.body_invweight0[:] *= SOFTNESS
        self.data = mujoco.MjData(self.model)

    def accelerations(self, q: np.ndarray, tau: np.ndarray) -> np.ndarray:
        """The change of rates at rest is linear in the torques, so accelerations are converted as rates."""
        self.data.qpos[:], self.data.qvel[:] = to_qpos(self.robot, q, self.model), 0.0
        forces = {name: value for name, value in zip(self.robot.v_names, tau, strict=True) if "." not in name}
        for name, value in forces.items():
            self.data.qfrc_applied[self.model.joint(name).dofadr[0]] = value
        mujoco.mj_forward(self.model, self.data)
        return np.asarray(from_qvel(self.robot, q, self.data.qacc, self.model))


def largest_differences(robot: psdmc.DynamicsModel, mjcf: Path) -> dict[str, float]:
    """Largest differences of accelerations, as shares of the largest acceleration of each state."""
    rng, pin, mj = np.random.default_rng(SEED), InPinocchio(mjcf, robot), InMujoco(mjcf, robot)
    none = np.zeros(len(robot.contacts))
    motors = np.array(["." not in name for name in robot.v_names])
    found: dict[str, list[float]] = {
        "Pinocchio, in motion": [],
        "MuJoCo, at rest": [],
        "gap of the loops (m)": [],
    }
    for _ in range(STATES):
        q, qd = closed_state(robot, rng)
        tau = np.where(motors, rng.uniform(-20.0, 20.0, robot.nv), 0.0)
        own, _ = robot.constrained_forward_dynamics(q, qd, tau, none)
        other = pin.accelerations(q, qd, tau)
        found["Pinocchio, in motion"].append(np.abs(own - other).max() / np.abs(own).max())
        own, _ = robot.constrained_forward_dynamics(q, 0.0 * qd, tau, none)
        found["MuJoCo, at rest"].append(np.abs(own - mj.accelerations(q, tau)).max() / np.abs(own).max())
        found["gap of the loops (m)"].append(np.abs(robot.loop_error(q)).max())
    return {name: float(np.max(values)) for name, values in found.items()}


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("sdf", type=Path)
    parser.add_argument("-o", "--output", type=Path, default=Path("generated/cassie.xml"))
    given = parser.parse_args()
    given.output.parent.mkdir(exist_ok=True)
    given.output.write_text(mjcf_of(given.sdf), encoding="utf-8")
    robot = loaded(given.output)
    print(f"{given.output}: {robot.nv} joint rates, {sum(map(len, robot.loops.values()))} closed rows")
    print(f"largest difference of accelerations, {STATES} states:")
    for name, value in largest_differences(robot, given.output).items():
        print(f"{name:24}{value:9.1e}")


if __name__ == "__main__":
    main()
