"""A jump of the quadruped Solo12 by direct transcription in IPOPT, whose controls are accelerations and contact forces.

    python examples/trajectory_optimisation/jump.py [--plot jump.png] [--animation jump.gif]

Derives the robot, writes and builds its C package with exact Hessians for CasADi (`emit-c --with casadi_hessian`), solves
the same problem with Pinocchio on CasADi's symbols, and prints optima, iterations and CPU time per iteration.
"""

from __future__ import annotations

import argparse
import importlib.metadata
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import casadi
import numpy as np

import psdmc

FEET = ("FL_FOOT", "FR_FOOT", "HL_FOOT", "HR_FOOT")
STANDING = np.array([0.0, 0.8, -1.6] * 2 + [0.0, -0.8, 1.6] * 2)
"""rad, of the joints at the start and at the end."""
TORQUE, FRICTION = 2.5, 0.6
"""N m of a motor; of a foot on the floor."""
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
    iterations, and CPU seconds of the problem's functions and of all."""

    cost: float
    q: Array
    qd: Array
    tau: Array
    force: Array
    iterations: int
    functions: float
    total: float


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
        cost += casadi.sumsqr(tau[6:]) + 1e-2 * casadi.sumsqr(qd[6:, k]) + 1e-5 * casadi.sumsqr(qdd[:, k])
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
        yield from (share * z >= part for part in (x, -x, y, -y))
