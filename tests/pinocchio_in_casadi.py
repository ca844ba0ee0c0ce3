"""Newton-Euler on CasADi's symbols with the numbers of a Pinocchio model: the textbook's recursion, no psdmc in it."""

from __future__ import annotations

from collections.abc import Callable

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
    return solved(inverse_dynamics(model))


def solved(inverse: casadi.Function) -> casadi.Function:
    """(q, qd, tau) -> qdd, from a function (q, qd, qdd) -> tau."""
    q, qd, tau = (casadi.SX.sym(name, inverse.size1_in(k)) for k, name in enumerate(("q", "qd", "tau")))
    still = casadi.SX.zeros(qd.numel())
    at_rest = inverse(q, qd, still)
    columns = [inverse(q, qd, casadi.SX(e)) - at_rest for e in np.eye(qd.numel())]
    return casadi.Function(
        "acceleration", [q, qd, tau], [casadi.solve(casadi.horzcat(*columns), tau - at_rest)]
    )


def following(inverse: casadi.Function, spread: np.ndarray, offset: np.ndarray) -> casadi.Function:
    """The same of a robot whose joints' positions are spread @ q + offset."""
    q, qd, qdd = (casadi.SX.sym(name, spread.shape[1]) for name in ("q", "qd", "qdd"))
    tau = inverse(spread @ q + offset, spread @ qd, spread @ qdd)
    return casadi.Function("torques", [q, qd, qdd], [spread.T @ tau])


def hessian(found: casadi.Function, move: Callable[[casadi.SX, casadi.SX], casadi.SX]) -> casadi.Function:
    """(q, qd, third, cotangent) -> second derivatives of cotangent . found(move(q, x), qd + y, third + z) by (x, y, z) at
    zero, of a function of q, qd and a third vector."""
    q, qd, third = (casadi.SX.sym(name, found.size1_in(k)) for k, name in enumerate(("q", "qd", "third")))
    nv = qd.numel()
    x, cotangent = casadi.SX.sym("x", 3 * nv), casadi.SX.sym("cotangent", nv)
    value = casadi.dot(cotangent, found(move(q, x[:nv]), qd + x[nv : 2 * nv], third + x[2 * nv :]))
    second = casadi.substitute(casadi.hessian(value, x)[0], x, casadi.SX.zeros(3 * nv))
    return casadi.Function("hessian", [q, qd, third, cotangent], [second])


def stepped(model, q, x):
    """q (+) x, as Pinocchio's `integrate`, up to terms of second order in x: a screw of each free joint, and a turn of each
    ball joint."""
    parts = []
    for joint in list(model.joints)[1:]:
        own, way = q[joint.idx_q : joint.idx_q + joint.nq], x[joint.idx_v : joint.idx_v + joint.nv]
        if joint.nq == 1:
            parts.append(own + way)
            continue
        slip, spin = along_axes(joint, way)
        turn, place = moved(joint, own)
        if joint.nq == 7:
            parts.append(place + turn @ (slip + casadi.cross(spin, slip) / 2))
        v, w, half = own[-4:-1], own[-1], spin / 2
        cosine = 1 - casadi.dot(half, half) / 2
        parts.append(cosine * v + w * half + casadi.cross(v, half))
        parts.append(cosine * w - casadi.dot(v, half))
    return casadi.vertcat(*parts)


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
