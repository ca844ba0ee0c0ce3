"""The KR6's motion of ilqr.py in Crocoddyl: with psdmc's functions, and with Pinocchio's, which Crocoddyl brings.

    python examples/trajectory_optimisation/in_crocoddyl.py

Needs the wheel crocoddyl beside pin.
"""

from __future__ import annotations

import time

import crocoddyl
import ilqr
import numpy as np
import pinocchio


class PsdmcStep(crocoddyl.ActionModelAbstract):
    """One step of an ilqr.Problem, its cost, and the derivatives of both; the last node has the final cost alone."""

    def __init__(self, problem: ilqr.Problem, is_last: bool) -> None:
        size = len(problem.start)
        crocoddyl.ActionModelAbstract.__init__(
            self, crocoddyl.StateVector(size), problem.actuated.shape[1], size
        )
        self.problem, self.is_last = problem, is_last

    def calc(self, data, x, u=None) -> None:
        p, away = self.problem, x - self.problem.goal
        if self.is_last or u is None:
            data.xnext, data.cost = x, 0.5 * float(p.final @ away**2) * self.is_last
            return
        data.xnext = p.step(x, u)
        data.cost = 0.5 * p.dt * float(p.running @ away**2 + p.effort @ u**2)

    def calcDiff(self, data, x, u=None) -> None:  # Crocoddyl's name
        p, away = self.problem, x - self.problem.goal
        if self.is_last or u is None:
            data.Lx, data.Lxx = p.final * away * self.is_last, np.diag(p.final) * self.is_last
            return
        data.Fx, data.Fu = p.jacobians(x, u)
        data.Lx, data.Lxx = p.dt * p.running * away, p.dt * np.diag(p.running)
        data.Lu, data.Luu = p.dt * p.effort * u, p.dt * np.diag(p.effort)


def with_psdmc(problem: ilqr.Problem) -> crocoddyl.ShootingProblem:
    running, last = PsdmcStep(problem, False), PsdmcStep(problem, True)
    return crocoddyl.ShootingProblem(problem.start, [running] * problem.steps, last)


def with_pinocchio(problem: ilqr.Problem, robot: pinocchio.Model) -> crocoddyl.ShootingProblem:
    """The same from Crocoddyl's own parts; all joints driven."""
    state = crocoddyl.StateMultibody(robot)
    actuation = crocoddyl.ActuationModelFull(state)
    away = crocoddyl.ResidualModelState(state, problem.goal, actuation.nu)
    effort = crocoddyl.ResidualModelControl(state, actuation.nu)

    def costs(**weighted) -> crocoddyl.CostModelSum:
        found = crocoddyl.CostModelSum(state, actuation.nu)
        for name, (weights, residual) in weighted.items():
            activation = crocoddyl.ActivationModelWeightedQuad(weights)
            found.addCost(name, crocoddyl.CostModelResidual(state, activation, residual), 1.0)
        return found

    running = costs(away=(problem.running, away), effort=(problem.effort, effort))
    final = costs(away=(problem.final, away))
    dynamics = [
        crocoddyl.DifferentialActionModelFreeFwdDynamics(state, actuation, c) for c in (running, final)
    ]
    for one in dynamics:  # Crocoddyl 3.2.1, compiled with Pinocchio 4.0, else leaves gravity out beside 4.1
        one.armature = np.zeros(robot.nv)
    step = crocoddyl.IntegratedActionModelEuler(dynamics[0], problem.dt)
    last = crocoddyl.IntegratedActionModelEuler(dynamics[1], 0.0)
    return crocoddyl.ShootingProblem(problem.start, [step] * problem.steps, last)


def solved(shooting: crocoddyl.ShootingProblem, problem: ilqr.Problem) -> tuple[float, int, float]:
    """Cost, iterations and seconds of FDDP from the held robot."""
    solver = crocoddyl.SolverFDDP(shooting)
    solver.th_stop = 1e-10
    begin = time.perf_counter()
    solver.solve([problem.start] * (problem.steps + 1), [problem.held] * problem.steps, 100, False)
    return solver.cost, solver.iter, time.perf_counter() - begin


def kr6_of_pinocchio() -> pinocchio.Model:
    from psdmc.robot.load import load_robot
    from psdmc.robot.reference import reference

    return reference(load_robot(ilqr.ROBOTS / "kr6.toml")).model


def main() -> None:
    problem = ilqr.kr6()
    ways = {
        "Crocoddyl, psdmc's functions called from Python": with_psdmc(problem),
        "Crocoddyl, Pinocchio's in C++": with_pinocchio(problem, kr6_of_pinocchio()),
    }
    for name, shooting in ways.items():
        cost, iterations, seconds = solved(shooting, problem)
        print(f"{name:<50} cost {cost:.9f}, {iterations} iterations, {iterations / seconds:.0f} a second")
    own = ilqr.solve(problem)
    rate = (len(own.costs) - 1) / own.seconds
    print(
        f"{'iLQR in NumPy, psdmc':<50} cost {own.costs[-1]:.9f}, {len(own.costs) - 1} iterations, {rate:.0f} a second"
    )


if __name__ == "__main__":
    main()
