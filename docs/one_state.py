"""python docs/one_state.py [ROBOT]: what one call of a compiled robot from Python costs, beside cffi's way and pin.rnea."""

from __future__ import annotations

import sys
import timeit
from collections.abc import Callable

import numpy as np
import pinocchio as pin

import psdmc
from psdmc.robot.load import load_robot
from psdmc.robot.reference import reference
from psdmc.toolchain.direct_calls import direct_calls

CALLS, REPEATS = 5_000, 40
"""Of each way, alternating: minima of this many runs tell the ways apart also on a busy machine."""


def nanoseconds(call: Callable[[], object]) -> float:
    """A call's time in one run of CALLS."""
    return timeit.timeit(call, number=CALLS) / CALLS * 1e9


def main(path: str = "examples/robots/kr6.toml") -> None:
    robot = psdmc.compile(psdmc.derive(path))
    model = reference(load_robot(path)).model
    data = model.createData()
    q, qd, qdd = np.random.default_rng(0).uniform(-1.0, 1.0, (3, robot.n))
    out, theta_b = np.empty(robot.n), robot.theta_b
    through_cffi = type(robot).inverse_dynamics.__get__(robot)
    ways: dict[str, Callable[[], object]] = {
        "robot.inverse_dynamics(q, qd, qdd)": lambda: robot.inverse_dynamics(q, qd, qdd),
        "the same with out=": lambda: robot.inverse_dynamics(q, qd, qdd, out=out),
        "the same with theta_b": lambda: robot.inverse_dynamics(q, qd, qdd, theta_b),
        "theta_b through cffi": lambda: through_cffi(q, qd, qdd, theta_b),
        "through cffi": lambda: through_cffi(q, qd, qdd),
        "pin.rnea(model, data, q, qd, qdd)": lambda: pin.rnea(model, data, q, qd, qdd),
    }
    best = dict.fromkeys(ways, float("inf"))
    for _ in range(REPEATS):
        for name, call in ways.items():
            best[name] = min(best[name], nanoseconds(call))
    print(f"direct calls: {direct_calls().reason or 'yes'}")
    for name, time in best.items():
        print(f"{name:36s} {time:9.0f} ns")


if __name__ == "__main__":
    main(*sys.argv[1:])
