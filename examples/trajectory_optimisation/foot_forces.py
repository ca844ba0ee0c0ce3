"""The gait of gait.py with forces at the feet as controls: dynamics of psdmc in C++ and in Python, and those of Crocoddyl.

    python examples/trajectory_optimisation/foot_forces.py

Controls are accelerations and forces at the feet. Equality constraints say that no torque acts on the base, and that feet on
the floor do not move. Compiles foot_forces.cpp, a Python module that extends Crocoddyl, with the C package of HyQ. Compares
all three dynamics at random states. The solver Intro then plans the gait in 100 nodes with each of them. A last row has
torques as controls, and Crocoddyl's contact dynamics: its optimum must be the same. Needs what gait.py needs.
"""

from __future__ import annotations

import argparse
import time
from functools import partial
from pathlib import Path

import crocoddyl
import gait
import numpy as np
import pinocchio

import psdmc

FUNCTIONS = (
    "forward_kinematics",
    "frame_jacobian",
    "frame_acceleration",
    "frame_velocity_derivatives",
    "frame_acceleration_derivatives",
    "inverse_dynamics_with_wrenches",
    "inverse_dynamics_with_wrenches_derivatives",
)
ROOT = 6
"""Rates of the base, on which no motor acts."""
VALUES = ("xout", "h", "Fx", "Fu", "Hx", "Hu", "Lx", "Lu", "Lxx", "Lxu", "Luu")
"""Of a node's data: accelerations and constraints, their derivatives, and those of the cost."""


class InPython(crocoddyl.DifferentialActionModelAbstract):
    """A node with dynamics and constraints in NumPy, by functions of `psdmc.compile`. Costs are Crocoddyl's."""

    def __init__(self, robot: psdmc.CompiledRobot, state, actuation, contacts, costs) -> None:
        self.own = crocoddyl.DifferentialActionModelContactInvDynamics(state, actuation, contacts, costs)
        super().__init__(state, self.own.nu, costs.nr, 0, self.own.nh)
        feet = [contacts.contacts[name] for name in gait.FEET]
        self.robot, self.active = robot, np.array([[foot.active] for foot in feet])
        self.floor = np.array([foot.contact.reference for foot in feet])
        self.kp, self.kd = gait.GAINS

    def createData(self) -> Node:  # Crocoddyl's names
        return Node(self)

    def calc(self, data: Node, x, u=None) -> None:
        if u is None:
            self.own.calc(data.own, x)
            data.cost = data.own.cost
            return
        robot, (q, qd, qdd), found = self.robot, self.parts(x, u), data.own.multibody
        pinocchio.forwardKinematics(self.state.pinocchio, data.own.pinocchio, q, qd)
        position, rotation = robot.forward_kinematics(q)
        data.force = self.active * np.reshape(u[len(qd) :], (-1, 3))
        data.wrenches[:, :3] = np.einsum("kji,kj->ki", rotation, data.force)
        tau = robot.inverse_dynamics_with_wrenches(q, qd, qdd, data.wrenches)
        a = robot.frame_acceleration(q, qd, qdd)[:, :3]
        a += self.kd * (robot.frame_jacobian(q)[:, :3] @ qd) + self.kp * (position - self.floor)
        data.xout, data.h = qdd, np.concatenate([(self.active * a).ravel(), tau[:ROOT]])
        found.joint.tau = tau[ROOT:]
        for name, force in zip(gait.FEET, data.force, strict=True):
            found.contacts.contacts[name].f = pinocchio.Force(force, np.zeros(3))
        self.own.costs.calc(data.own.costs, x, u)
        data.cost = data.own.costs.cost

    def calcDiff(self, data: Node, x, u=None) -> None:
        if u is None:
            self.own.calcDiff(data.own, x)
            data.Lx, data.Lxx = data.own.Lx, data.own.Lxx
            return
        robot, at, on = self.robot, self.parts(x, u), self.active[:, :, None]
        pinocchio.computeJointJacobians(self.state.pinocchio, data.own.pinocchio)
        by_q, by_qd, by_qdd, _ = robot.inverse_dynamics_with_wrenches_derivatives(*at, data.wrenches)
        a_q, a_qd, J = robot.frame_acceleration_derivatives(*at)
        a_q = a_q + self.kd * robot.frame_velocity_derivatives(*at[:2]) + self.kp * J
        move, turn = on * J[:, :3], np.cross(data.force[:, None], J[:, 3:].transpose(0, 2, 1))
        by_q = by_q - np.einsum("kia,kbi->ab", move, turn)  # the world's axes turn in the foot
        tau_x = np.hstack([by_q, by_qd])
        tau_u = np.hstack([by_qdd, -move.reshape(-1, len(by_q)).T])
        feet_x = on * np.concatenate([a_q, a_qd + self.kd * J], axis=2)[:, :3]
        off = np.kron(np.diag(1.0 - self.active.ravel()), np.eye(3))
        data.Hx = np.vstack([np.vstack(feet_x), tau_x[:ROOT]])
        data.Hu = np.vstack([np.hstack([np.vstack(move), off]), tau_u[:ROOT]])
        joint = data.own.multibody.joint
        joint.dtau_dx, joint.dtau_du = tau_x[ROOT:], tau_u[ROOT:]
        self.own.costs.calcDiff(data.own.costs, x, u)
        for name in ("Lx", "Lu", "Lxx", "Lxu", "Luu"):
            setattr(data, name, getattr(data.own, name))

    def quasiStatic(self, data: Node, x, *limits) -> np.ndarray:
        return self.own.quasiStatic(data.own, x)

    def parts(self, x, u) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """q, qd and qdd."""
        nq, nv = self.state.nq, self.state.nv
        return x[:nq], x[nq:], u[:nv]


class Node(crocoddyl.DifferentialActionDataAbstract):
    """Data of a node: its own part is what Crocoddyl's costs read. force (4, 3) N, along the world's axes; wrenches (4, 6),
    along those of the feet."""

    def __init__(self, model: InPython) -> None:
        super().__init__(model)
        self.own = model.own.createData()
        self.multibody = self.own.multibody
        self.force, self.wrenches = np.zeros((4, 3)), np.zeros((4, 6))
        self.Fu = np.eye(model.state.nv, model.nu)


def differences(
    problem: crocoddyl.ShootingProblem, reference: crocoddyl.ShootingProblem, plan: gait.Plan, seed: int = 1
) -> dict[str, float]:
    """The largest difference of each value of the nodes at random states and controls, relative to its largest entry."""
    rng, state, found = np.random.default_rng(seed), reference.runningModels[0].state, {}
    for k, x in enumerate(plan.states[:-1]):
        x = state.integrate(x, 0.1 * rng.standard_normal(state.ndx))
        u = 30.0 * rng.standard_normal(reference.runningModels[k].nu)
        both = []
        for one in (problem, reference):
            model = one.runningModels[k].differential
            data = model.createData()
            model.calc(data, x, u)
            model.calcDiff(data, x, u)
            both.append({"cost": data.cost} | {name: np.array(getattr(data, name)) for name in VALUES})
        for name, theirs in both[1].items():
            off = np.abs(both[0][name] - theirs).max() / (1.0 + np.abs(theirs).max())
            found[name] = max(found.get(name, 0.0), float(off))
    return found


def shared_seconds(problem: crocoddyl.ShootingProblem, found: gait.Gait) -> float:
    """CPU time of Crocoddyl's costs and constraints at all nodes, with their derivatives, which every row contains."""
    problem.calc(list(found.xs), list(found.us))
    nodes = [node.differential for node in problem.runningModels]
    datas = [data.differential for data in problem.runningDatas]
    begin = time.process_time()
    for node, data, x, u in zip(nodes, datas, found.xs, found.us, strict=False):
        for part, of in ((node.costs, data.costs), (node.constraints, data.constraints)):
            part.calc(of, x, u)
            part.calcDiff(of, x, u)
    return time.process_time() - begin


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument(
        "--folder", type=Path, default=Path("generated/foot_forces"), help="of the C package and the module"
    )
    parser.add_argument(
        "--repeats", type=int, default=10, help="how often each time is measured; the shortest counts"
    )
    given = parser.parse_args()
    gait.fitting()
    robot = pinocchio.buildModelFromUrdf(str(gait.hyq()), pinocchio.JointModelFreeFlyer())
    model, wanted = gait.derived(), gait.plan(robot)
    in_cpp = gait.module(model, given.folder, "foot_forces", FUNCTIONS).FootForces
    in_python = partial(InPython, psdmc.compile(model, functions=FUNCTIONS))
    crocoddyls = crocoddyl.DifferentialActionModelContactInvDynamics
    ways = {"psdmc in C++": in_cpp, "Crocoddyl in C++": crocoddyls, "psdmc from Python": in_python}
    problems = {name: gait.shooting(robot, wanted, dynamics, True) for name, dynamics in ways.items()}
    theirs = problems["Crocoddyl in C++"]
    for name in ("psdmc in C++", "psdmc from Python"):
        worst = max(differences(problems[name], theirs, wanted).values())
        print(f"{name}, random states: differs by {worst:.1e} from Crocoddyl")
    gait.heading("forces as controls")
    found = {
        name: gait.row(name, problem, given.repeats, crocoddyl.SolverIntro)
        for name, problem in problems.items()
    }
    found["torques as controls"] = gait.row(
        "torques as controls", gait.shooting(robot, wanted, gait.crocoddyls), given.repeats
    )
    best = found.pop("Crocoddyl in C++")
    shared = min(shared_seconds(theirs, best) for _ in range(given.repeats)) / theirs.T
    print(f"costs and constraints, which are Crocoddyl's in every row: {1e6 * shared:.0f} us a node")
    for name, one in found.items():
        apart = abs(one.costs[-1] / best.costs[-1] - 1.0)
        forces = np.abs(one.forces - best.forces).max()
        print(f"{name}: cost differs by {apart:.1e} of the cost, forces by {forces:.1e} N")


if __name__ == "__main__":
    main()
