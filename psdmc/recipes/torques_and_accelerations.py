"""Records inverse dynamics (joint torques), its derivatives and the regressor, and forward dynamics (accelerations) as code,
for all generated functions that need them. The torques contain joint friction if a package is generated with friction in
the dynamics."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from operator import add, sub

import numpy as np

from psdmc.dynamics.arrow import Arrow, eliminated
from psdmc.dynamics.composite_body import mass_matrix
from psdmc.dynamics.coordinates import as_tuple, flat, joints_of_rates, positions
from psdmc.dynamics.derivatives import Derivatives, Rows, inverse_dynamics_derivatives
from psdmc.dynamics.forward_dynamics import forward_dynamics
from psdmc.dynamics.frames import part_of, with_carriers
from psdmc.dynamics.newton_euler import NO_WRENCHES, Wrench, inverse_dynamics
from psdmc.dynamics.regressor import regressor
from psdmc.dynamics.scalar import Scalar, Vector, dot
from psdmc.friction.joints import FrictionInDynamics
from psdmc.program.kernel import GRAVITY, pass_gravity_on, takes_gravity
from psdmc.program.signature import Structure, SymmetricMatrix
from psdmc.recipes.on_arrays import columns
from psdmc.recipes.recipe import Given, Ingredients, Recipe, RobotOnArrays
from psdmc.reproducible import times
from psdmc.robot.mechanism import Array


def torques(
    g: Ingredients,
    qd: Sequence[Scalar],
    qdd: Sequence[Scalar],
    base_acceleration: Vector,
    qd_r: Sequence[Scalar] | None = None,
    external: Mapping[int, Wrench] = NO_WRENCHES,
) -> tuple[Scalar, ...]:
    """Return the n joint torques M qdd + C(q, qd) qd_r, recorded as code. C(q, qd) is the Coriolis matrix; without
    qd_r, it multiplies qd.

    `base_acceleration` is the acceleration of the base, which includes gravity. The torques that `external` wrenches on
    the links exert are subtracted. The friction `g.friction`, if any, is added.
    """
    q = g.inputs["q"]
    tau = inverse_dynamics(
        g.frames, g.bodies, g.drives, q, qd, qdd, base_acceleration, g.choices, qd_r, external
    )
    return tau if g.friction is None else tuple(map(add, tau, g.friction.torques(q, qd)))


def torque_derivatives(
    g: Ingredients, qdd: Sequence[Scalar], external: Mapping[int, Wrench] = NO_WRENCHES
) -> Derivatives:
    """Return the derivatives of the joint torques by q, qd and qdd, recorded as code, with those of friction."""
    q, qd = g.inputs["q"], g.inputs["qd"]
    return with_friction_slopes(
        g,
        inverse_dynamics_derivatives(
            g.frames, g.bodies, g.drives, q, qd, qdd, g.base_acceleration, g.choices, external
        ),
    )


def with_friction_slopes(g: Ingredients, found: Derivatives) -> Derivatives:
    """Return the derivatives of the joint torques with those of the friction `g.friction`, if any."""
    if g.friction is None:
        return found
    by_q, by_qd = g.friction.slopes(g.inputs["q"], g.inputs["qd"])
    return found._replace(by_q=on_diagonal(found.by_q, by_q), by_qd=on_diagonal(found.by_qd, by_qd))


def less_friction(g: Ingredients, tau: Sequence[Scalar]) -> Sequence[Scalar]:
    """Return motor torques less the friction `g.friction`, if any: the torques that move the rigid bodies."""
    return (
        tau if g.friction is None else list(map(sub, tau, g.friction.torques(g.inputs["q"], g.inputs["qd"])))
    )


def on_diagonal(rows: Sequence[Sequence[Scalar]], added: Sequence[Scalar]) -> Rows:
    """Return a square matrix with `added` added to its diagonal."""
    found = [list(row) for row in rows]
    for i, x in enumerate(added):
        found[i][i] = found[i][i] + x
    return tuple(map(tuple, found))


def with_friction(recipe: Recipe, friction: FrictionInDynamics | None) -> Recipe:
    """Return the recipe of a function whose motor torques contain joint friction. Functions without motor torques, such
    as the mass matrix, are returned unchanged.

    Code with friction has no expanded form and no SIMD lanes for limbs, because friction differs from limb to limb.
    """
    if friction is None or not recipe.signature.has_motor_torques:
        return recipe
    return replace(
        recipe,
        trace=lambda g: recipe.trace(replace(g, friction=friction)),
        reference=lambda robot, given: recipe.reference(replace(robot, friction=friction), given),
        polynomials=None,
        in_limbs=False,
    )


def with_gravity_input(recipe: Recipe, functions: Mapping[str, Recipe]) -> Recipe:
    """Return the recipe of a function to which callers give gravity. A function that does not depend on gravity keeps its
    inputs. If its loops call one that does, they give it no gravity: the effects of gravity cancel.

    Code with this input has no expanded form, because gravity in P has one direction.

    functions  all recipes by name, among them those of the functions that the function calls
    """
    loops, depends = recipe.regions, recipe.signature.depends_on_gravity
    called = {name for name in recipe.signature.calls if functions[name].signature.depends_on_gravity}
    if loops is not None:
        recipe = replace(
            recipe, regions=lambda *frames, **more: pass_gravity_on(loops(*frames, **more), called, depends)
        )
    if not depends:
        return recipe
    return replace(
        recipe,
        signature=takes_gravity(recipe.signature),
        trace=lambda g: recipe.trace(replace(g, base_acceleration=_against_gravity(g))),
        reference=lambda robot, given: recipe.reference(pulled(robot, given), given),
        polynomials=None,
    )


def _against_gravity(g: Ingredients) -> Vector:
    """Minus the input gravity, along g.base_axes."""
    x, y, z = (-dot(axis, tuple(g.inputs[GRAVITY.name])) for axis in zip(*g.base_axes, strict=True))
    return (x, y, z)


def pulled(robot: RobotOnArrays, given: Given) -> RobotOnArrays:
    """Return the robot under the gravity of each state, if gravity is an input."""
    return replace(robot, gravity=given.get(GRAVITY.name))


def moved_by(g: Ingredients, rate: int) -> tuple[Ingredients, tuple[int, ...]]:
    """Return a part of the robot: the bodies that one joint rate moves, and all bodies between them and the base.
    Return the numbers of the part's rates in the whole robot, too."""
    frames, owners = g.frames, joints_of_rates(g.frames)
    moved: set[int] = set()
    for i, frame in enumerate(frames):
        led_by = (i,) if frame.mimic is None else frame.mimic.leaders
        if owners[rate] in led_by or frame.parent in moved:
            moved.add(i)
    kept = with_carriers(frames, moved)
    rates = tuple(k for k, joint in enumerate(owners) if joint in kept)
    leading = [i for i, frame in enumerate(frames) if frame.mimic is None]
    q = dict(zip(leading, positions(frames, g.inputs["q"]), strict=True))
    own = [as_tuple(q[i]) for i in kept if i in q]
    part = replace(
        g,
        frames=part_of(frames, kept),
        bodies=tuple(g.bodies[i] for i in kept),
        drives=tuple(g.drives[i] for i in kept),
        inputs={**g.inputs, "q": flat(own), "qd": [g.inputs["qd"][k] for k in rates]},
    )
    return part, rates


MASS_MATRIX = SymmetricMatrix(
    "the mass matrix",
    Structure.LIMBS,
    ("nv",),
    number="the number of the joint, from 0, at which the mass matrix is not positive definite",
    failure="the mass matrix is not positive definite in a state",
    unit="J s^2",
    powers=(-2,),
)
"""M(q), which functions solve or invert."""


def accelerations(
    g: Ingredients, tau: Sequence[Scalar], external: Mapping[int, Wrench] = NO_WRENCHES
) -> tuple[list[Scalar], Arrow]:
    """Return n accelerations M^-1 (tau - h), and the factors of M. The bias h contains external wrenches on the links.

    M is factorized before h is computed. The divisions of the factorization must wait for each other, and the processor
    computes h meanwhile.
    """
    factors = eliminated(g.frames, mass_matrix(g.frames, g.bodies, g.drives, g.inputs["q"], g.choices))
    bias = torques(g, g.inputs["qd"], g.still, g.base_acceleration, external=external)
    return factors.solved([given - h for given, h in zip(tau, bias, strict=True)]), factors


def accelerations_and_pivots(
    g: Ingredients, tau: Sequence[Scalar], external: Mapping[int, Wrench] = NO_WRENCHES
) -> tuple[Sequence[Scalar], Sequence[Scalar]]:
    """Return the nv joint accelerations M^-1 (tau - h), and the nv pivots (divisors in the factorization) of the mass
    matrix M. Here h is the torque at zero acceleration.

    `choices` selects the algorithm: factorization of M, or articulated bodies.
    """
    if not g.choices.articulated:
        found, factors = accelerations(g, tau, external)
        return found, factors.pivots
    q, qd = g.inputs["q"], g.inputs["qd"]
    moving = less_friction(g, tau)
    return forward_dynamics(
        g.frames, g.bodies, g.drives, q, qd, moving, g.base_acceleration, g.choices, external
    )


def traced_rows(
    g: Ingredients, qdd: Sequence[Scalar], qd_r: Sequence[Scalar] | None = None
) -> list[list[Scalar]]:
    """Return the regressor, n rows of l entries: the derivatives of joint torques by the base parameters theta_b. It is
    recorded as code.

    The torques are M qdd + C(q, qd) qd_r + g, with the Coriolis matrix C and the torque g of gravity. Without qd_r, C
    multiplies qd.
    """
    needed = [j for j in range(len(g.lift)) if g.lift[j].any()]
    q, qd = g.inputs["q"], g.inputs["qd"]
    found = regressor(g.frames, g.link_frames, set(needed), q, qd, qdd, g.base_acceleration, qd_r)
    weights = [[(j, x) for j, x in enumerate(column) if x] for column in g.lift.T.tolist()]
    return [[_entry(column, row) for column in weights] for row in found]


def _entry(weights: Sequence[tuple[int, float]], row: dict[int, Scalar]) -> Scalar:
    total: Scalar = 0.0
    for j, weight in weights:
        if j in row:
            total = total + row[j] * weight
    return total


def rows_on_arrays(robot: RobotOnArrays, q: Array, qd: Array, qdd: Array, qd_r: Array | None = None) -> Array:
    """Return the regressor (k, n, l) for k states, computed in NumPy. It has the entries of `traced_rows`."""
    wanted = np.flatnonzero(robot.lift.any(axis=1)).tolist()
    places = [joint.link_frame for joint in robot.chain.joints]
    states = (list(q.T), list(qd.T), list(qdd.T))
    rates = None if qd_r is None else list(qd_r.T)
    rows = regressor(robot.frames, places, frozenset(wanted), *states, robot.base_acceleration, rates)
    full = np.stack([columns([row.get(c, 0.0) for c in wanted], len(q)) for row in rows], axis=1)
    return np.asarray(times(full, robot.lift[wanted]))
