"""One random robot through psdmc, against Pinocchio and MuJoCo: errors relative to each joint's largest torque."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from unittest import mock

import numpy as np
from campaign_oracles import MuJoCo, Pinocchio
from campaign_robots import RandomRobot, random_robot

from psdmc.compiler import compile
from psdmc.derivation.derive import derive_model
from psdmc.lower import kernels, search
from psdmc.lower.kernels import lower
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.program.interpret import interpret
from psdmc.robot.load import DEFAULT_SNAP, load_robot_text

Array = np.ndarray
States = tuple[Array, Array, Array]
Errors = dict[str, float]

RANGES = (np.pi, 3.0, 5.0)
"""q (rad or m), qd and qdd are drawn from plus or minus these."""

EXPANDED_JOINTS = 7
"""E and P are made for robots up to this length."""

VALUES = 20_000_000
"""Values of functions that E and P may take per robot: with 250,000 functions, 80 states instead of all."""

MUJOCO_LIMIT, LIMIT, SINGLE_LIMIT = 1e-10, 1e-11, 1e-3
"""Errors that pass: against MuJoCo, which makes each inertia tensor diagonal by iteration until it is so to 1e-12; against
Pinocchio; of code in float32."""

BUDGET = 12
"""Programs that the search for cheap arrangements may trace: whichever it takes must be right."""

WHAT_IS_COMPILED = (
    ("auto", "float64", "inline"),
    ("auto", "float64", "libm"),
    ("factored", "float64", "freestanding"),
    ("auto", "float32", "inline"),
)


def measured(seed: int, count: int, *, lowered: bool) -> Errors:
    """Errors by what was compared with what, of the robot of a seed at `count` random states. Raises whatever psdmc does:
    nothing is expected to."""
    robot = random_robot(seed)
    states = random_states(seed, len(robot.joints), count)
    as_written = Pinocchio.of_text(robot.text).torques(*states)
    errors = {"MuJoCo, Pinocchio": error(MuJoCo(robot.text).torques(*states), as_written)}
    exact = load_robot_text(robot.text, "urdf", snap=0.0)
    errors |= _of_chain(exact.chain, "snap 0", states, as_written, lowered)
    snapped = load_robot_text(robot.text, "urdf", snap=DEFAULT_SNAP)
    if snapped.snap_report:
        reference = Pinocchio.of_chain(snapped.chain).torques(*states)
        errors |= _of_chain(snapped.chain, "snapped", states, reference, lowered)
    return errors


def failures(errors: Errors) -> Errors:
    """The errors that do not pass, NaN included."""
    return {what: e for what, e in errors.items() if not e <= limit_of(what)}


def limit_of(what: str) -> float:
    if what.startswith("MuJoCo"):
        return MUJOCO_LIMIT
    return SINGLE_LIMIT if "float32" in what else LIMIT


def random_states(seed: int, n: int, count: int) -> States:
    rng = np.random.default_rng([20, seed])
    q, qd, qdd = (limit * rng.uniform(-1.0, 1.0, (count, n)) for limit in RANGES)
    return q, qd, qdd


def error(found: Array, expected: Array) -> float:
    """Largest difference of any joint, relative to that joint's largest torque over the states."""
    largest = np.abs(expected).max(axis=0)
    return float((np.abs(found - expected).max(axis=0) / np.where(largest > 0, largest, 1.0)).max())


def _of_chain(chain, name: str, states: States, expected: Array, lowered: bool) -> Errors:
    plain = derive_model(chain, expand=False)
    errors = {f"{name}, base parameters": error(plain.inverse_dynamics(*states), expected)}
    model = plain
    if len(chain) <= EXPANDED_JOINTS:
        model = derive_model(chain)
        part = slice(0, max(1, min(len(expected), VALUES // model.p)))
        found = model.inverse_dynamics(*(vector[part] for vector in states))
        largest = np.abs(expected).max(axis=0)
        errors[f"{name}, E and P"] = float((np.abs(found - expected[part]).max(axis=0) / largest).max())
    errors[f"{name}, certificate"] = float(model.certificate.max())
    if lowered:
        with mock.patch.object(kernels, "Search", partial(search.Search, budget=BUDGET)):
            errors |= {f"{name}, {what}": e for what, e in _lowered(model, states, expected)}
    return errors


def _lowered(model: DynamicsModel, states: States, expected: Array) -> Iterator[tuple[str, float]]:
    """PROGRAMs interpreted, by both lowerings and in both forms; and the compiled C."""
    given = dict(zip(("q", "qd", "qdd"), states, strict=True)) | {"theta_b": model.theta_b}
    small = model.p is not None and model.p <= kernels.EXPANDED_LIMIT
    for lowering in ("factored", "expanded") if small else ("factored",):
        for name, kernel in lower(model, lowering, ["inverse_dynamics"]).items():
            for form in ("single", "batch"):
                found = interpret(getattr(kernel, form), given, {"tau": model.n})["tau"]
                yield f"PROGRAM {lowering} {name} {form}", error(found, expected)
    for lowering, real, trig in WHAT_IS_COMPILED:
        robot = compile(model, lowering, ["inverse_dynamics"], real, trig)
        for label, theta in (("", {}), (" theta", {"theta_b": model.theta_b})):
            found = np.asarray(robot.inverse_dynamics(*states, **theta), dtype=np.float64)
            yield f"C {lowering} {real} {trig}{label}", error(found, expected)


def described(robot: RandomRobot) -> str:
    tilts = f", tilts {min(robot.tilts):.1g} to {max(robot.tilts):.1g} rad" if robot.tilts else ""
    return f"{len(robot.joints)} joints, {robot.style}{tilts}"
