"""Identify the load that a KR6 carries, by gradient descent through a simulation.

A log of 4 s is simulated with the load. From each state of the log, a robot with an assumed load simulates the next 20 ms
with the logged torques. Gradient descent changes the load until these simulations end at the logged rates.

python examples/jax/identify.py [--iterations 60]
"""

from __future__ import annotations

import argparse

import jax
import jax.numpy as jnp
import numpy as np

import psdmc

jax.config.update("jax_enable_x64", True)

STEP, SAMPLES, EVERY = 1e-3, 200, 20
"""s; samples of the log, and steps from one to the next."""

NOISE = 1e-4
"""rad/s, standard deviation of the logged rates."""

LOAD = {"mass": 2.5, "com": (0.02, 0.0, 0.05)}
"""kg; m in the tip frame: what is to be found."""

ASSUMED = np.array([1.0, 0.0, 0.0, 0.0])
"""kg, kg m: mass and first moments of the load at the start."""


def features(load: jax.Array) -> jax.Array:
    """What theta_b is linear in: a point mass's zeroth, first and second moments."""
    mass, first = load[0], load[1:]
    return jnp.concatenate((load, jnp.outer(first, first)[np.triu_indices(3)] / mass))


def theta_per_feature(model: psdmc.DynamicsModel) -> np.ndarray:
    """(l, 10), from the base parameters with ten known loads."""
    loads = np.random.default_rng(2).uniform(0.5, 1.0, (10, 4))
    changes = [
        model.with_payload(m, first / m).theta_b - model.theta_b
        for m, *first in loads
        for first in [np.array(first)]
    ]
    return np.linalg.solve(np.array([features(load) for load in loads]), np.array(changes)).T


def step(
    robot: psdmc.frameworks.jax_robot.JaxRobot, state: tuple, tau: jax.Array, theta_b: jax.Array
) -> tuple:
    """The state after a step of semi-implicit Euler."""
    q, qd = state
    qd = qd + STEP * robot.forward_dynamics(q, qd, tau, theta_b)
    return robot.integrate(q, STEP * qd), qd


def simulated_log(robot: psdmc.frameworks.jax_robot.JaxRobot, theta_b: jax.Array) -> tuple[jax.Array, ...]:
    """q and qd at each sample, and the torques of all steps between, of a controller that follows slow sines."""
    rng = np.random.default_rng(0)
    size, speed, phase = (rng.uniform(low, high, 6) for low, high in ((0.3, 0.8), (1.0, 4.0), (0.0, 6.0)))
    inertia = jnp.diag(robot.mass_matrix(np.zeros(6)))

    def one(state: tuple, time: jax.Array) -> tuple:
        q, qd = state
        error = size * jnp.sin(speed * time + phase) - q
        tau = robot.nonlinear_effects(q, qd) + inertia * (100.0 * error - 20.0 * qd)
        return step(robot, state, tau, theta_b), (q, qd, tau)

    times = STEP * jnp.arange(SAMPLES * EVERY)
    _, (q, qd, tau) = jax.lax.scan(one, (jnp.asarray(size * np.sin(phase)), jnp.zeros(6)), times)
    noise = NOISE * rng.normal(size=(SAMPLES, 6))
    return q[::EVERY], qd[::EVERY] + noise, tau.reshape(SAMPLES, EVERY, 6)


def main(iterations: int) -> None:
    model = psdmc.derive("examples/robots/kr6.toml")
    loaded = model.with_payload(**LOAD)
    robot = psdmc.jax(model)
    q, qd, tau = jax.jit(simulated_log, static_argnums=0)(robot, jnp.asarray(loaded.theta_b))
    per_feature, inertia = theta_per_feature(model), jnp.diag(robot.mass_matrix(np.zeros(6)))

    def errors(load: jax.Array) -> jax.Array:
        """N m s: how far each sample's simulated rates are off at the next sample, times the joints' inertias."""
        theta_b = model.theta_b + per_feature @ features(load)

        def end(q: jax.Array, qd: jax.Array, torques: jax.Array) -> jax.Array:
            steps = jax.lax.scan(
                lambda state, tau: (step(robot, state, tau, theta_b), None), (q, qd), torques
            )
            return steps[0][1]

        return (inertia * (jax.vmap(end)(q[:-1], qd[:-1], tau[:-1]) - qd[1:])).ravel()

    # Descend along directions of the load that change the errors equally: from the singular values at the start.
    _, strengths, directions = jnp.linalg.svd(jax.jit(jax.jacfwd(errors))(ASSUMED), full_matrices=False)
    scaled = directions.T / strengths

    gradient = jax.jit(jax.value_and_grad(lambda load: 0.5 * (errors(load) ** 2).sum()))
    load = jnp.asarray(ASSUMED)
    for k in range(iterations + 1):
        value, slope = gradient(load)
        if k % 10 == 0:
            off = float(jnp.sqrt(2.0 * value / qd[1:].size))
            mass, com = float(load[0]), ", ".join(f"{x:.4f}" for x in load[1:] / load[0])
            print(f"{k:3}: simulations off by {off:.1e} N m s, load of {mass:.4f} kg at ({com}) m")
        load = load - 0.3 * scaled @ (scaled.T @ slope)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--iterations", type=int, default=60)
    main(parser.parse_args().iterations)
