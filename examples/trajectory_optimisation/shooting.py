"""A point-to-point motion by multiple shooting in IPOPT, with whatever CasADi function computes the accelerations.

    python examples/trajectory_optimisation/shooting.py PACKAGE ROBOT.npz

PACKAGE is what `psdmc emit-c ROBOT.npz -o PACKAGE --with casadi_hessian` wrote and `psdmc build PACKAGE` built. The same
problem is solved with approximated Hessians, and with Pinocchio's articulated bodies on CasADi's symbols; times and optima
are printed.
"""

from __future__ import annotations

import sys
import time
from dataclasses import dataclass
from pathlib import Path

import casadi
import numpy as np

STEPS, DURATION = 40, 0.8
"""Of the motion; s."""

BRISK = 20.0
"""rad/s^2; torques count as shares of what gives one joint alone this acceleration at the start."""


@dataclass(frozen=True)
class Solution:
    """cost; states (steps + 1, 2 n) and torques (steps, n); IPOPT's iterations and their CPU seconds."""

    cost: float
    states: np.ndarray
    torques: np.ndarray
    iterations: int
    seconds: float


def point_to_point(
    acceleration: casadi.Function,
    start: np.ndarray,
    goal: np.ndarray,
    steps: int = STEPS,
    duration: float = DURATION,
    hessian: str = "limited-memory",
) -> Solution:
    """From rest at `start` to rest at `goal` with the least sum of squared shares of torque; steps of semi-implicit Euler.

    acceleration  (q, qd, tau) -> qdd
    hessian       'limited-memory': IPOPT approximates second derivatives; 'exact': the function needs them
    """
    n, dt = len(start), duration / steps
    by_torque = acceleration.jacobian()(start, np.zeros(n), np.zeros(n), 0)[2]
    effort = BRISK / np.diag(np.array(by_torque))
    x, u = casadi.MX.sym("x", 2 * n, steps + 1), casadi.MX.sym("u", n, steps)
    gaps = []
    for k in range(steps):
        q, qd = x[:n, k], x[n:, k]
        after = qd + dt * acceleration(q, qd, effort * u[:, k])
        gaps += [q + dt * after - x[:n, k + 1], after - x[n:, k + 1]]
    rest = np.zeros(n)
    ends = [x[:, 0] - np.hstack([start, rest]), x[:, steps] - np.hstack([goal, rest])]
    unknown = casadi.veccat(x, u)
    problem = {"x": unknown, "f": dt * casadi.sumsqr(u), "g": casadi.vertcat(*gaps, *ends)}
    options = {
        "ipopt": {"hessian_approximation": hessian, "tol": 1e-8, "max_iter": 1000, "print_level": 0},
        "print_time": False,
    }
    solver = casadi.nlpsol("solver", "ipopt", problem, options)
    guess = np.vstack([np.linspace(start, goal, steps + 1).T, np.zeros((n, steps + 1))])
    first = np.hstack([guess.T.ravel(), np.zeros(n * steps)])
    begin = time.process_time()
    found = solver(x0=first, lbg=0.0, ubg=0.0)
    seconds = time.process_time() - begin
    if not solver.stats()["success"]:
        raise RuntimeError(f"IPOPT gave up: {solver.stats()['return_status']}")
    values = np.array(found["x"]).ravel()
    states, torques = np.split(values, [2 * n * (steps + 1)])
    return Solution(
        float(found["f"]),
        states.reshape(steps + 1, 2 * n),
        effort * torques.reshape(steps, n),
        solver.stats()["iter_count"],
        seconds,
    )


def main() -> None:
    from psdmc.bench.case import Case
    from psdmc.bench.rivals.casadi_c import symbolic
    from psdmc.model.load import load

    package, model = Path(sys.argv[1]), load(sys.argv[2])
    library = next((package / "build").glob("lib*_casadi_hessian.so"))
    robot = library.stem.removeprefix("lib").removesuffix("_casadi_hessian")
    ours = casadi.external(f"{robot}_forward_dynamics", str(library))
    rivals = {
        "psdmc, limited-memory": (ours, "limited-memory"),
        "psdmc, exact Hessian": (ours, "exact"),
        "Pinocchio on CasADi's symbols, exact Hessian": (symbolic(Case(robot, model)), "exact"),
    }
    start, goal = np.zeros(model.n), 0.6 * (-1.0) ** np.arange(model.n)
    for name, (acceleration, hessian) in rivals.items():
        found = point_to_point(acceleration, start, goal, hessian=hessian)
        each = 1e3 * found.seconds / found.iterations
        print(f"{name:<46} optimum {found.cost:.9f}  {found.iterations} iterations, {each:.2f} ms each")


if __name__ == "__main__":
    main()
