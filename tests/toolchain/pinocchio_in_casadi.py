"""Newton-Euler on CasADi's symbols with the numbers of a Pinocchio model: the textbook's recursion, no psdmc in it."""

from __future__ import annotations

import casadi
import numpy as np
import pinocchio


def acceleration(model: pinocchio.Model) -> casadi.Function:
    """(q, qd, tau) -> qdd of a serial chain of joints about or along z."""
    n = model.nv
    q, qd, tau = (casadi.SX.sym(name, n) for name in ("q", "qd", "tau"))
    bias = torques(model, q, qd, casadi.SX.zeros(n), model.gravity.linear)
    columns = [torques(model, q, casadi.SX.zeros(n), casadi.SX(e), np.zeros(3)) for e in np.eye(n)]
    qdd = casadi.solve(casadi.horzcat(*columns), tau - bias)
    return casadi.Function("acceleration", [q, qd, tau], [qdd])


def torques(model, q, qd, qdd, gravity):
    axis = casadi.SX([0.0, 0.0, 1.0])
    turn, omega, alpha, linear = [], casadi.SX.zeros(3), casadi.SX.zeros(3), casadi.SX(-gravity)
    wrenches, places = [], []
    for i in range(model.nv):
        joint, placement = model.joints[i + 1], model.jointPlacements[i + 1]
        slides = "P" in joint.shortname()
        c, s = (casadi.SX(1), casadi.SX(0)) if slides else (casadi.cos(q[i]), casadi.sin(q[i]))
        R = casadi.SX(placement.rotation) @ casadi.blockcat([[c, -s, 0], [s, c, 0], [0, 0, 1]])
        p = casadi.SX(placement.translation) + (R @ axis * q[i] if slides else 0)
        linear = R.T @ (linear + casadi.cross(alpha, p) + casadi.cross(omega, casadi.cross(omega, p)))
        omega, alpha = R.T @ omega, R.T @ alpha
        if slides:
            linear = linear + axis * qdd[i] + 2 * casadi.cross(omega, axis * qd[i])
        else:
            alpha = alpha + axis * qdd[i] + casadi.cross(omega, axis * qd[i])
            omega = omega + axis * qd[i]
        body = model.inertias[i + 1]
        com, about_com = casadi.SX(body.lever), casadi.SX(body.inertia)
        force = body.mass * (
            linear + casadi.cross(alpha, com) + casadi.cross(omega, casadi.cross(omega, com))
        )
        moment = about_com @ alpha + casadi.cross(omega, about_com @ omega) + casadi.cross(com, force)
        wrenches.append((force, moment))
        places.append((R, p))
        turn.append(slides)
    found = []
    force = moment = casadi.SX.zeros(3)
    for i in reversed(range(model.nv)):
        force, moment = force + wrenches[i][0], moment + wrenches[i][1]
        found.append((force if turn[i] else moment)[2])
        R, p = places[i]
        force = R @ force
        moment = R @ moment + casadi.cross(p, force)
    return casadi.vertcat(*reversed(found))
