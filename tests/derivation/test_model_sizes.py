"""Model sizes against the published ones, and the published base parameters in the derived row space."""

from __future__ import annotations

import numpy as np
import pytest
from bundled import bundled_model, bundled_robot

from psdmc.derivation.derive import derive_model
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.model.summary import sizes_of
from psdmc.robot.joints import REVOLUTE
from psdmc.robot.mechanism import PARAMETER_NAMES, Joint, Mechanism, Placement

PUBLISHED = {
    "two_link": (10, 4, (3, 4, 2, 1)),
    "two_link_full": (18, 6, (6, 6, 4, 2)),
    "scara": (69, 8, (1, 26, 22, 20)),
    "scara_zeros": (64, 7, None),
    "kr6": (6086, 36, (74, 1189, 1507, 3316)),
    "lbr7": (21295, 43, (152, 3461, 4766, 12916)),
    "denso_wall": (1318, 32, (47, 313, 348, 610)),
    "denso_floor": (1295, 30, (24, 313, 348, 610)),
}
"""p, l, and p by gravity, acceleration, centrifugal, Coriolis: PSDM-2021 and Denso-2022."""


@pytest.mark.parametrize("name", PUBLISHED)
def test_sizes_are_the_published_ones(name: str) -> None:
    model = bundled_model(name)
    p, l, split = PUBLISHED[name]
    assert (model.p, model.l) == (p, l)
    assert split is None or tuple(sizes_of(model.E)) == split


def test_denso_without_its_joint_offsets_has_another_p() -> None:
    """p depends on where q is zero: 1296 without the two quarter turns, 1318 with them."""
    chain = bundled_robot("denso_wall").chain
    model = derive_model(_without_offsets(chain))
    assert (model.p, model.l) == (1296, 32)


def _without_offsets(chain: Mechanism) -> Mechanism:
    before, joints = Placement.identity(), []
    for joint in chain.joints:
        joints.append(Joint(joint.name, joint.link_name, joint.type, before, joint.link_frame, joint.limits))
        before = joint.link_frame
    return Mechanism(
        chain.name,
        chain.convention,
        chain.base_name,
        chain.tip_name,
        tuple(joints),
        chain.parameters,
        chain.parameter_span,
        chain.gravity,
        chain.tip,
    )


def test_eight_joints() -> None:
    """LBR7 with a joint (a 0, alpha -pi/2, d 0.2) before its last: p = 72,039, l = 50."""
    model = derive_model(eight_joints())
    assert (model.p, model.l) == (72039, 50)
    assert model.theta_b is None
    assert model.certificate.max() < 1e-12


def eight_joints() -> Mechanism:
    """Inertias unknown, no drive inertia."""
    chain = bundled_robot("lbr7").chain
    turn = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
    extra = Placement(turn, np.array([0.0, 0.0, 0.2]))
    *before, last = chain.joints
    joints = (
        *before,
        Joint("extra", "extra", REVOLUTE, before[-1].link_frame, extra),
        Joint(last.name, last.link_name, last.type, extra, last.link_frame),
    )
    span = np.delete(np.eye(88), np.s_[10::11], axis=1)
    unknown = np.full((8, 11), np.nan)
    unknown[:, 10] = 0.0
    return Mechanism(
        "eight", "standard", "base", "tip", joints, unknown, span, chain.gravity, last.link_frame
    )


A1, A2, A3, D4 = 0.075, -0.27, -0.09, 0.295
GRAVITY_EQUATIONS = (
    {"m1": 1.0, "mx1": 1 / A1, "mx2": -1 / A2},
    {"mz1": 1.0, "mz2": 1.0, "my3": 1.0},
    {"m2": 1.0, "mx2": 1 / A2, "mx3": -1 / A3},
    {"my2": 1.0},
    {"m3": 1.0, "mz3": -1 / D4, "my4": 1 / D4, "mx3": 1 / A3},
    {"mz3": 1 / D4, "my4": -1 / D4, "m4": 1.0, "m5": 1.0},
    {"mz4": 1.0, "my5": 1.0},
    {"mz5": 1.0},
    {"mx4": 1.0},
)
OTHER_EQUATIONS = (
    {"Im3": 1.0},
    {"Im4": 1.0},
    {"Im5": 1.0},
    {"Im6": 1.0},
    {"Ixx5": 1.0, "Iyy5": -1.0, "Izz5": -1.0},
    {"Iyy5": 1.0},
)
"""Table 4 of Denso-2022 as far as it is legible."""


def test_published_base_parameters_lie_in_the_row_space() -> None:
    model = bundled_model("denso_wall")
    rows = _regressor_rows(model, moving=True)
    for equation in (*GRAVITY_EQUATIONS, *OTHER_EQUATIONS):
        assert _distance(equation, rows, model) < 1e-10


def test_gravity_part_has_rank_nine_and_holds_its_nine_equations() -> None:
    model = bundled_model("denso_wall")
    rows = _regressor_rows(model, moving=False)
    values = np.linalg.svd(rows, compute_uv=False)
    assert values[8] > 1e-3 * values[0]
    assert values[9] < 1e-12 * values[0]
    for equation in GRAVITY_EQUATIONS:
        assert _distance(equation, rows, model) < 1e-10
    assert min(_distance(equation, rows, model) for equation in OTHER_EQUATIONS) > 0.1


def _regressor_rows(model: DynamicsModel, moving: bool) -> np.ndarray:
    """Rows of the regressor in the span's coordinates, at random states."""
    q, qd, qdd = np.random.default_rng(4).uniform(-3, 3, (3, 60, model.n))
    rows = model.regressor(q, qd * moving, qdd * moving).reshape(-1, model.l)
    return rows @ model.B @ model.chain.parameter_span


def _distance(equation: dict[str, float], rows: np.ndarray, model: DynamicsModel) -> float:
    """How far an equation is from the rows' span, relative to its own length."""
    x = np.zeros(11 * model.n)
    for name, value in equation.items():
        x[11 * (int(name[-1]) - 1) + PARAMETER_NAMES.index(name[:-1])] = value
    wanted = x @ model.chain.parameter_span
    _, s, vt = np.linalg.svd(rows, full_matrices=False)
    basis = vt[s > 1e-10 * s[0]]
    return float(np.linalg.norm(wanted - basis.T @ (basis @ wanted)) / np.linalg.norm(wanted))
