"""Newton-Euler on CasADi's symbols with the numbers of a Pinocchio model: the textbook's recursion, no psdmc in it."""

from __future__ import annotations

import casadi
import numpy as np
import pinocchio

AXIS = casadi.SX([0.0, 0.0, 1.0])
NONE = casadi.SX.zeros(3)


def symbols(model: pinocchio.Model, third: str) -> tuple[casadi.SX, ...]:
    return tuple(casadi.SX.sym(name, n) for name, n in (("q", model.nq), ("qd", model.nv), (third, model.nv)))


def inverse_dynamics(model: pinocchio.Model) -> casadi.Function:
    """(q, qd, qdd) -> tau, of q whose quaternions are divided by their lengths."""
    given = symbols(model, "qdd")
    return casadi.Function("torques", given, [torques(model, *given, model.gravity.linear)])


def acceleration(model: pinocchio.Model) -> casadi.Function:
    """(q, qd, tau) -> qdd of the same robot."""
    q, qd, tau = symbols(model, "tau")
    still = casadi.SX.zeros(model.nv)
    bias = torques(model, q, qd, still, model.gravity.linear)
    columns = [torques(model, q, still, casadi.SX(e), np.zeros(3)) for e in np.eye(model.nv)]
    qdd = casadi.solve(casadi.horzcat(*columns), tau - bias)
    return casadi.Function("acceleration", [q, qd, tau], [qdd])


def torques(model, q, qd, qdd, gravity):
    """Joints about or along z, ball joints and free ones, in a tree."""
    motions, steps, wrenches = [(NONE, NONE, casadi.SX(-gravity))], [], []
    for i in range(1, model.njoints):
        joint, placement = model.joints[i], model.jointPlacements[i]
        rates = slice(joint.idx_v, joint.idx_v + joint.nv)
        turn, way = moved(joint, q[joint.idx_q : joint.idx_q + joint.nq])
        R, p = casadi.SX(placement.rotation) @ turn, casadi.SX(placement.translation)
        p = p + casadi.SX(placement.rotation) @ way
        (slip, spin), (slip_slope, spin_slope) = along_axes(joint, qd[rates]), along_axes(joint, qdd[rates])
        omega, alpha, linear = motions[model.parents[i]]
        linear = R.T @ (linear + casadi.cross(alpha, p) + casadi.cross(omega, casadi.cross(omega, p)))
        omega, alpha = R.T @ omega, R.T @ alpha
        linear = linear + slip_slope + casadi.cross(spin, slip) + 2 * casadi.cross(omega, slip)
        alpha, omega = alpha + spin_slope + casadi.cross(omega, spin), omega + spin
        motions.append((omega, alpha, linear))
        steps.append((R, p))
        wrenches.append(wrench_of(model.inertias[i], omega, alpha, linear))
    found = [casadi.SX.zeros(0)] * model.njoints
    for i in reversed(range(1, model.njoints)):
        (force, moment), (R, p), above = wrenches[i - 1], steps[i - 1], model.parents[i]
        found[i] = casadi.vertcat(*against(model.joints[i], force, moment))
        if above:
            force = R @ force
            own_force, own_moment = wrenches[above - 1]
            wrenches[above - 1] = own_force + force, own_moment + R @ moment + casadi.cross(p, force)
    return casadi.vertcat(*found) + model.armature * qdd


def moved(joint, own):
    """Rotation and way of a joint."""
    kind = joint.shortname()
    if "FreeFlyer" in kind or "Spherical" in kind:
        x, y, z, w = casadi.vertsplit(own[-4:] / casadi.norm_2(own[-4:]))
        turn = casadi.blockcat(
            [
                [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
            ]
        )
        return turn, own[:3] if "FreeFlyer" in kind else NONE
    if "P" in kind:
        return casadi.SX.eye(3), AXIS * own
    c, s = casadi.cos(own), casadi.sin(own)
    return casadi.blockcat([[c, -s, 0], [s, c, 0], [0, 0, 1]]), NONE


def along_axes(joint, rates):
    """Linear and angular rates along the axes of the moved joint."""
    kind = joint.shortname()
    if "FreeFlyer" in kind:
        return rates[:3], rates[3:]
    if "Spherical" in kind:
        return NONE, rates
    return (AXIS * rates, NONE) if "P" in kind else (NONE, AXIS * rates)


def against(joint, force, moment):
    """The joint's share of a wrench."""
    kind = joint.shortname()
    if "FreeFlyer" in kind:
        return force, moment
    return (moment,) if "Spherical" in kind else ((force if "P" in kind else moment)[2],)


def wrench_of(body, omega, alpha, linear):
    com, about_com = casadi.SX(body.lever), casadi.SX(body.inertia)
    force = body.mass * (linear + casadi.cross(alpha, com) + casadi.cross(omega, casadi.cross(omega, com)))
    return force, about_com @ alpha + casadi.cross(omega, about_com @ omega) + casadi.cross(com, force)
