"""python many_states.py [--states 1e8] [--scheduler ADDRESS]: torques of more states than fit into memory.

Random states of a KUKA KR6 come chunk by chunk; what is asked for is the largest torque of each joint. Dask computes it with
threads of this process, or on the cluster at ADDRESS; a plain loop over the same chunks does it beside. Printed are states
per second of both, and the most memory that this process had.
"""

from __future__ import annotations

import argparse
import resource
import time
from collections.abc import Iterator
from pathlib import Path

import dask.array as da
import numpy as np

import psdmc

ROBOT = Path(__file__).resolve().parents[1] / "robots" / "kr6.toml"
CHUNK = 50_000
"""States: three inputs of 2.4 MB each, so that a chunk stays in a processor's cache."""
SEED = 2026


def chunk_sizes(states: int) -> Iterator[int]:
    """CHUNK again and again, then what is left."""
    for start in range(0, states, CHUNK):
        yield min(CHUNK, states - start)


def drawn(generator: np.random.Generator, count: int, n: int) -> np.ndarray:
    """(3, count, n) positions, rates and accelerations."""
    return generator.uniform(-1.0, 1.0, (3, count, n))


def chunk_of_torques(robot, seed: int, count: int) -> np.ndarray:
    """(1, n) the largest torque of each joint over one chunk of states."""
    states = drawn(np.random.default_rng(seed), count, robot.n)
    return np.abs(robot.inverse_dynamics(*states)).max(axis=0)[None]


def plain_loop(robot, states: int) -> np.ndarray:
    """(n,) the largest torque of each joint, one chunk after the other."""
    found = [chunk_of_torques(robot, SEED + k, count) for k, count in enumerate(chunk_sizes(states))]
    return np.concatenate(found).max(axis=0)


def with_dask(robot, states: int) -> da.Array:
    """The same, lazily: states by random generators of Dask's, torques by the robot on Dask's arrays."""
    generator = da.random.default_rng(SEED)
    q, qd, qdd = (generator.uniform(-1.0, 1.0, (states, robot.n), chunks=(CHUNK, robot.n)) for _ in range(3))
    return abs(robot.inverse_dynamics(q, qd, qdd)).max(axis=0)


def timed(name: str, states: int, compute) -> np.ndarray:
    """The result of `compute`, whose time is printed; CPU time is that of all threads of this process."""
    begin, worked = time.perf_counter(), time.process_time()
    found = compute()
    seconds, cpu = time.perf_counter() - begin, time.process_time() - worked
    rate = states / seconds / 1e6
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(
        f"{name:10s} {rate:7.2f} million states/s  {seconds:7.1f} s  CPU {cpu:7.1f} s  memory {peak:5.0f} MiB"
    )
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--states", type=float, default=1e7)
    parser.add_argument("--scheduler", help="address of a Dask cluster, such as tcp://10.0.0.1:8786")
    given = parser.parse_args()
    states = int(given.states)
    robot = psdmc.compile(psdmc.derive(ROBOT), functions="inverse_dynamics")
    if given.scheduler:
        from distributed import Client

        Client(given.scheduler)
    lazy = timed("Dask", states, with_dask(robot, states).compute)
    loop = timed("plain loop", states, lambda: plain_loop(robot, states))
    print("largest torques, N m:", np.array2string(lazy, precision=1))
    if not np.allclose(lazy, loop, rtol=0.1):
        raise SystemExit("the two drew different states of one distribution and differ by more than a tenth")


if __name__ == "__main__":
    main()
