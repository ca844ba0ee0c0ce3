"""The matrix that maps changes of the entries of q to changes along the joint rates (the tangent). It converts
derivatives along the tangent to derivatives by the entries of q."""

from __future__ import annotations

import numpy as np

from psdmc.dynamics.manifold import tangent
from psdmc.dynamics.scalar import Scalar
from psdmc.program.signature import Q, Quantity, Signature
from psdmc.recipes.recipe import Arrays, Given, Outputs, PlacedRobot, Recipe, Reference, on_both

INPUTS = (Q,)


def values(robot: PlacedRobot, q: list[Scalar]) -> Outputs:
    columns = [tangent(robot.frames, q, [float(i == k) for i in range(len(q))]) for k in range(len(q))]
    return {"T": list(zip(*columns, strict=True))}


def pinocchio(robot: Reference, given: Given) -> Arrays:
    """Return the tangent map for tests: the pseudo-inverse of the matrix whose columns are the rates of q's entries at
    unit joint rates."""
    rates = [robot.coordinate_rates(given["q"], unit) for unit in np.eye(robot.model.nv)]
    return {"T": np.linalg.pinv(np.stack(rates, axis=-1))}


RECIPE = Recipe(
    Signature(
        "tangent_map",
        226,
        "T with v = T dq, the displacement that a small change dq of q makes; q may have quaternions of any length, and T "
        "is zero along them; derivatives along the tangent times T are derivatives by the entries of q",
        INPUTS,
        (
            Quantity(
                "T",
                ("nv", "nq"),
                means="entry [i, j] is the derivative of v[i] by q[j]. A change dq of only the length of a "
                "quaternion gives v = 0",
                unit="1",
                powers=(1, -1),
            ),
        ),
        theta=False,
        summary="Compute the matrix T that converts a small change dq of q into a displacement v = T dq of the "
        "joints. dq has the nq entries of q, and v has nv entries, like the joint rates.",
        normalizes=True,
    ),
    "map from entries of q to the tangent",
    *on_both(values, INPUTS),
    "integrate",
    pinocchio,
    matters=(),
)
