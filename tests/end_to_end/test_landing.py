"""examples/contacts/landing.py: impulses in friction cones beside another programme, on Pinocchio's matrices, whose
unknowns are joint rates; and Coulomb's law."""

from __future__ import annotations

import importlib.util
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio
import pytest
from pinocchio_robots import path_of

EXAMPLE = Path(__file__).parents[2] / "examples" / "contacts" / "landing.py"
SHAPES = np.array([[0.0, 0.0, -0.4], [0.3, -0.5, -0.2], [1.5, 0.2, -0.8]])
"""m/s, velocities of the base at which HyQ lands: it sticks, turns, slides."""


@pytest.fixture(scope="module")
def landing() -> Any:
    spec = importlib.util.spec_from_file_location("landing", EXAMPLE)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def urdf() -> Path:
    return Path(path_of("hyq"))


@pytest.fixture(scope="module")
def world(landing: Any, urdf: Path) -> Any:
    found = landing.World(str(urdf))
    found.q[2] -= found.heights(found.q).min() - 1e-4
    return found


def test_impulses_are_those_of_a_programme_in_joint_rates(landing: Any, urdf: Path, world: Any) -> None:
    """The smallest change of the rates, weighted with the mass matrix, that gives each foot a velocity in the dual cone.
    Its change of momentum must be J^T p."""
    cp = pytest.importorskip("cvxpy")
    model = pinocchio.buildModelFromUrdf(str(urdf), pinocchio.JointModelFreeFlyer())
    data, q = model.createData(), world.q
    mass = pinocchio.crba(model, data, q)
    pinocchio.computeJointJacobians(model, data, q)
    pinocchio.framesForwardKinematics(model, data, q)
    frames = [model.getFrameId(name) for name in landing.FEET]
    aligned = pinocchio.ReferenceFrame.LOCAL_WORLD_ALIGNED
    rows = np.vstack([pinocchio.getFrameJacobian(model, data, frame, aligned)[:3] for frame in frames])
    for base in SHAPES:
        world.qd[:] = [*base, 0.1, -0.2, 0.3, *np.zeros(12)]
        matrix, free, jacobian, rates = world.problem()
        found = jacobian.T @ landing.cone_programme(matrix, free, landing.FRICTION)
        v, lift = (
            cp.Variable(18),
            np.array([data.oMf[frame].translation[2] for frame in frames]) / landing.STEP,
        )
        own, offsets = rows @ v, np.kron(lift, [0.0, 0.0, 1.0])
        inside = [
            cp.SOC(own[3 * k + 2] + offsets[3 * k + 2], landing.FRICTION * own[3 * k : 3 * k + 2])
            for k in range(4)
        ]
        cost = cp.sum_squares(np.linalg.cholesky(mass).T @ (v - rates)) / 2
        cp.Problem(cp.Minimize(cost), inside).solve(
            solver="CLARABEL", tol_gap_abs=1e-10, tol_gap_rel=1e-10, tol_feas=1e-10
        )
        assert np.abs(found).max() > 1.0
        np.testing.assert_allclose(found, mass @ (v.value - rates), atol=1e-5 * np.abs(found).max())


def test_feet_stick_or_slide_as_coulomb_says(landing: Any, world: Any) -> None:
    for base, slides in zip(SHAPES, (False, None, True), strict=True):
        world.qd[:] = [*base, *np.zeros(15)]
        matrix, free, _, _ = world.problem()
        impulses = landing.coulomb_impulses(matrix, free, landing.FRICTION).reshape(-1, 3)
        after = (matrix @ impulses.reshape(-1) + free).reshape(-1, 3)
        size = np.linalg.norm(impulses[:, :2], axis=1)
        assert (size <= landing.FRICTION * impulses[:, 2] + 1e-8).all()
        assert after[:, 2].min() > -1e-8  # no foot moves into the ground
        assert np.abs(after[:, 2] * impulses[:, 2]).max() < 1e-7  # nor is one pushed that rises
        speed = np.linalg.norm(after[:, :2], axis=1)
        for p, v, fast in zip(impulses, after, speed, strict=True):
            if fast > 1e-6 and p[2] > 1e-6:  # against the motion, and as large as friction allows
                np.testing.assert_allclose(p[:2], -landing.FRICTION * p[2] * v[:2] / fast, atol=1e-6)
        if slides is not None:
            assert bool(speed.max() > 1e-3) is slides


def test_the_program_prints_forces_within_friction(urdf: Path, tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    words = [
        sys.executable,
        str(EXAMPLE),
        str(urdf),
        "--seconds",
        "0.09",
        "--plot",
        str(tmp_path / "landing.png"),
    ]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    rows = [line.replace("in the air", "0.0").split() for line in done.stdout.splitlines()[2:-1]]
    normal, ratio, _, lowest, foot = np.array(rows, float).T[1:]
    assert normal[0] == pytest.approx(0.0, abs=1e-3)
    assert normal[-1] > 1000.0
    assert ratio.max() < 0.5 + 1e-6
    assert lowest.min() > -1e-6
    assert foot.min() > -1e-5
    assert (tmp_path / "landing.png").stat().st_size > 20_000
