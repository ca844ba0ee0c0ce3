"""Newton-Euler on a trace's ingredients, which several functions need."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from psdmc.dynamics.newton_euler import NO_WRENCHES, Wrench, inverse_dynamics
from psdmc.dynamics.scalar import Scalar, Vector
from psdmc.recipes.recipe import Ingredients


def torques(
    g: Ingredients,
    qd: Sequence[Scalar],
    qdd: Sequence[Scalar],
    base_acceleration: Vector,
    qd_r: Sequence[Scalar] | None = None,
    external: Mapping[int, Wrench] = NO_WRENCHES,
) -> tuple[Scalar, ...]:
    """n joint torques M qdd + C(q, qd) qd_r, qd_r = qd if not given, for this acceleration of the base, less the
    torques of external wrenches on the links."""
    q = g.inputs["q"]
    return inverse_dynamics(
        g.frames, g.bodies, g.drives, q, qd, qdd, base_acceleration, g.choices, qd_r, external
    )
