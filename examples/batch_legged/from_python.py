"""A million states of a legged robot for reinforcement learning: `python from_python.py [URDF] [--states N] [--threads K]`.

Dynamics of all states as NumPy arrays, rows of q (n, nq) and v (n, nv), on one thread and on several: compiled functions
release the GIL. `throughput.c` does the same in C, and lane by lane. Without URDF: solo12 of example-robot-data.
"""

from __future__ import annotations

import argparse
import importlib.metadata
import os
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np

import psdmc

SLICE = 8192
"""States a call: their results stay in a core's cache until they are used."""
PASSES = 3
FUNCTIONS = ("inverse_dynamics", "forward_dynamics", "mass_matrix")

Array = np.ndarray


def random_states(model: psdmc.DynamicsModel, count: int) -> tuple[Array, Array, Array]:
    """Positions with unit quaternions (x, y, z, w) at 3 to 6, rates, accelerations."""
    rng = np.random.default_rng(0)
    q = rng.uniform(-1.0, 1.0, (count, model.nq))
    q[:, 3:7] /= np.linalg.norm(q[:, 3:7], axis=1, keepdims=True)
    return q, rng.uniform(-2.0, 2.0, (count, model.nv)), rng.uniform(-5.0, 5.0, (count, model.nv))


def in_slices(function: Callable[..., Array], pool: ThreadPoolExecutor, *states: Array) -> list[Array]:
    """The function's results, slice by slice, on the pool's threads."""
    starts = range(0, len(states[0]), SLICE)
    return list(pool.map(lambda start: function(*(x[start : start + SLICE] for x in states)), starts))


def best_seconds(work: Callable[[], object]) -> float:
    times = []
    for _ in range(PASSES):
        start = time.perf_counter()
        work()
        times.append(time.perf_counter() - start)
    return min(times)


def solo12() -> Path:
    wheel = importlib.metadata.distribution("example-robot-data")
    file = next(
        file for file in wheel.files or () if str(file).endswith("solo_description/robots/solo12.urdf")
    )
    return Path(str(wheel.locate_file(file)))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("urdf", nargs="?", type=Path, help="a legged robot (default: solo12)")
    parser.add_argument("--states", type=int, default=1_000_000)
    parser.add_argument("--threads", type=int, default=os.cpu_count() or 1)
    options = parser.parse_args()
    model = psdmc.derive(options.urdf or solo12(), floating=True)
    robot = psdmc.compile(model, functions=FUNCTIONS)
    q, v, a = random_states(model, options.states)
    tau = robot.inverse_dynamics(q, v, a)
    back = float(np.abs(robot.forward_dynamics(q, v, tau) - a).max())
    print(
        f"{options.states} states, {model.nq} positions, {model.nv} rates; accelerations come back to {back:.1e}"
    )
    given = {"inverse_dynamics": (q, v, a), "forward_dynamics": (q, v, tau), "mass_matrix": (q,)}
    for threads in dict.fromkeys((1, options.threads)):
        with ThreadPoolExecutor(threads) as pool:
            for name, states in given.items():
                seconds = best_seconds(lambda: in_slices(getattr(robot, name), pool, *states))  # noqa: B023
                print(
                    f"{name:<18}{threads:>3} threads {1e9 * seconds / options.states:8.1f} ns a state, "
                    f"{1e-6 * options.states / seconds:7.2f} million states a second"
                )


if __name__ == "__main__":
    main()
