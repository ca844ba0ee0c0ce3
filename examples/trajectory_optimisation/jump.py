"""A jump of the quadruped Solo12 by direct transcription in IPOPT, whose controls are accelerations and contact forces.

    python examples/trajectory_optimisation/jump.py [--plot jump.png] [--animation jump.gif]

Derives the robot, writes and builds its C package with exact Hessians for CasADi (`emit-c --with casadi_hessian`), and
solves the problem. Then it is solved with limited-memory Hessians, and with Pinocchio on CasADi's symbols. Prints optima,
iterations and CPU time per iteration.
"""

from __future__ import annotations

import argparse
import importlib.metadata
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import casadi
import numpy as np

import psdmc

FEET = ("FL_FOOT", "FR_FOOT", "HL_FOOT", "HR_FOOT")
STANDING = np.array([0.0, 0.8, -1.6] * 2 + [0.0, -0.8, 1.6] * 2)
"""rad, of the joints at the start and at the end."""
TORQUE, FRICTION, LOAD = 2.5, 0.6, 20.0
"""N m of a motor; of a foot on the floor; N, the largest vertical force on a foot, three times its share of the weight."""
PHASES = (24, 18, 18)
"""Nodes on the floor, in the air, and on the floor again."""
DURATION, DISTANCE = 0.75, 0.2
"""s; m."""

Array = np.ndarray


@dataclass(frozen=True)
class Dynamics:
    """CasADi functions of one robot with nf feet.

    torques  (q, qd, qdd, wrenches (6, nf)) -> tau; a wrench is a force, then a moment, along the axes of its foot
    feet     q -> positions (nf, 3), rotations (3 nf, 3)
    """

    torques: casadi.Function
    feet: casadi.Function


@dataclass(frozen=True)
class Jump:
    """cost; q (19, nodes + 1), qd (18, nodes + 1), tau (12, nodes), force (12, nodes) N along the base's axes; IPOPT's
    iterations, and CPU seconds of the problem's functions and of all; duration of the motion in s."""

    cost: float
    q: Array
    qd: Array
    tau: Array
    force: Array
    iterations: int
    functions: float
    total: float
    duration: float


def jump(
    dynamics: Dynamics,
    weight: float,
    phases: tuple[int, int, int] = PHASES,
    duration: float = DURATION,
    distance: float = DISTANCE,
    hessian: str = "exact",
) -> Jump:
    """From rest on four feet to rest on four feet `distance` (m) ahead with the least squares of torques; steps of
    semi-implicit Euler.

    weight   N, of the robot, for the first guess
    phases   nodes on the floor, in the air, on the floor
    hessian  'exact', or 'limited-memory', which needs first derivatives alone
    """
    nodes, dt = sum(phases), duration / sum(phases)
    off, on = phases[0], phases[0] + phases[1]
    start = np.r_[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, STANDING]
    ground = np.array(dynamics.feet(start)[0])
    start[2] = -ground[0, 2]
    ground[:, 2] = 0.0
    goal, landed = start + distance * np.eye(19)[0], ground + distance * np.eye(3)[0]

    opti = casadi.Opti()
    q, qd = opti.variable(19, nodes + 1), opti.variable(18, nodes + 1)
    qdd, force = opti.variable(18, nodes), opti.variable(12, nodes)
    torques, cost = [], 0.0
    for k in range(nodes):
        positions, rotations = dynamics.feet(q[:, k])
        rows = [slice(3 * foot, 3 * foot + 3) for foot in range(4)]
        own = casadi.horzcat(*(rotations[own, :].T @ force[own, k] for own in rows))
        wrenches = casadi.vertcat(own, casadi.MX.zeros(3, 4))
        tau = dynamics.torques(q[:, k], qd[:, k], qdd[:, k], wrenches)
        opti.subject_to(tau[:6] == 0)
        opti.subject_to(opti.bounded(-TORQUE, tau[6:], TORQUE))
        opti.subject_to(qd[:, k + 1] == qd[:, k] + dt * qdd[:, k])
        opti.subject_to(q[:, k + 1] == q[:, k] + dt * rates(q[:, k], qd[:, k + 1]))
        if off <= k < on:
            opti.subject_to(force[:, k] == 0)
            opti.subject_to(positions[:, 2] >= 0)
        else:
            opti.subject_to(list(in_friction_pyramids(force[:, k])))
            if 0 < k < nodes - 1:  # elsewhere they follow from start and goal
                opti.subject_to(positions == (ground if k < off else landed))
        torques.append(tau[6:])
        cost += casadi.sumsqr(tau[6:]) + 1e-2 * casadi.sumsqr(qd[:, k]) + 1e-4 * casadi.sumsqr(qdd[:, k])
        cost += 1e-3 * casadi.sumsqr(force[:, k])
    opti.subject_to(q[:, 0] == start)
    opti.subject_to(qd[:, 0] == 0)
    whole = [0, 1, 2, 3, 4, 5, *range(7, 19)]  # the length of the quaternion is free
    opti.subject_to(q[whole, -1] == goal[whole])
    opti.subject_to(qd[:, -1] == 0)
    opti.minimize(dt * cost)
    opti.set_initial(q, start[:, None] + np.linspace(0.0, 1.0, nodes + 1) * (goal - start)[:, None])
    opti.set_initial(force, np.tile([[0.0], [0.0], [weight / 4]], (4, nodes)))
    ipopt = {"hessian_approximation": hessian, "tol": 1e-8, "max_iter": 3000, "print_level": 0, "sb": "yes"}
    opti.solver("ipopt", {"print_time": False, "record_time": True}, ipopt)
    found = opti.solve()
    spent = {name: seconds for name, seconds in found.stats().items() if name.startswith("t_proc_")}
    return Jump(
        float(found.value(opti.f)),
        found.value(q),
        found.value(qd),
        found.value(casadi.horzcat(*torques)),
        found.value(force),
        found.stats()["iter_count"],
        sum(seconds for name, seconds in spent.items() if name.startswith("t_proc_nlp")),
        spent["t_proc_total"],
        duration,
    )


def rates(q: casadi.MX, qd: casadi.MX) -> casadi.MX:
    """How the entries of q change per second; the first six of qd are along the axes of the base."""
    x, y, z, w = casadi.vertsplit(q[3:7])
    spin = casadi.blockcat([[w, -z, y], [z, w, -x], [-y, x, w], [-x, -y, -z]])
    axis, along = q[3:6], qd[:3]
    moved = (w * w - casadi.sumsqr(axis)) * along + 2 * casadi.dot(axis, along) * axis
    moved += 2 * w * casadi.cross(axis, along)
    return casadi.vertcat(moved / casadi.sumsqr(q[3:7]), 0.5 * spin @ qd[3:6], qd[6:])


def in_friction_pyramids(force: casadi.MX) -> Iterator[casadi.MX]:
    """Inside the cones of friction, one for each foot."""
    share = FRICTION / np.sqrt(2.0)
    for x, y, z in zip(*(casadi.vertsplit(force[k::3]) for k in range(3)), strict=True):
        yield z >= 0
        yield z <= LOAD
        yield from (share * z >= part for part in (x, -x, y, -y))


def solo12(frames: Sequence[str] = FEET) -> psdmc.DynamicsModel:
    """On a floating base, with these links as named frames."""
    wheel = importlib.metadata.distribution("example-robot-data")
    file = next(file for file in wheel.files or () if file.name == "solo12.urdf")
    return psdmc.derive(Path(str(wheel.locate_file(file))), floating=True, frames=frames)


def with_psdmc(model: psdmc.DynamicsModel, folder: Path) -> Dynamics:
    """What `psdmc emit-c --with casadi_hessian` and `psdmc build` make in this folder; emitted and built once."""
    from psdmc.toolchain.build_package import build_package

    library = folder / "build" / "libsolo_casadi_hessian.so"
    names = ["inverse_dynamics_with_wrenches", "forward_kinematics"]
    changed = psdmc.emit_c(model, folder, functions=names, name="solo", adapters=["casadi_hessian"])
    if changed or not library.exists():
        build_package(folder)
    return Dynamics(*(casadi.external(f"solo_{name}", str(library)) for name in names))


def with_pinocchio(model: psdmc.DynamicsModel) -> Dynamics:
    """Pinocchio's rnea and forwardKinematics on CasADi's symbols, at q with its quaternion divided by its length."""
    from psdmc.bench.case import robot_as_numbers
    from psdmc.bench.machine import built
    from psdmc.bench.rivals.casadi_c import program_on_symbols

    file = Path(__file__).with_name("pinocchio_symbols.cpp")
    program = program_on_symbols(file.name, file.read_text())
    lines = [robot_as_numbers(model.mechanism), str(len(FEET))]
    for foot in model.mechanism.frames:
        numbers = [*foot.placement.rotation.ravel(), *foot.placement.translation]
        lines.append(" ".join([str(foot.joint + 1), *(repr(float(number)) for number in numbers)]))
    made = built("feet.casadi", [str(program), "robot.txt"], {"robot.txt": "\n".join(lines)}).parent
    torques, feet = (casadi.Function.load(str(made / f"{name}.casadi")) for name in ("torques", "feet"))
    q, *others = (casadi.SX.sym(torques.name_in(k), *torques.size_in(k)) for k in range(4))
    at = casadi.vertcat(q[:3], q[3:7] / casadi.norm_2(q[3:7]), q[7:])
    return Dynamics(
        casadi.Function("torques", [q, *others], [torques(at, *others)]),
        casadi.Function("feet", [q], feet(at)),
    )


def compiled(dynamics: Dynamics) -> Dynamics:
    """The same functions and their derivatives as C that CasADi generates: one function each, compiled at -O1, as compilers
    take too long for such long functions at -O3."""
    from psdmc.bench.machine import built
    from psdmc.toolchain.compiler_command import find_compiler

    code = casadi.CodeGenerator("generated", {"casadi_int": "long long int"})
    for function in (dynamics.torques, dynamics.feet):
        gradient = function.reverse(1)
        for each in (function, function.jacobian(), gradient, gradient.jacobian()):
            code.add(each)
    words = [*find_compiler().command, "-O1", "-march=native", "-shared", "-fPIC", "generated.c"]
    library = built("generated.so", [*words, "-lm", "-o", "generated.so"], {"generated.c": code.dump()})
    return Dynamics(*(casadi.external(name, str(library)) for name in ("torques", "feet")))


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--folder", type=Path, default=Path("generated/jump"), help="of the C package")
    parser.add_argument("--plot", type=Path, help="a picture of the motion")
    parser.add_argument("--animation", type=Path, help="a GIF")
    parser.add_argument("--quick", action="store_true", help="psdmc with exact Hessians alone")
    given = parser.parse_args()
    model = solo12()
    weight = float(model.gravity(model.neutral())[2])
    ours = with_psdmc(model, given.folder)
    ways = {"psdmc, exact Hessian": (ours, "exact")}
    if not given.quick:
        ways["psdmc, limited-memory"] = (ours, "limited-memory")
        theirs = with_pinocchio(model)
        ways["Pinocchio on CasADi's symbols, exact Hessian"] = (theirs, "exact")
        ways["the same as C of CasADi, exact Hessian"] = (compiled(theirs), "exact")
    print(f"{'CPU time per iteration':46}{'optimum':>14}{'iterations':>12}{'functions':>11}{'all':>9}")
    found = {}
    for name, (dynamics, hessian) in ways.items():
        one = found[name] = jump(dynamics, weight, hessian=hessian)
        each = [f"{1e3 * seconds / one.iterations:.1f} ms" for seconds in (one.functions, one.total)]
        print(f"{name:46}{one.cost:14.9f}{one.iterations:12}{each[0]:>11}{each[1]:>9}", flush=True)
    if given.plot or given.animation:
        from jump_plots import animate, plot

        best = next(iter(found.values()))
        for file, draw in ((given.plot, plot), (given.animation, animate)):
            if file:
                draw(best, file)
                print(f"{file} written")


if __name__ == "__main__":
    main()
