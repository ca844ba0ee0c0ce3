"""examples/trajectory_optimisation/gait.py and foot_forces.py: a gait with psdmc's contact dynamics, and with forces at the
feet as controls, held against Crocoddyl's own."""

from __future__ import annotations

import sys
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from installed import need
from unoptimised import without_optimisation

import psdmc

crocoddyl = pytest.importorskip("crocoddyl")
pytestmark = pytest.mark.slow

EXAMPLE = Path(__file__).parents[2] / "examples" / "trajectory_optimisation"
PHASES = ((3, (), 0.0), (8, ("lf_foot", "rh_foot"), 0.05), (4, (), 0.0))


@pytest.fixture(scope="module")
def gait() -> Any:
    sys.path.insert(0, str(EXAMPLE))
    import gait

    need("make", "g++")
    try:
        gait.fitting()
    except SystemExit as reason:
        pytest.skip(str(reason))
    return gait


@pytest.fixture(scope="module")
def model(gait: Any) -> Any:
    return gait.derived()


@pytest.fixture(scope="module")
def problems(gait: Any, model: Any, tmp_path_factory: pytest.TempPathFactory) -> tuple[Any, Any, Any, Any]:
    """Pinocchio's model, the short plan, and its problem with psdmc's and with Crocoddyl's dynamics."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("CFLAGS", "-O0")
        patch.setenv("CXXFLAGS", "-O0")
        made = gait.module(model, tmp_path_factory.mktemp("gait"))
    robot = pin.buildModelFromUrdf(str(gait.hyq()), pin.JointModelFreeFlyer())
    plan = gait.plan(robot, PHASES)
    ours = gait.shooting(robot, plan, made.ContactDynamics)
    return robot, plan, ours, gait.shooting(robot, plan, gait.crocoddyls)


def test_each_node_is_crocoddyls(problems: tuple[Any, Any, Any, Any]) -> None:
    """Accelerations, cost, forces and all derivatives, at states away from the plan, on four feet and on two."""
    robot, plan, *both = problems
    state, rng = crocoddyl.StateMultibody(robot), np.random.default_rng(1)
    for k in range(len(plan.states) - 1):
        x = state.integrate(plan.states[k], 0.1 * rng.standard_normal(state.ndx))
        u, found = 30.0 * rng.standard_normal(12), []
        for problem in both:
            model = problem.runningModels[k].differential
            data = model.createData()
            model.calc(data, x, u)
            model.calcDiff(data, x, u)
            contacts = data.multibody.contacts.contacts.todict()
            forces = [np.hstack([c.f.linear[:, None], c.df_dx, c.df_du]) for c in contacts.values()]
            names = ("xout", "Fx", "Fu", "Lx", "Lu", "Lxx", "Lxu", "Luu")
            found.append([np.array(getattr(data, name)) for name in names] + [np.array(data.cost), *forces])
        for one, other in zip(*found, strict=True):
            assert np.abs(one - other).max() <= 1e-9 * (1.0 + np.abs(other).max())


def test_both_find_the_same_gait(gait: Any, problems: tuple[Any, Any, Any, Any], tmp_path: Path) -> None:
    robot, plan, *both = problems
    ours, theirs = (gait.solved(problem) for problem in both)
    assert ours.costs[-1] == pytest.approx(theirs.costs[-1], rel=1e-8)
    assert ours.costs[-1] < 0.9 * ours.costs[0]
    assert np.abs(ours.xs - theirs.xs).max() < 1e-6
    assert np.abs(ours.forces - theirs.forces).max() < 1e-3
    data = robot.createData()
    for x, place in zip(ours.xs, plan.feet, strict=True):
        pin.framesForwardKinematics(robot, data, x[: robot.nq])
        feet = [data.oMf[robot.getFrameId(foot)].translation for foot in gait.FEET]
        assert np.abs(feet - place).max() < 1e-2, "a step of 0.08 s is brisk"
    gait.plot(robot, plan, ours, theirs, tmp_path / "gait.png")
    assert (tmp_path / "gait.png").stat().st_size > 20_000


@pytest.fixture(scope="module")
def by_forces(gait: Any, model: Any, tmp_path_factory: pytest.TempPathFactory) -> tuple[Any, Any, list[Any]]:
    """Module, short plan, and its problem with forces as controls: psdmc's in C++ and in Python, and Crocoddyl's."""
    import foot_forces

    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("CFLAGS", "-O0")
        patch.setenv("CXXFLAGS", "-O0")
        folder = tmp_path_factory.mktemp("forces")
        in_cpp = gait.module(model, folder, "foot_forces", foot_forces.FUNCTIONS).FootForces
    with without_optimisation():
        compiled = psdmc.compile(model, functions=foot_forces.FUNCTIONS)
    robot = pin.buildModelFromUrdf(str(gait.hyq()), pin.JointModelFreeFlyer())
    plan = gait.plan(robot, PHASES)
    ways = (
        in_cpp,
        partial(foot_forces.InPython, compiled),
        crocoddyl.DifferentialActionModelContactInvDynamics,
    )
    return foot_forces, plan, [gait.shooting(robot, plan, dynamics, True) for dynamics in ways]


def test_nodes_with_forces_as_controls_are_crocoddyls(by_forces: tuple[Any, Any, list[Any]]) -> None:
    """Costs, constraints and all derivatives, in C++ and in Python, at states away from the plan."""
    foot_forces, plan, (*ours, theirs) = by_forces
    for problem in ours:
        found = foot_forces.differences(problem, theirs, plan)
        assert max(found.values()) < 1e-9, found


def test_forces_as_controls_have_the_optimum_of_contact_dynamics(
    gait: Any, by_forces: tuple[Any, Any, list[Any]]
) -> None:
    """Crocoddyl's contact dynamics eliminate the constraints, and the solver FDDP is another one."""
    _, plan, both = by_forces
    robot = both[-1].runningModels[0].state.pinocchio
    other = gait.solved(gait.shooting(robot, plan, gait.crocoddyls))
    found = [gait.solved(problem, crocoddyl.SolverIntro) for problem in both]
    for one in found:
        assert one.costs[-1] == pytest.approx(other.costs[-1], rel=1e-8)
        assert np.abs(one.xs - other.xs).max() < 1e-4, "the cost hardly changes near its smallest value"
        assert np.abs(one.forces - other.forces).max() < 1e-4 * np.abs(other.forces).max()
    assert other.costs[-1] < 0.9 * other.costs[0]
