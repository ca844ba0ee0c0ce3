"""A trot of the quadruped HyQ in Crocoddyl: with contact dynamics of psdmc, and with those of Crocoddyl.

    python examples/trajectory_optimisation/gait.py [--plot gait.png]

Derives the robot, writes its C package, and compiles contact_dynamics.cpp, a Python module that extends Crocoddyl. Then the
solver FDDP plans three steps in 100 nodes with each dynamics. Costs, gains, contacts and the first guess are equal. Prints
costs, iterations, iterations per second, and the largest differences. Needs g++ and the wheels crocoddyl==3.2.1, pin==4.0.0,
cmeel-eigen and example-robot-data.
"""

from __future__ import annotations

import argparse
import importlib.metadata
import importlib.util
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType

import crocoddyl
import numpy as np
import pinocchio

import psdmc

HERE = Path(__file__).parent
FEET = ("lf_foot", "lh_foot", "rf_foot", "rh_foot")
FUNCTIONS = (
    "forward_kinematics",
    "contact_jacobian",
    "constrained_forward_dynamics",
    "constrained_forward_dynamics_derivatives",
)
FRONT, HIND = [0.0, 0.8, -1.6], [0.0, -0.8, 1.6]
STEP = 0.01
"""s between two nodes."""
ONE, OTHER = ("lf_foot", "rh_foot"), ("rf_foot", "lh_foot")
PHASES = (
    (10, (), 0.0),
    (20, ONE, 0.1),
    (5, (), 0.0),
    (20, OTHER, 0.2),
    (5, (), 0.0),
    (20, ONE, 0.1),
    (20, (), 0.0),
)
"""Nodes, feet in the air, and length of their step (m): 100 nodes."""
HEIGHT = 0.08
"""m, of a foot in the middle of its step."""
GAINS = np.array([400.0, 40.0])
"""1/s^2 and 1/s: Baumgarte's stabilisation of position and velocity."""
FRICTION = 0.7
POSTURE = np.concatenate([np.repeat([10.0, 100.0, 1.0], [3, 3, 12]), np.repeat([1.0, 0.1], [6, 12])])
EFFORT, CONE, SWING, LAST = 1e-4, 1e-2, 1e5, 10.0
"""Weights: of torques, of forces outside the friction pyramid, of feet away from their path, of the posture at the end."""

COMPILED_WITH = {"3.2.1": "4.0"}
"""By version of the wheel crocoddyl, the Pinocchio with which it was compiled. Others have data of another layout."""

Array = np.ndarray


@dataclass(frozen=True)
class Plan:
    """What each node asks for. One row per state, of which there is one more than nodes.

    air    (k + 1, 4) bool: feet in the air
    feet   (k + 1, 4, 3) m: where each foot is to be
    states (k + 1, 37) of the posture
    """

    air: Array
    feet: Array
    states: Array


@dataclass(frozen=True)
class Gait:
    """A solution: xs (k + 1, 37), us (k, controls), forces (k, 4, 3) N, costs of all iterations, CPU seconds."""

    xs: Array
    us: Array
    forces: Array
    costs: list[float]
    iterations: int
    seconds: float


def hyq() -> Path:
    wheel = importlib.metadata.distribution("example-robot-data")
    file = next(file for file in wheel.files or () if file.name == "hyq_no_sensors.urdf")
    return Path(str(wheel.locate_file(file)))


def plan(robot: pinocchio.Model, phases: tuple[tuple[int, tuple[str, ...], float], ...] = PHASES) -> Plan:
    """Feet follow quintic curves. The base moves by the mean of the feet's steps, at constant speed."""
    data, q = robot.createData(), np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, *FRONT, *HIND, *FRONT, *HIND])
    pinocchio.framesForwardKinematics(robot, data, q)
    here = np.array([data.oMf[robot.getFrameId(foot)].translation for foot in FEET])
    q[2] = -here[:, 2].min()
    here[:, 2] = 0.0
    air, feet = [], []
    for nodes, moving, length in phases:
        off = np.isin(FEET, moving)
        for share in np.arange(nodes) / nodes:
            place = here.copy()
            place[off, 0] += length * share**3 * (10.0 + share * (6.0 * share - 15.0))
            place[off, 2] += HEIGHT * 64.0 * (share * (1.0 - share)) ** 3
            air.append(off)
            feet.append(place)
        here[off, 0] += length
    air.append(np.zeros(len(FEET), bool))
    feet.append(here)
    states = np.tile(np.concatenate([q, np.zeros(robot.nv)]), (len(air), 1))
    first, last = phases[0][0], len(air) - 1 - phases[-1][0]
    way = np.mean(feet[-1] - feet[0], axis=0)[0]
    states[:, 0] = np.interp(np.arange(len(air)), [first, last], [0.0, way])
    return Plan(np.array(air), np.array(feet), states)


def derived() -> psdmc.DynamicsModel:
    return psdmc.derive(hyq(), floating=True, contacts=FEET, expand=False)


def module(
    model: psdmc.DynamicsModel,
    folder: Path,
    name: str = "contact_dynamics",
    functions: tuple[str, ...] = FUNCTIONS,
) -> ModuleType:
    """The C++ file of this name, compiled with the C package of the model, which is written into this folder."""
    package = folder / "hyq"
    psdmc.emit_c(model, package, functions=functions, name="robot")
    make = [
        "make",
        "--silent",
        "-f",
        str(HERE / "Makefile"),
        f"PACKAGE={package}",
        f"PYTHON={sys.executable}",
        f"NAME={name}",
    ]
    subprocess.run(make, check=True)
    spec = importlib.util.spec_from_file_location(name, package / "python" / f"{name}.so")
    assert spec is not None
    assert spec.loader is not None
    made = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(made)
    return made


def crocoddyls(state, actuation, contacts, costs) -> crocoddyl.DifferentialActionModelContactFwdDynamics:
    """Crocoddyl's own contact dynamics, with derivatives of the forces."""
    return crocoddyl.DifferentialActionModelContactFwdDynamics(state, actuation, contacts, costs, 0.0, True)


def shooting(
    robot: pinocchio.Model, wanted: Plan, dynamics, by_forces: bool = False
) -> crocoddyl.ShootingProblem:
    """The problem, where `dynamics` makes the model of a node from state, actuation, contacts and costs. Controls are
    torques, or, with `by_forces`, accelerations and forces at the feet."""
    state = crocoddyl.StateMultibody(robot)
    actuation = crocoddyl.ActuationModelFloatingBase(state)
    nu = state.nv + 3 * len(FEET) if by_forces else actuation.nu
    ids = [robot.getFrameId(foot) for foot in FEET]
    effort = crocoddyl.ResidualModelControl(state, nu)
    if by_forces:
        effort = crocoddyl.ResidualModelJointEffort(state, actuation, np.zeros(actuation.nu), nu, False)
    cone = crocoddyl.FrictionCone(np.eye(3), FRICTION, 4, False)
    pyramid = crocoddyl.ActivationModelQuadraticBarrier(crocoddyl.ActivationBounds(cone.lb, cone.ub))

    def node(k: int) -> crocoddyl.DifferentialActionModelAbstract:
        contacts, costs = crocoddyl.ContactModelMultiple(state, nu), crocoddyl.CostModelSum(state, nu)
        last = k == len(wanted.states) - 1
        posture = crocoddyl.ResidualModelState(state, wanted.states[k], nu)
        weights = crocoddyl.ActivationModelWeightedQuad(POSTURE)
        costs.addCost("posture", crocoddyl.CostModelResidual(state, weights, posture), LAST if last else 1.0)
        for foot, index, off, place in zip(FEET, ids, wanted.air[k], wanted.feet[k], strict=True):
            point = crocoddyl.ContactModel3D(state, index, place, pinocchio.LOCAL_WORLD_ALIGNED, nu, GAINS)
            contacts.addContact(foot, point, not off)
            if off or (k > 0 and wanted.air[k - 1, FEET.index(foot)]):
                away = crocoddyl.ResidualModelFrameTranslation(state, index, place, nu)
                costs.addCost(foot, crocoddyl.CostModelResidual(state, away), SWING)
            if not (off or last):
                force = crocoddyl.ResidualModelContactFrictionCone(state, index, cone, nu, not by_forces)
                costs.addCost(f"{foot} in pyramid", crocoddyl.CostModelResidual(state, pyramid, force), CONE)
        if not last:
            costs.addCost("effort", crocoddyl.CostModelResidual(state, effort), EFFORT)
        return dynamics(state, actuation, contacts, costs)

    models = [crocoddyl.IntegratedActionModelEuler(node(k), STEP) for k in range(len(wanted.states) - 1)]
    end = crocoddyl.IntegratedActionModelEuler(node(len(wanted.states) - 1), 0.0)
    return crocoddyl.ShootingProblem(wanted.states[0], models, end)


def solved(problem: crocoddyl.ShootingProblem, solver_of=crocoddyl.SolverFDDP) -> Gait:
    """What the solver finds from the standing robot, on one thread."""
    problem.nthreads = 1
    solver = solver_of(problem)
    solver.th_stop = 1e-12
    log = crocoddyl.CallbackLogger()
    solver.setCallbacks([log])
    xs = [problem.x0] * (problem.T + 1)
    us = problem.quasiStatic(xs[:-1])
    begin = time.process_time()
    solver.solve(xs, us, 200, False)
    seconds = time.process_time() - begin
    found = [data.differential.multibody.contacts.contacts for data in problem.runningDatas]
    forces = np.array([[contacts[foot].f.linear for foot in FEET] for contacts in found])
    return Gait(np.array(solver.xs), np.array(solver.us), forces, list(log.costs), solver.iter, seconds)


def derivative_seconds(problem: crocoddyl.ShootingProblem, gait: Gait) -> float:
    """CPU time of calc and calcDiff for all nodes."""
    xs, us = list(gait.xs), list(gait.us)
    begin = time.process_time()
    problem.calc(xs, us)
    problem.calcDiff(xs, us)
    return time.process_time() - begin


def heading(column: str) -> None:
    print(f"{column:22}{'cost':>16}{'iterations':>12}{'per second':>12}{'calc and calcDiff':>20}")


def row(name: str, problem: crocoddyl.ShootingProblem, repeats: int, solver_of=crocoddyl.SolverFDDP) -> Gait:
    """Solve the problem, and print a row of the table; the shortest times of the repetitions count."""
    gait = solved(problem, solver_of)
    seconds = min(solved(problem, solver_of).seconds for _ in range(repeats))
    node = min(derivative_seconds(problem, gait) for _ in range(repeats)) / problem.T
    rate = f"{gait.iterations / seconds:.0f}"
    print(
        f"{name:22}{gait.costs[-1]:16.12f}{gait.iterations:12}{rate:>12}{1e6 * node:>11.0f} us a node",
        flush=True,
    )
    return gait


def fitting() -> None:
    """End the program if the wheels do not fit each other: Crocoddyl would compute wrong numbers, or crash."""
    needed = COMPILED_WITH.get(importlib.metadata.version("crocoddyl"))
    if needed and not pinocchio.__version__.startswith(needed):
        raise SystemExit(
            f"gait.py: the wheel crocoddyl was compiled with Pinocchio {needed}, found {pinocchio.__version__}\n"
            f"hint: pip install 'pin=={needed}.*', in a separate environment"
        )


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument(
        "--folder", type=Path, default=Path("generated/gait"), help="of the C package and the module"
    )
    parser.add_argument(
        "--repeats", type=int, default=20, help="how often each time is measured; the shortest counts"
    )
    parser.add_argument("--plot", type=Path, help="a picture of the gait")
    given = parser.parse_args()
    fitting()
    robot = pinocchio.buildModelFromUrdf(str(hyq()), pinocchio.JointModelFreeFlyer())
    wanted = plan(robot)
    problems = {
        "psdmc": shooting(robot, wanted, module(derived(), given.folder).ContactDynamics),
        "Crocoddyl": shooting(robot, wanted, crocoddyls),
    }
    heading("contact dynamics")
    ours, theirs = (row(name, problem, given.repeats) for name, problem in problems.items())
    print(f"difference of the costs    {abs(ours.costs[-1] / theirs.costs[-1] - 1.0):.1e} of the cost")
    for what, unit in (("xs", "rad, m, 1/s"), ("us", "N m"), ("forces", "N")):
        largest = np.abs(getattr(ours, what) - getattr(theirs, what)).max()
        print(f"largest difference of {what:6} {largest:.1e} {unit}")
    if given.plot:
        plot(robot, wanted, ours, theirs, given.plot)
        print(f"{given.plot} written")


def plot(robot: pinocchio.Model, wanted: Plan, ours: Gait, theirs: Gait, file: Path) -> None:
    """Feet from the side, vertical forces of both solutions, torques, and the costs that are left in each iteration."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    data, feet = robot.createData(), []
    for x in ours.xs:
        pinocchio.framesForwardKinematics(robot, data, x[: robot.nq])
        feet.append([data.oMf[robot.getFrameId(foot)].translation.copy() for foot in FEET])
    feet, moments = np.array(feet), STEP * np.arange(len(ours.xs))
    figure, ((side, forces), (torques, costs)) = plt.subplots(2, 2, figsize=(11, 7), layout="constrained")
    side.plot(
        100 * ours.xs[:, 0],
        100 * (ours.xs[:, 2] - ours.xs[0, 2]),
        color="black",
        label="base, from its height",
    )
    for k, foot in enumerate(FEET):
        (line,) = side.plot(100 * feet[:, k, 0], 100 * feet[:, k, 2], linewidth=0.9, label=foot)
        up = wanted.air[:, k]
        side.plot(
            100 * wanted.feet[up, k, 0],
            100 * wanted.feet[up, k, 2],
            ".",
            color=line.get_color(),
            markersize=3,
        )
        forces.step(moments[:-1], ours.forces[:, k, 2], where="post", linewidth=0.9, label=foot)
        forces.plot(moments[:-1], theirs.forces[:, k, 2], ".", color=line.get_color(), markersize=3)
    side.set(xlabel="x (cm)", ylabel="z (cm)", title="feet: path (lines), and what was wanted (dots)")
    forces.set(xlabel="time (s)", ylabel="vertical force (N)", title="psdmc (lines) and Crocoddyl (dots)")
    torques.step(moments[:-1], ours.us, where="post", linewidth=0.7)
    torques.set(xlabel="time (s)", ylabel="joint torques (N m)")
    for name, gait, style in (("psdmc", ours, "-o"), ("Crocoddyl", theirs, "x")):
        left = np.array(gait.costs) - min(gait.costs)
        costs.semilogy(left[:-1], style, label=name)
    costs.set(xlabel="iteration", ylabel="cost above the last one")
    for axis in (side, forces, costs):
        axis.legend(fontsize="small")
    for axis in (side, forces, torques, costs):
        axis.grid(alpha=0.3)
    figure.savefig(file, dpi=90)
    plt.close(figure)


if __name__ == "__main__":
    main()
