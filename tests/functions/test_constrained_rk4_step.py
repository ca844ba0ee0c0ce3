"""A step of fourth-order Runge-Kutta with contacts: Pinocchio's numbers, SciPy's integrator, order, energy, statuses."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from against_pinocchio import INTERPRETED, SEVERAL, matches_pinocchio, program_matches_pinocchio
from bundled import robot_path
from contact_trees import BRICK, brick, contact_tree
from direct import Direct
from installed import in_wheel
from scipy.integrate import solve_ivp
from unoptimised import compiled, without_optimisation
from wide_robots import is_pinocchios

import psdmc
from psdmc.backends.c.package import package_view
from psdmc.backends.info import EmitOptions, package_info
from psdmc.errors import InputError
from psdmc.functions import RECIPES
from psdmc.lower.kernels import lower
from psdmc.robot.reference import reference
from psdmc.toolchain.call import CompiledRobot
from psdmc.toolchain.interface import interface_of

NAME = "constrained_rk4_step"
Array = np.ndarray


@pytest.mark.parametrize(("robot", "real"), SEVERAL)
def test_it_is_pinocchios(robot: str, real: str) -> None:
    """test_constrained_forward_dynamics.py does the same on trees, with every mask."""
    matches_pinocchio(NAME, robot, real)


@pytest.mark.parametrize("robot", INTERPRETED)
def test_its_programs_are_pinocchios(robot: str) -> None:
    program_matches_pinocchio(NAME, robot)


def test_calls_in_a_loop_where_joints_have_several_coordinates() -> None:
    is_pinocchios(NAME, "small", 1e-8)


def test_half_the_step_has_a_sixteenth_of_the_error_to_scipys_solution() -> None:
    """An arm of eight joints whose end is held by gains, from a displaced state with velocity. The truth is SciPy's, of
    dense systems of Pinocchio's numbers; there, the displacement comes from the end's position at every instant."""
    own = contact_tree(2, False)
    theirs, model = reference(own.loaded), own.model
    with without_optimisation():
        robot = psdmc.compile(model, functions=[NAME])
    q0, qd0, tau = (own.given[name][1] for name in ("q", "qd", "tau"))
    nv, seconds, kp, kd = model.nv, 0.04, 400.0, 10.0
    origin = model.forward_kinematics(q0).position[0] - 0.01

    def error(q: Array) -> Array:
        return np.asarray(model.forward_kinematics(q).position[0] - origin)

    def rates(_: float, state: Array) -> Array:
        given = {
            "q": state[:nv],
            "qd": state[nv:],
            "tau": tau,
            "active": np.ones(1),
            "error": error(state[:nv]),
        }
        arrays = {name: array[None] for name, array in given.items()}
        arrays |= {name: np.array([value]) for name, value in (("mu", 0.0), ("kp", kp), ("kd", kd))}
        qdd = RECIPES["constrained_forward_dynamics"].pinocchio(theirs, arrays)["qdd"][0]
        return np.concatenate([state[nv:], qdd])

    start = np.concatenate([q0, 0.3 * qd0])
    truth = solve_ivp(rates, (0.0, seconds), start, "DOP853", rtol=1e-12, atol=1e-12).y[:, -1]

    def miss(steps: int) -> float:
        q, qd = np.split(start, 2)
        for _ in range(steps):
            q, qd, _ = getattr(robot, NAME)(q, qd, tau, seconds / steps, [1], 0.0, kp, kd, error(q))
        return float(np.abs(np.concatenate([q, qd]) - truth).max())

    long, short = miss(16), miss(32)
    assert short < 1e-6 * np.abs(truth).max()
    assert 11.0 < long / short < 24.0


@cache
def hanging_brick() -> CompiledRobot:
    with without_optimisation():
        return psdmc.compile(
            brick("edge"), functions=[NAME, "kinetic_energy", "potential_energy", "momentum"]
        )


def test_energy_drifts_with_the_order_of_the_method() -> None:
    """A brick swings at a point, without gains: the energy, and the angular momentum about the vertical through the point.
    Half the step leaves a sixteenth of the change at most."""
    robot, changes = hanging_brick(), []
    for steps in (100, 200):
        q, qd = np.array(BRICK), np.array([0.0, 0.0, 0.0, 1.0, 0.0, 3.0])
        qd[:3] = np.cross(qd[3:], [-0.1, 0.0, 0.0])  # the point, 0.1 m before the centre, is still
        point, kept = np.add(q[:3], [0.1, 0.0, 0.0]), []
        for _ in range(steps):
            momentum = robot.momentum(q, qd)
            about = momentum[3:] - np.cross(point, momentum[:3])
            kept.append([robot.kinetic_energy(q, qd) + robot.potential_energy(q), about[2]])
            q, qd, _ = getattr(robot, NAME)(q, qd, np.zeros(6), 1.0 / steps, [1])
        changes.append(np.abs(np.array(kept) - kept[0]).max(axis=0))
    assert (changes[1] < 1e-3 * np.abs(kept[0])).all()
    assert (changes[0] / changes[1] > 12.0).all()


def test_mean_forces_are_what_changes_the_momentum() -> None:
    robot, weight = hanging_brick(), np.array([0.0, 0.0, -4.0 * 9.81])
    q, qd, dt = np.array(BRICK), np.array([0.0, 0.0, 0.3, 0.0, 3.0, 0.0]), 1e-3
    step = getattr(robot, NAME)(q, qd, np.zeros(6), dt, [1])
    change = (robot.momentum(step.q_next, step.qd_next) - robot.momentum(q, qd))[:3]
    np.testing.assert_allclose(
        change / dt, step.forces + weight, rtol=0, atol=1e-7 * np.abs(step.forces).max()
    )


@pytest.mark.slow
def test_a_quadruped_hangs_by_its_feet_and_swings_without_drift() -> None:
    """HyQ under a ceiling, four feet held, constant torques that carry its weight: the energy is T + V - tau q."""
    feet = ["lf_foot", "lh_foot", "rf_foot", "rh_foot"]
    model = psdmc.derive(in_wheel("hyq_no_sensors.urdf"), floating=True, contacts=feet)
    robot = psdmc.compile(model, functions=[NAME, "kinetic_energy", "potential_energy"])
    q, tau = hanging(model)
    start = model.contact_jacobian(q)
    push = np.array([0.3, 0.2, 0.1, 0.2, -0.3, 0.4])
    qd = np.concatenate([push, -np.linalg.solve(start[:, 6:], start[:, :6] @ push)])
    changes = []
    for steps in (400, 800):
        state, energies = (q, qd), []
        for _ in range(steps):
            own = robot.kinetic_energy(*state) + robot.potential_energy(state[0]) - tau[6:] @ state[0][7:]
            energies.append(own)
            *state, _ = getattr(robot, NAME)(*state, tau, 2.0 / steps, [1, 1, 1, 1])
        changes.append(np.abs(np.array(energies) - energies[0]).max())
    assert changes[1] < 1e-6 * robot.kinetic_energy(q, qd)
    assert changes[0] / changes[1] > 12.0


def hanging(model: psdmc.DynamicsModel) -> tuple[Array, Array]:
    """HyQ below its feet, and the motors' torques at which it rests."""
    front, hind = [0.0, 0.8 + np.pi, -1.6], [0.0, -0.8 + np.pi, 1.6]
    q = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, *front, *hind, *front, *hind])
    jacobian, gravity = model.contact_jacobian(q), model.gravity(q)
    forces = np.linalg.lstsq(jacobian[:, :6].T, gravity[:6], rcond=None)[0]
    return q, np.concatenate([np.zeros(6), (gravity - jacobian.T @ forces)[6:]])


def test_the_status_names_the_stage_and_the_contact() -> None:
    """SCARA's arm is straight at the second stage: the end cannot move along it."""
    model = psdmc.derive(robot_path("scara"), contacts=["link4"])
    dt, still = 0.1, np.zeros(4)
    qd = np.array([0.0, 1.0, 0.0, 0.0])
    q = -0.5 * dt * qd
    signature, options = RECIPES[NAME].signature, EmitOptions()
    package = package_view(package_info(model, "scara"), lower(model, functions=[NAME]), options)
    library, out = compiled(package, False), [np.zeros(4), np.zeros(4), np.zeros(3)]
    call = Direct(package, library)

    def status(q: Array, active: float = 1.0, mu: float = 0.0) -> int:
        numbers = [np.array([each]) for each in (dt, active, mu, 0.0, 0.0)]
        return call(NAME, q, qd, still, *numbers, np.zeros(3), *out)

    assert status(q + 0.3) == 0
    assert status(q) == 1 + 4 + (4 + 1) * 1
    assert all(np.isnan(values).all() for values in out)
    assert status(q, mu=1e-3) == status(q, active=0.0) == 0
    assert status(0.0 * q) == status(q, active=0.5) == 1 + 4
    assert signature.pivot_numbers[1].startswith("nv + the number, from 0, of the contact")
    assert signature.pivot_numbers[1].endswith(", + (nv + contacts) times the stage of the step")
    for robot in (model, CompiledRobot(interface_of(package), library)):
        with pytest.raises(InputError, match="contact 'link4'"):
            getattr(robot, NAME)(q, qd, still, dt, [1])
