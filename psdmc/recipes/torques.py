"""Records the Newton-Euler algorithm (joint torques) as code, for all generated functions that need it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from psdmc.dynamics.frames import part_of, with_carriers
from psdmc.dynamics.newton_euler import NO_WRENCHES, Wrench, inverse_dynamics
from psdmc.dynamics.scalar import Scalar, Vector
from psdmc.dynamics.slices import flat, joints_of_rates, positions
from psdmc.recipes.recipe import Ingredients


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
    the links exert are subtracted.
    """
    q = g.inputs["q"]
    return inverse_dynamics(
        g.frames, g.bodies, g.drives, q, qd, qdd, base_acceleration, g.choices, qd_r, external
    )


def moved_by(g: Ingredients, rate: int) -> tuple[Ingredients, tuple[int, ...]]:
    """Return a part of the robot: the bodies that one joint rate moves, and all bodies between them and the base.
    Return the numbers of the part's rates in the whole robot, too."""
    frames, owners = g.frames, joints_of_rates(g.frames)
    moved: set[int] = set()
    for i, frame in enumerate(frames):
        leader = i if frame.follows is None else frame.follows[0]
        if leader == owners[rate] or frame.parent in moved:
            moved.add(i)
    kept = with_carriers(frames, moved)
    rates = tuple(k for k, joint in enumerate(owners) if joint in kept)
    leading = [i for i, frame in enumerate(frames) if frame.follows is None]
    q = dict(zip(leading, positions(frames, g.inputs["q"]), strict=True))
    own = [q[i] if isinstance(q[i], tuple) else (q[i],) for i in kept if i in q]
    part = replace(
        g,
        frames=part_of(frames, kept),
        bodies=tuple(g.bodies[i] for i in kept),
        drives=tuple(g.drives[i] for i in kept),
        inputs={**g.inputs, "q": flat(own), "qd": [g.inputs["qd"][k] for k in rates]},
    )
    return part, rates
