"""Find torques that bring a KR6 to rest at a target, by the gradient through a simulation of 1,000 steps.

python examples/jax/rollout.py [--iterations 100]
"""

from __future__ import annotations

import argparse

import jax
import jax.numpy as jnp
import numpy as np

import psdmc

jax.config.update("jax_enable_x64", True)

STEPS, STEP = 1000, 1e-3
"""Of a second in all, s each."""

KNOTS = 11
"""Torques beyond gravity's are linear between so many times."""

LARGEST, DAMPING = 10.0, 4.0
"""Torques beyond gravity's and damping of a joint, as shares of the joint's inertia at the start: rad/s^2 and 1/s."""

START = np.array([0.0, -1.2, 1.4, 0.0, 0.3, 0.0])
TARGET = np.array([0.5, -0.8, 1.0, 0.3, 0.6, -0.4])
"""rad"""


def simulated(robot: psdmc.frameworks.jax_robot.JaxRobot, knots: jax.Array) -> tuple[jax.Array, jax.Array]:
    """Position and rates after all steps of semi-implicit Euler."""
    inertia = jnp.diag(robot.mass_matrix(START))
    times = jnp.linspace(0.0, KNOTS - 1.0, STEPS)
    torques = jax.vmap(lambda column: jnp.interp(times, jnp.arange(KNOTS), column), 1, 1)(jnp.tanh(knots))

    def step(
        state: tuple[jax.Array, jax.Array], torque: jax.Array
    ) -> tuple[tuple[jax.Array, jax.Array], None]:
        q, qd = state
        tau = robot.gravity(q) + inertia * (LARGEST * torque - DAMPING * qd)
        qd = qd + STEP * robot.forward_dynamics(q, qd, tau)
        return (robot.integrate(q, STEP * qd), qd), None

    return jax.lax.scan(step, (jnp.asarray(START), jnp.zeros(6)), torques)[0]


def main(iterations: int) -> None:
    robot = psdmc.jax(psdmc.derive("examples/robots/kr6.toml"))

    def cost(knots: jax.Array) -> jax.Array:
        q, qd = simulated(robot, knots)
        return ((q - TARGET) ** 2).sum() + 0.1 * (qd**2).sum() + 1e-4 * (knots**2).sum()

    gradient = jax.jit(jax.value_and_grad(cost))
    knots = jnp.zeros((KNOTS, 6))
    mean, square = jnp.zeros_like(knots), jnp.zeros_like(knots)
    for k in range(1, iterations + 1):  # Adam
        value, slope = gradient(knots)
        if k == 1:
            print(f"before: cost {value:.3f}")
        mean, square = 0.9 * mean + 0.1 * slope, 0.99 * square + 0.01 * slope**2
        knots = knots - 0.03 * (mean / (1 - 0.9**k)) / (jnp.sqrt(square / (1 - 0.99**k)) + 1e-9)
    q, qd = jax.jit(lambda knots: simulated(robot, knots))(knots)
    print(f"after {iterations} iterations: cost {cost(knots):.3f}")
    print(
        f"distance to the target: {jnp.abs(q - TARGET).max():.3f} rad, largest rate: {jnp.abs(qd).max():.3f} rad/s"
    )


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--iterations", type=int, default=100)
    main(parser.parse_args().iterations)
