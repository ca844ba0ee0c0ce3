"""Random chains with generic physical bodies, and Pinocchio's own model of each: an oracle that shares no code."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from psdmc.robot.joints import PRISMATIC, REVOLUTE
from psdmc.robot.mechanism import PARAMETERS_PER_LINK, Joint, Mechanism, Placement

RIGHT_ANGLES = (0.0, np.pi / 2, -np.pi / 2, np.pi)


def random_chain(
    seed: int, kinds: str, *, tidy: bool = False, gravity: tuple[float, float, float] = (0.0, 0.0, -9.81)
) -> Mechanism:
    """A chain with one joint per letter of `kinds` (R or P); `tidy` takes DH-like placements with right angles,
    parallel axes and zero lengths, else axes are oblique."""
    rng = np.random.default_rng(seed)
    joints = []
    for i, kind in enumerate(kinds):
        placement = _tidy(rng) if tidy else Placement(_rotation(rng), rng.uniform(-0.5, 0.5, 3))
        joints.append(
            Joint(
                f"joint{i + 1}",
                f"link{i + 1}",
                REVOLUTE if kind == "R" else PRISMATIC,
                placement,
                Placement(_rotation(rng), rng.uniform(-0.2, 0.2, 3)),
            )
        )
    n = len(joints)
    bodies = np.array([[*_body(rng), 0.0] for _ in range(n)])
    span = np.delete(np.eye(PARAMETERS_PER_LINK * n), np.s_[10::11], axis=1)
    tip = Placement(_rotation(rng), rng.uniform(-0.2, 0.2, 3))
    return Mechanism(
        f"random{seed}", "urdf", "base", "tip", tuple(joints), bodies, span, np.array(gravity), tip
    )


def _rotation(rng: np.random.Generator) -> np.ndarray:
    q, r = np.linalg.qr(rng.normal(size=(3, 3)))
    q = q * np.sign(np.diag(r))
    return q * np.sign(np.linalg.det(q))


def _tidy(rng: np.random.Generator) -> Placement:
    alpha, theta = rng.choice(RIGHT_ANGLES, 2)
    ca, sa = np.round([np.cos(alpha), np.sin(alpha)])
    ct, st = np.round([np.cos(theta), np.sin(theta)]) if rng.random() < 0.5 else (np.cos(0.3), np.sin(0.3))
    about_x = np.array([[1.0, 0.0, 0.0], [0.0, ca, -sa], [0.0, sa, ca]])
    about_z = np.array([[ct, -st, 0.0], [st, ct, 0.0], [0.0, 0.0, 1.0]])
    lengths = rng.uniform(0.1, 0.5, 3) * rng.integers(0, 2, 3)
    return Placement(about_x @ about_z, about_x @ lengths)


def _body(rng: np.random.Generator) -> np.ndarray:
    """A physical body: point masses all over."""
    points, masses = rng.uniform(-0.3, 0.3, (6, 3)), rng.uniform(0.2, 1.0, 6)
    inertia = sum(
        m * (np.dot(p, p) * np.eye(3) - np.outer(p, p)) for m, p in zip(masses, points, strict=True)
    )
    i = inertia
    return np.array([masses.sum(), *(masses @ points), i[0, 0], i[0, 1], i[1, 1], i[0, 2], i[1, 2], i[2, 2]])


class Oracle:
    """Pinocchio on the same chain. States are (count, n) or (n,)."""

    def __init__(self, chain: Mechanism, drive_inertia: np.ndarray | None = None) -> None:
        self.chain = chain
        model, parent = pin.Model(), 0
        for i, joint in enumerate(chain.joints):
            kind = {"revolute": pin.JointModelRZ, "prismatic": pin.JointModelPZ}[joint.kind]()
            place = pin.SE3(joint.placement.rotation.copy(), joint.placement.translation.copy())
            parent = model.addJoint(parent, kind, place, joint.name)
            link = pin.SE3(joint.link_frame.rotation.copy(), joint.link_frame.translation.copy())
            body = pin.Inertia.FromDynamicParameters(chain.parameters[i, :10].copy())
            model.appendBodyToJoint(parent, body, link)
        tip = pin.SE3(chain.tip.rotation.copy(), chain.tip.translation.copy())
        self.tip = model.addFrame(pin.Frame("tip", parent, 0, tip, pin.FrameType.OP_FRAME))
        model.gravity.linear = chain.gravity.copy()
        if drive_inertia is not None:
            model.armature = drive_inertia
        self.model, self.data = model, model.createData()

    def _each(self, function, *states):
        return np.array([function(self.model, self.data, *row) for row in zip(*states, strict=True)])

    def rnea(self, q, qd, qdd):
        return self._each(pin.rnea, q, qd, qdd)

    def aba(self, q, qd, tau):
        return self._each(pin.aba, q, qd, tau)

    def nonlinear_effects(self, q, qd):
        return self._each(pin.nonLinearEffects, q, qd)

    def gravity(self, q):
        return self._each(pin.computeGeneralizedGravity, q)

    def mass_matrix(self, q):
        upper = self._each(lambda m, d, x: np.triu(pin.crba(m, d, x)), q)
        return upper + np.triu(upper, 1).transpose(0, 2, 1)

    def coriolis_matrix(self, q, qd):
        return self._each(lambda *a: pin.computeCoriolisMatrix(*a).copy(), q, qd)

    def jacobian(self, q):
        frame = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        return self._each(lambda m, d, x: pin.computeFrameJacobian(m, d, x, self.tip, frame).copy(), q)


def states(n: int, count: int, seed: int = 0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """q, qd, qdd of `count` random states, (count, n) each."""
    rng = np.random.default_rng(seed)
    return rng.uniform(-3, 3, (count, n)), rng.uniform(-3, 3, (count, n)), rng.uniform(-5, 5, (count, n))


def relative_error(found: np.ndarray, expected: np.ndarray, torque: np.ndarray | None = None) -> float:
    """Largest error of any joint relative to that joint's largest value over the sample; (count, n) or, for matrices
    with a row per joint, (count, n, columns). `torque` (count, n) gives the scale where values may all be zero."""
    assert found.shape == expected.shape
    axes = (0, 2) if expected.ndim == 3 else (0,)
    largest = np.max(np.abs(expected), axis=axes) if torque is None else np.max(np.abs(torque), axis=0)
    return float(np.max(np.max(np.abs(found - expected), axis=axes) / np.where(largest > 0, largest, 1.0)))
