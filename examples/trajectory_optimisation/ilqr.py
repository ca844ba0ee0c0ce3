"""Iterative LQR on psdmc's compiled step and Jacobians: a KR6 from rest to rest, and an acrobot's swing-up.

    python examples/trajectory_optimisation/ilqr.py [kr6|acrobot] [--plot FILE.png]

A step is semi-implicit Euler: qd+ = qd + dt qdd, q+ = q + dt qd+. One batch call gives the Jacobians of all steps, one a
step carries all step sizes of the line search.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import psdmc

ROBOTS = Path(__file__).resolve().parents[1] / "robots"
FUNCTIONS = ["forward_dynamics", "forward_dynamics_derivatives"]
SHARES = 2.0 ** -np.arange(10)
"""Of the full step, tried at once in the line search."""

CONVERGED = 1e-9
"""Relative decrease of the cost that ends the iterations."""

FIRM, LOOSE = 1e-9, 1e9
"""Regularisation of the torques' curvature: where it starts, and where the search gives up."""


@dataclass(frozen=True)
class Problem:
    """Least sum of dt/2 (|u|^2_R + |x - goal|^2_Q) and |x_N - goal|^2_F / 2 from x = start, tau = actuated u.

    robot            compiled, with FUNCTIONS
    start, goal      (2 n,) q, then qd
    actuated         (n, m) torques per input
    held             (m,) inputs of the first guess
    running, final   (2 n,) diagonals of Q and F
    effort           (m,) diagonal of R
    """

    robot: object
    start: np.ndarray
    goal: np.ndarray
    actuated: np.ndarray
    held: np.ndarray
    running: np.ndarray
    final: np.ndarray
    effort: np.ndarray
    steps: int
    dt: float

    def step(self, x: np.ndarray, u: np.ndarray) -> np.ndarray:
        """(k, 2 n) states after one step from k states with k inputs."""
        q, qd = np.split(x, 2, axis=-1)
        after = qd + self.dt * self.robot.forward_dynamics(q, qd, u @ self.actuated.T)
        return np.concatenate([q + self.dt * after, after], axis=-1)

    def jacobians(self, x: np.ndarray, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(k, 2 n, 2 n) and (k, 2 n, m): the step's derivatives by state and input."""
        q, qd = np.split(x, 2, axis=-1)
        found = self.robot.forward_dynamics_derivatives(q, qd, u @ self.actuated.T)
        dt, one = self.dt, np.eye(q.shape[-1])
        by_q, by_qd = dt * found.dqdd_dq, one + dt * found.dqdd_dqd
        by_u = dt * found.dqdd_dtau @ self.actuated
        A = np.concatenate(
            [np.concatenate([one + dt * by_q, dt * by_qd], -1), np.concatenate([by_q, by_qd], -1)], -2
        )
        return A, np.concatenate([dt * by_u, by_u], -2)

    def cost(self, x: np.ndarray, u: np.ndarray) -> np.ndarray:
        """Of trajectories (steps + 1, k, 2 n) and (steps, k, m): (k,)."""
        away = x - self.goal
        with np.errstate(over="ignore", invalid="ignore"):  # too long a step may run away
            running = (self.running * away[:-1] ** 2).sum((0, -1)) + (self.effort * u**2).sum((0, -1))
            return 0.5 * self.dt * running + 0.5 * (self.final * away[-1] ** 2).sum(-1)

    def rolled_out(self, x: np.ndarray, u: np.ndarray, gains: Gains) -> tuple[np.ndarray, np.ndarray]:
        """States and inputs for every share of the step: (steps + 1, k, 2 n), (steps, k, m)."""
        states, inputs = [np.tile(self.start, (len(SHARES), 1))], []
        with np.errstate(over="ignore", invalid="ignore"):  # too long a step may run away
            for k in range(self.steps):
                open_loop = SHARES[:, None] * gains.feed[k]
                inputs.append(u[k] + open_loop + (states[k] - x[k]) @ gains.back[k].T)
                states.append(self.step(states[k], inputs[k]))
        return np.array(states), np.array(inputs)


@dataclass(frozen=True)
class Gains:
    """feed (steps, m) and back (steps, m, 2 n)."""

    feed: np.ndarray
    back: np.ndarray


def backward(problem: Problem, x: np.ndarray, u: np.ndarray, regularisation: float) -> Gains | None:
    """Gains of the quadratic model around a trajectory; None where it has no minimum."""
    A, B = problem.jacobians(x[:-1], u)
    away, dt = x - problem.goal, problem.dt
    slope, curve = problem.final * away[-1], np.diag(problem.final)
    running, effort = np.diag(dt * problem.running), np.diag(dt * problem.effort)
    feed, back = np.empty_like(u), np.empty((len(u), u.shape[1], x.shape[1]))
    for k in reversed(range(problem.steps)):
        a, b = A[k], B[k]
        by_x, by_u = dt * problem.running * away[k] + a.T @ slope, dt * problem.effort * u[k] + b.T @ slope
        half = curve @ b
        uu = effort + b.T @ half
        ux = half.T @ a
        try:
            factor = np.linalg.cholesky(uu + regularisation * np.trace(uu) * np.eye(len(uu)))
        except np.linalg.LinAlgError:
            return None
        found = -np.linalg.solve(factor.T, np.linalg.solve(factor, np.column_stack([by_u, ux])))
        feed[k], back[k] = found[:, 0], found[:, 1:]
        slope = by_x + back[k].T @ (uu @ feed[k] + by_u) + ux.T @ feed[k]
        curve = running + a.T @ curve @ a + back[k].T @ (uu @ back[k] + ux) + ux.T @ back[k]
        curve = 0.5 * (curve + curve.T)
    return Gains(feed, back)


@dataclass(frozen=True)
class Solution:
    """x (steps + 1, 2 n), u (steps, m), the cost after every iteration, seconds in all."""

    x: np.ndarray
    u: np.ndarray
    costs: list[float]
    seconds: float


def solve(problem: Problem, iterations: int = 500) -> Solution:
    """Iterations until the cost no longer falls."""
    begin, regularisation = time.perf_counter(), FIRM
    m = problem.actuated.shape[1]
    held = np.tile(problem.held, (problem.steps, 1))
    still = Gains(np.zeros((problem.steps, m)), np.zeros((problem.steps, m, len(problem.start))))
    states, inputs = problem.rolled_out(np.zeros((problem.steps, len(problem.start))), held, still)
    x, u = states[:, 0], inputs[:, 0]
    costs = [float(problem.cost(states, inputs)[0])]
    while len(costs) <= iterations and regularisation < LOOSE:
        gains = backward(problem, x, u, regularisation)
        if gains is not None:
            states, inputs = problem.rolled_out(x, u, gains)
            tried = np.nan_to_num(problem.cost(states, inputs), nan=np.inf)
            best = int(np.argmin(tried))
        if gains is None or not tried[best] < costs[-1]:
            regularisation = max(10.0 * regularisation, 1e-6)
            continue
        x, u, regularisation = states[:, best], inputs[:, best], max(regularisation / 10.0, FIRM)
        costs.append(float(tried[best]))
        if costs[-2] - costs[-1] < CONVERGED * costs[-1]:
            break
    return Solution(x, u, costs, time.perf_counter() - begin)


def kr6(steps: int = 100, duration: float = 1.0) -> Problem:
    """From rest to rest, every joint by 0.6 rad; torques count as shares of those that gravity asks for at most."""
    model = psdmc.derive(ROBOTS / "kr6.toml", expand=False)
    robot = psdmc.compile(model, functions=[*FUNCTIONS, "gravity"])
    start, goal = np.zeros(12), np.hstack([0.6 * (-1.0) ** np.arange(6), np.zeros(6)])
    held = robot.gravity(start[:6])
    scale = np.abs(robot.gravity(np.random.default_rng(0).uniform(-3, 3, (100, 6)))).max(axis=0)
    effort = 1.0 / np.maximum(scale, 0.05 * scale.max()) ** 2
    final = np.repeat([1e4, 1e2], 6)
    return Problem(
        robot, start, goal, np.eye(6), held, np.full(12, 0.1), final, effort, steps, duration / steps
    )


def acrobot(steps: int = 100, duration: float = 4.0) -> Problem:
    """Two links that hang are swung up by a motor in the elbow alone."""
    model = psdmc.derive(ROBOTS / "two_link_full.toml", expand=False)
    robot = psdmc.compile(model, functions=FUNCTIONS)
    start, goal = np.array([-np.pi / 2, 0.0, 0.0, 0.0]), np.array([np.pi / 2, 0.0, 0.0, 0.0])
    elbow, final = np.array([[0.0], [1.0]]), np.repeat([1e4, 1e3], 2)
    running, effort = np.array([0.1, 0.1, 0.01, 0.01]), np.array([0.01])
    return Problem(
        robot, start, goal, elbow, np.array([0.5]), running, final, effort, steps, duration / steps
    )


def plot(solution: Solution, problem: Problem, file: Path) -> None:
    import matplotlib.pyplot as plt

    figure, (above, below) = plt.subplots(2, 1, sharex=True, figsize=(8, 6))
    times, n = problem.dt * np.arange(problem.steps + 1), len(problem.start) // 2
    above.plot(times, solution.x[:, :n], label=[f"joint {i + 1}" for i in range(n)])
    below.step(times[:-1], solution.u, where="post")
    above.set_ylabel("position (rad)"), below.set_ylabel("torque (N m)"), below.set_xlabel("s")
    above.legend()
    figure.savefig(file, dpi=120)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("problem", nargs="?", choices=["kr6", "acrobot"], default="kr6")
    parser.add_argument("--plot", type=Path)
    options = parser.parse_args()
    problem = {"kr6": kr6, "acrobot": acrobot}[options.problem]()
    found = solve(problem)
    rate = (len(found.costs) - 1) / found.seconds
    error = np.abs(found.x[-1] - problem.goal).max()
    print(
        f"{options.problem}: cost {found.costs[0]:.4g} -> {found.costs[-1]:.6g} in {len(found.costs) - 1} iterations,"
    )
    print(f"{rate:.0f} iterations a second, {error:.1e} from the goal at the end")
    if options.plot:
        plot(found, problem, options.plot)


if __name__ == "__main__":
    main()
