"""A few states of a robot, and the values of every generated function there, computed by reference code in NumPy.

The self-test of a generated package compares its results with these values on the user's machine. The reference code is
separate from the generated code. All languages use the same names, inputs and tolerances, and the same example load.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np

from psdmc.friction.joints import FrictionInDynamics
from psdmc.functions import BY_ROWS, DEFAULT, RECIPES
from psdmc.model.bodies import body_parameters, load_parameters
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.model.parameter_checks import for_every_gravity
from psdmc.model.random_states import near_closed, on_joints, random_parameters
from psdmc.program.kernel import GRAVITY, THETA_ROWS, THETAS, by_rows
from psdmc.program.signature import Q_GUESS, TAU, Q, Quantity, Signature, Sizes
from psdmc.recipes.on_arrays import RobotOnArrays
from psdmc.recipes.recipe import Needs, Recipe
from psdmc.recipes.torques_and_accelerations import pulled, with_friction, with_gravity_input
from psdmc.reproducible import times
from psdmc.robot.mechanism import Array

COUNT = 4
"""States kept. The self-test repeats them to fill batches, so that four cover every entry without making the package
large."""

CANDIDATES = 32
"""States drawn. Those whose mass matrices are best conditioned are kept, because forward dynamics loses digits with the
condition number."""

SEED = 2021
SHARE = 0.25
"""Share of another physical robot's parameters that the check of run-time parameters adds to the robot's own."""

STEPS = 8.0
"""By an eighth theta_b grows from state to state where each has its own: multiples of a physical robot are physical."""

WORST_CONDITION = 1e7
"""Condition number of M beyond which a state is no test of forward dynamics."""


@dataclass(frozen=True, slots=True, eq=False)
class ReferenceStates:
    """k states of a robot, and the expected outputs of the generated functions there.

    given     arrays (k, size) by name: q, qd, qdd and other inputs of functions. tau and tau_theta are the torques at
              (q, qd, qdd) with the robot's base parameters and with theta_b. thetas are other base parameters for each
              state, and tau_theta_rows the torques with them; both exist only if a function reads them
    expected  arrays (k, size) by the name of the output; matrices are stored row by row
    theta_b   (l,) base parameters for the function variants that take them as an input. They differ from those of the
              robot, so that the test finds a function that ignores the input
    load      (1 + number of named frames, l) what the example load adds to theta_b: at the tip, then at each named frame.
              None if the package has no functions that add loads

    If M(q) is not positive definite at the states, forward dynamics has no entry.
    """

    given: Mapping[str, Array]
    expected: Mapping[str, Array]
    theta_b: Array
    load: Array | None = None

    def __post_init__(self) -> None:
        if not self.given:
            raise ValueError("reference states hold no quantity")
        count = len(next(iter(self.given.values())))
        for name, array in (*self.given.items(), *self.expected.items()):
            if array.ndim != 2 or len(array) != count or array.size == 0:
                raise ValueError(
                    f"reference values of {name} have shape {array.shape}, expected ({count}, k)"
                )
        object.__setattr__(self, "given", MappingProxyType(dict(self.given)))
        object.__setattr__(self, "expected", MappingProxyType(dict(self.expected)))


def reference_states(
    model: DynamicsModel,
    functions: Collection[str] = DEFAULT,
    friction: FrictionInDynamics | None = None,
    gravity_input: bool = False,
) -> ReferenceStates:
    """Return states of a model, and the values of the given functions there. If the base parameters of the model are
    unknown, function variants that contain these parameters are left out. Motor torques contain `friction`, if any. With
    `gravity_input`, each state has its own gravity."""
    model = for_every_gravity(model) if gravity_input else model
    given = _drawn(model, gravity_input)

    def made(recipe: Recipe) -> Recipe:
        own = with_friction(recipe, friction)
        return with_gravity_input(own, RECIPES) if gravity_input else own

    theta_b = _other_parameters(model)
    robots = {"_theta": RobotOnArrays.of(model, theta_b)}
    if model.theta_b is not None:
        robots[""] = RobotOnArrays.of(model, np.asarray(model.theta_b))
    conditions = np.max([_conditions(robot, given["q"]) for robot in robots.values()], axis=0)
    best = np.sort(np.argsort(np.round(np.log10(conditions), 6), kind="stable")[:COUNT])
    given = {name: array[best] for name, array in given.items()}
    solvable = bool(conditions[best].max() < WORST_CONDITION)
    recipes = [made(recipe) for name, recipe in RECIPES.items() if name in functions]
    expected: dict[str, Array] = {}
    for suffix, robot in robots.items():
        tau = _motor_torques(robot, given, friction)
        given[f"{TAU.name}{suffix}"] = tau
        own = [recipe for recipe in recipes if recipe.signature.theta]
        expected |= _values(own, robot, given | {TAU.name: tau}, suffix, solvable)
    free = [recipe for recipe in recipes if not recipe.signature.theta]
    expected |= _values(free, robots.get("", robots["_theta"]), given, "", solvable)
    if any(name in BY_ROWS for name in functions):
        thetas = theta_b * (1.0 + np.arange(len(given["q"])) / STEPS)[:, None]
        own = [made(recipe) for recipe in RECIPES.values() if f"{recipe.name}{THETA_ROWS}" in functions]
        robots_by_rows = [RobotOnArrays.of(model, theta) for theta in thetas]
        values = _by_rows(own, robots_by_rows, given, solvable, friction)
        tau_rows = f"{TAU.name}{THETA_ROWS}"
        given |= {THETAS.name: thetas, tau_rows: values.pop(tau_rows)}
        expected |= values
    return ReferenceStates(given, expected, theta_b)


def _motor_torques(
    robot: RobotOnArrays, given: Mapping[str, Array], friction: FrictionInDynamics | None
) -> Array:
    """(k, nv) torques of the motors at q, qd and qdd."""
    resisted = pulled(replace(robot, friction=friction), given)
    return resisted.torques(given["q"], given["qd"], given["qdd"], resisted.base_acceleration)


def _by_rows(
    recipes: Sequence[Recipe],
    robots: Sequence[RobotOnArrays],
    given: Mapping[str, Array],
    solvable: bool,
    friction: FrictionInDynamics | None,
) -> dict[str, Array]:
    """The torques, and the outputs of the functions' variants by rows, one robot per state."""
    rows = []
    for k, robot in enumerate(robots):
        one = {name: array[k : k + 1] for name, array in given.items()}
        one[TAU.name] = _motor_torques(robot, one, friction)
        values = _values(recipes, robot, one, THETA_ROWS, solvable)
        rows.append({f"{TAU.name}{THETA_ROWS}": one[TAU.name], **values})
    return {name: np.concatenate([row[name] for row in rows]) for name in rows[0]}


def _drawn(model: DynamicsModel, gravity_input: bool) -> dict[str, Array]:
    """(CANDIDATES, size) of everything that functions read except torques, drawn in the functions' order."""
    robot, rng = model.mechanism, np.random.default_rng(SEED)
    sizes = Sizes.of(robot, model.l)
    read = {
        q.name: q for recipe in RECIPES.values() for q in recipe.signature.inputs if q not in (TAU, Q_GUESS)
    }
    read |= {GRAVITY.name: GRAVITY} if gravity_input else {}
    drawn = {q.name: q.drawn(rng.uniform(-1.0, 1.0, (CANDIDATES, sizes.size(q)))) for q in read.values()}
    if robot.passive_rates:
        drawn[Q_GUESS.name] = near_closed(robot, np.random.default_rng(SEED), CANDIDATES)
    return drawn | {q.name: on_joints(robot, drawn[q.name]) for q in read.values() if q.axes == Q.axes}


def _values(
    recipes: Sequence[Recipe], robot: RobotOnArrays, given: Mapping[str, Array], suffix: str, solvable: bool
) -> dict[str, Array]:
    """Every output of these functions, (k, size); `solvable`: the mass matrices can be inverted."""
    found: dict[str, Array] = {}
    for recipe in recipes:
        if recipe.needs is Needs.POSITIVE_MASS and not solvable:
            continue
        values = recipe.reference(robot, given)
        for output in recipe.signature.outputs:
            own = by_rows(recipe.signature) if suffix == THETA_ROWS else recipe.signature
            label = own.label(output, theta=suffix == "_theta")
            found[label] = values[output.name].reshape(len(given["q"]), -1)
    return found


def _other_parameters(model: DynamicsModel) -> Array:
    other: Array = times(model.B, random_parameters(model.mechanism))
    return other if model.theta_b is None else model.theta_b + SHARE * other


def _conditions(robot: RobotOnArrays, q: Array) -> Array:
    """Condition number of M(q) per state; infinite where it is not positive definite."""
    values = np.linalg.eigvalsh(robot.mass_matrix(q))
    with np.errstate(divide="ignore"):
        return np.where(values[:, 0] > 0.0, np.abs(values[:, -1] / values[:, 0]), np.inf)


# The example load


LOAD_MASS = 1.25
LOAD_COM = (0.05, -0.03, 0.11)
LOAD_INERTIA = np.array([[0.02, 0.003, -0.002], [0.003, 0.03, 0.001], [-0.002, 0.001, 0.025]])
"""kg, m, kg m^2 about the centre of mass: a body that no symmetry makes easier."""


def reference_load(model: DynamicsModel) -> Array:
    """Return what the self-test's example load adds to theta_b (ReferenceStates.load)."""
    chain = model.mechanism
    places = [(None, chain.tip_body), *((frame.name, frame.joint) for frame in chain.frames)]
    rows = [
        times(
            model.B[:, body_parameters(body)],
            load_parameters(chain, LOAD_MASS, LOAD_COM, LOAD_INERTIA, frame),
        )
        for frame, body in places
    ]
    return np.array(rows)


# Names and tolerances


TOLERANCES: Mapping[str, str] = {"float64": "1e-10", "float32": "1e-3"}
FORWARD_TOLERANCES: Mapping[str, str] = {"float64": "1e-7", "float32": "1e-1"}
"""Relative to a joint's largest value: large enough for badly conditioned mass matrices, small enough to detect wrong
code."""


def tolerance(function: Signature, real: str) -> str:
    """Return the tolerance of all outputs of a function."""
    return (FORWARD_TOLERANCES if function.factorises else TOLERANCES)[real]


def compared_by_row(output: Quantity) -> bool:
    """Return whether the self-test compares each row of an output relative to the largest value of that row. Otherwise,
    all entries are compared relative to the largest entry of the output."""
    return bool(output.axes) and output.axes[0] in ("6", "nv")


def given_name(vector: str, variant: str) -> str:
    """Return the name under which the reference states hold an input of a function.

    Only the torques tau have several names, because they depend on the base parameters: tau for compiled-in parameters,
    tau_theta for the input theta_b, and tau_theta_rows for one theta_b per state.

    variant  ending of the function variant: '', '_theta' or THETA_ROWS
    """
    return f"{vector}{variant}" if vector == TAU.name else vector
