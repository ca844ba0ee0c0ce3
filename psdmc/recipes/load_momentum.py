"""The function that the load estimator of a C package calls. It computes the momentum of the robot and of a load at its tip.
Users cannot call it, so it is not among psdmc.functions."""

from __future__ import annotations

from psdmc.dynamics.momentum_and_energy import generalized_momentum, load_momentum
from psdmc.program.signature import QD, Joined, Q, Quantity, Signature
from psdmc.recipes.on_arrays import entries
from psdmc.recipes.recipe import Arrays, Given, Ingredients, Outputs, Recipe, Reference, RobotOnArrays

LOADS = {"mass": 4, "inertia": 10}
"""By the word of --estimator, how many of a load's parameters are estimated: mass and first moments; inertias, too."""

FUNCTION = "load_momentum"


def load_recipe(kind: str) -> Recipe:
    """Return the recipe of the function that computes momenta for an estimator. `kind` is a key of LOADS."""
    count = LOADS[kind]

    def trace(g: Ingredients) -> Outputs:
        q, qd, up = g.inputs["q"], g.inputs["qd"], g.base_acceleration
        own = generalized_momentum(g.frames, g.bodies, g.drives, q, qd, up)
        return _named(own, load_momentum(g.frames, g.tip, g.tip_body, q, qd, up, count))

    def reference(robot: RobotOnArrays, given: Given) -> Arrays:
        states, up, tip = (
            (list(given["q"].T), list(given["qd"].T)),
            robot.base_acceleration,
            robot.chain.tip_frame,
        )
        own = generalized_momentum(robot.frames, robot.bodies, robot.drives, *states, up)
        load = load_momentum(robot.frames, tip.placement, tip.joint, *states, up, count)
        return {name: entries(value, len(given["q"])) for name, value in _named(own, load).items()}

    signature = Signature(
        FUNCTION,
        1000,
        "momentum p = M(q) qd and p_rate = C(q, qd)^T qd - g(q) of the robot, and what one unit of each load parameter "
        "adds to both; [parameter][joint]",
        (Q, QD),
        (
            Quantity("p", ("nv",), unit="J s", powers=(-1,)),
            Quantity("p_rate", ("nv",), unit="J", powers=(-1,)),
            _by_load("p_load", ("m^2/s", "m/s", "1/s"), count),
            _by_load("p_rate_load", ("m^2/s^2", "m/s^2", "1/s^2"), count),
        ),
        theta=True,
    )
    return Recipe(
        signature,
        "momentum with a load",
        trace,
        reference,
        "",
        _pinocchio,
        shares="inverse_dynamics",
        matters=(),
    )


def _named(own: tuple[list, ...], load: tuple[list, ...]) -> Outputs:  # type: ignore[type-arg]
    return dict(zip(("p", "p_rate", "p_load", "p_rate_load"), (*own, *load), strict=True))


def _by_load(name: str, units: tuple[str, str, str], count: int) -> Quantity:
    """A row for each load parameter: one for the mass, three for the first moments, six for the inertias."""
    rows = (("1", units[0]), ("3", units[1]), ("6", units[2]))[: 2 if count == LOADS["mass"] else 3]
    parts = tuple(Quantity(name, (number, "nv"), unit=unit, powers=(0, -1)) for number, unit in rows)
    return Joined(name, ("+".join(f"{number}*nv" for number, _ in rows),), unit=units[0], parts=parts)


def _pinocchio(robot: Reference, given: Given) -> Arrays:
    """The robot's own; tests compare the load's with Pinocchio's bodies."""
    import numpy as np

    q, qd = given["q"], given["qd"]
    turned = np.einsum("...ji,...j->...i", robot.coriolis_matrix(q, qd), qd)
    p = np.einsum("...ij,...j->...i", robot.mass_matrix(q), qd)
    return {"p": p, "p_rate": turned - robot.gravity(q)}
