"""A palletiser with two parallelograms picks up a box of 80 kg and puts it onto a pallet, in MuJoCo.

    python examples/palletiser/pick.py --plot pick.png

psdmc reads the tree and its loops, and computes with the four motors' coordinates. MuJoCo gets the same tree with three
equality constraints, which are soft. The program compares the torques of both and prints how well the arm tracks.
"""

from __future__ import annotations

import argparse
import tomllib
from pathlib import Path

import mujoco
import numpy as np

import psdmc

HERE = Path(__file__).resolve().parent
URDF, LOOPS = HERE / "palletiser.urdf", HERE / "palletiser_loops.toml"
BOX, CENTRE, EDGE = 80.0, (0.0, 0.0, -0.3), (0.6, 0.4, 0.3)
"""kg, m in the flange's frame, m."""

STEP, GAINS = 0.0005, (400.0, 40.0)
"""s of the simulation and of the controller; 1/s^2 and 1/s."""

POSES = [  # s to get there; axes 1, 2, 4 and 3, the order of the model; whether the box is held from there on
    (0.0, (0.0, 0.0, 0.0, 0.0), False),
    (1.2, (0.9, 0.35, 0.9, 0.75), True),
    (1.0, (0.9, 0.05, 0.9, 0.25), True),
    (1.4, (-0.7, 0.15, 0.4, 0.30), True),
    (1.0, (-0.7, 0.5, 0.4, 0.70), False),
    (1.2, (0.0, 0.0, 0.0, 0.0), False),
]


def plant() -> mujoco.MjModel:
    """MuJoCo's model of the tree, with a constraint for each loop and a box that has a mass only while it is held."""
    spec = mujoco.MjSpec.from_file(str(URDF))
    spec.compiler.fusestatic = False  # the box stays a body
    for loop in tomllib.loads(LOOPS.read_text(encoding="utf-8"))["loop"]:
        own = spec.add_equality()
        own.type, own.objtype = mujoco.mjtEq.mjEQ_CONNECT, mujoco.mjtObj.mjOBJ_BODY
        own.name1, own.name2 = loop["first"]["link"], loop["second"]["link"]
        own.data[:3] = loop["first"]["xyz"]
        own.solref[:2], own.solimp[:3] = (2.0 * STEP, 1.0), (0.9999, 0.9999, 0.001)
    box = spec.body("flange").add_body(name="box", pos=CENTRE)
    box.mass, box.inertia, box.explicitinertial = 1e-9, [1e-9] * 3, True
    for name in ("axis_1", "axis_2", "axis_4", "axis_3"):
        motor = spec.add_actuator(name=name, target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
        motor.gainprm[0] = 1.0
    spec.option.timestep, spec.option.integrator = STEP, mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    spec.option.gravity = [0.0, 0.0, -9.81]
    return spec.compile()


def inertia_of_box() -> np.ndarray:
    x, y, z = np.square(EDGE)
    return BOX / 12.0 * np.array([y + z, x + z, x + y])


def hold(model: mujoco.MjModel, data: mujoco.MjData, is_held: bool) -> None:
    """Give the box its mass, or take the mass away."""
    body = model.body("box").id
    model.body_mass[body] = BOX if is_held else 1e-9
    model.body_inertia[body] = inertia_of_box() if is_held else 1e-9
    kept = [data.qpos.copy(), data.qvel.copy()]
    mujoco.mj_setConst(model, data)
    data.qpos[:], data.qvel[:] = kept


def motion(t: float) -> tuple[np.ndarray, np.ndarray, np.ndarray, bool]:
    """Positions, rates and accelerations of the motors at time t (polynomials of degree five), and if the box is held."""
    ends = np.cumsum([length for length, _, _ in POSES])
    k = min(int(np.searchsorted(ends, t, side="right")), len(POSES) - 1)
    (_, start, held), (length, end, _) = POSES[k - 1 : k + 1]
    t = min(t - ends[k - 1], length)
    s, way = t / length, np.subtract(end, start)
    by_s = [s**3 * (10 - 15 * s + 6 * s * s), 30 * s * s * (1 - s) ** 2, 60 * s * (1 - s) * (1 - 2 * s)]
    q, qd, qdd = (np.asarray(way * value / length**k) for k, value in enumerate(by_s))
    return q + start, qd, qdd, held


def largest_difference(robot: psdmc.DynamicsModel, joints: list[int]) -> float:
    """Compare torques with MuJoCo's inverse dynamics of the tree at random states, as a share of the largest torque."""
    model = mujoco.MjModel.from_xml_path(str(URDF))
    model.opt.disableflags = mujoco.mjtDisableBit.mjDSBL_CONSTRAINT  # limits of joints
    data, shares = mujoco.MjData(model), couplings(robot)
    rng, found, largest = np.random.default_rng(1), 0.0, 0.0
    for q, qd, qdd in rng.uniform(-1.5, 1.5, (200, 3, 4)):
        data.qpos[joints], data.qvel[joints], data.qacc[joints] = shares @ q, shares @ qd, shares @ qdd
        mujoco.mj_inverse(model, data)
        expected = shares.T @ data.qfrc_inverse[joints]
        found = max(found, float(np.abs(robot.inverse_dynamics(q, qd, qdd) - expected).max()))
        largest = max(largest, float(np.abs(expected).max()))
    return found / largest


def couplings(robot: psdmc.DynamicsModel) -> np.ndarray:
    """The matrix from the motors' coordinates to those of all joints; the palletiser's offsets are zero."""
    own = robot.mechanism.own_joints
    found = np.zeros((robot.n, robot.nv))
    for joint, coordinate in enumerate(robot.mechanism.coordinates):
        for leader, ratio in coordinate.shares:
            found[joint, own.index(leader)] = ratio
    return found


def simulate(robot: psdmc.DynamicsModel, joints: list[int]) -> dict[str, np.ndarray]:
    """Track the motion by computed torque. Return arrays over time."""
    model, shares = plant(), couplings(robot)
    data, own = mujoco.MjData(model), list(robot.mechanism.own_joints)
    compiled = psdmc.compile(robot, functions=["inverse_dynamics"])
    x, y, z = inertia_of_box()
    thetas = [robot.theta_b, robot.with_payload(BOX, CENTRE, np.diag([x, y, z]), "flange").theta_b]
    motors = [joints[i] for i in own]
    rows, is_held = [], False
    for k in range(round(sum(length for length, _, _ in POSES) / STEP)):
        q, qd, qdd, wanted = motion(k * STEP)
        if wanted != is_held:
            is_held = wanted
            hold(model, data, is_held)
        error, rate = q - data.qpos[motors], qd - data.qvel[motors]
        push = qdd + GAINS[0] * error + GAINS[1] * rate
        tau = compiled.inverse_dynamics(data.qpos[motors], data.qvel[motors], push, theta_b=thetas[is_held])
        data.ctrl[:] = tau
        mujoco.mj_step(model, data)
        gap = np.abs(data.qpos[joints] - shares @ data.qpos[motors]).max()
        tilt = np.arccos(np.clip(data.body("flange").xmat[8], -1.0, 1.0))
        rows.append([k * STEP, *tau, *error, *data.body("flange").xpos, gap, tilt])
    table = np.array(rows)
    names = {"t": 0, "tau": slice(1, 5), "error": slice(5, 9), "place": slice(9, 12), "gap": 12, "tilt": 13}
    return {name: table[:, place] for name, place in names.items()}


def plot(found: dict[str, np.ndarray], names: tuple[str, ...], path: str) -> None:
    import matplotlib.pyplot as plt

    figure, (above, below) = plt.subplots(2, 1, sharex=True, figsize=(8, 5), layout="constrained")
    for k, name in enumerate(names):
        above.plot(found["t"], found["tau"][:, k] / 1e3, label=name)
    above.set(ylabel="torque (kN m)")
    above.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))
    for k, axis in enumerate("xyz"):
        below.plot(found["t"], found["place"][:, k], label=f"flange {axis}")
    below.set(xlabel="time (s)", ylabel="position (m)")
    below.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))
    ends = np.cumsum([length for length, _, _ in POSES])
    for each in (above, below):
        each.axvspan(ends[1], ends[4], color="0.9", zorder=0)
        each.grid(alpha=0.3)
    above.set_title("A palletiser picks up 80 kg (grey: the box is held)", fontsize=10)
    figure.savefig(path, dpi=130)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--plot", metavar="FILE")
    given = parser.parse_args()
    robot = psdmc.derive(URDF, loops=LOOPS)
    tree = mujoco.MjModel.from_xml_path(str(URDF))
    joints = [int(tree.joint(name).qposadr[0]) for name in robot.joint_names]
    difference = largest_difference(robot, joints)
    found = simulate(robot, joints)
    print(f"{robot.n} joints, {robot.nv} motors, {robot.l} base parameters")
    print(f"torques, largest difference from MuJoCo      {difference:9.1e} of the largest torque")
    print(f"tracking error, largest                      {np.abs(found['error']).max():9.1e} rad")
    print(f"joints of MuJoCo's loops, off by at most     {found['gap'].max():9.1e} rad")
    print(f"tilt of the flange, largest                  {found['tilt'].max():9.1e} rad")
    for k, name in enumerate(robot.v_names):
        print(f"torque of {name}, largest                 {np.abs(found['tau'][:, k]).max():12.0f} N m")
    if given.plot:
        plot(found, robot.v_names, given.plot)


if __name__ == "__main__":
    main()
