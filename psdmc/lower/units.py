"""The units inside a trace, that is, while a function's operations are recorded. Authors of functions need not know
these units.

psdmc chooses a unit of length, u metres, so that one length of the robot is exactly one. Energies stay in J, times in
s. Masses are then in kg/u^2. A quantity of dimension kg^a m^b s^c is its value in SI times u^(2a - b). The robot's data
in a trace are in these units. The inputs and outputs of a function are in SI, and this file converts them. If a
coordinate of the robot is a length, u is 1. Base parameters stay in SI.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from math import isqrt

import numpy as np

from psdmc.dynamics.coordinates import leading
from psdmc.dynamics.frames import Frame
from psdmc.program.dimensions import INERTIA, LENGTH, MASS, MOMENT, NUMBER, Dimension, dimension_of, times
from psdmc.program.signature import OF_ROWS, Quantity, Signature
from psdmc.robot.mechanism import Array, Loop, NamedFrame

Axes = Mapping[str, Sequence[Dimension]]
"""The dimensions that entries have along an axis, by its word."""

RATE = dimension_of("1/s")

TWIST = (*[LENGTH] * 3, *[NUMBER] * 3)
"""Of three linear axes and three angular ones."""

STANDARD = (MASS, *(MOMENT,) * 3, *(INERTIA,) * 7)
"""Of a link's standard parameters; the drive inertia of a sliding joint has another."""


def own_axes(
    frames: Sequence[Frame],
    named: Sequence[NamedFrame],
    theta_b: Sequence[Dimension],
    loops: Sequence[Loop] = (),
) -> Axes:
    """Return the physical dimensions of the entries along each kind of array axis (such as nq or nv), for a robot with
    these frames."""
    joints = [frame.joint for frame in leading(frames)]
    nq, nv = (
        [Dimension(0, order) for joint in joints for order in getattr(joint, orders)]
        for orders in ("q_orders", "v_orders")
    )
    contacts = [axis for each in named for axis in TWIST[: each.rows]]
    closed = [TWIST[row] for loop in loops for row in loop.rows]
    rates, accelerations = [times(each, RATE) for each in nv], [times(each, RATE, 2) for each in nv]
    return {
        "n": [NUMBER] * len(frames),
        "nq": nq,
        "nv": nv,
        "nx": [*nv, *rates],
        "nxa": [*nv, *rates, *accelerations],
        "nxu": [*nv, *rates, *(times(dimension_of("J"), each, -1) for each in nv)],
        "l": theta_b,
        "frames": [NUMBER] * len(named),
        "contacts": [NUMBER] * len([each for each in named if each.rows]),
        "constraints": [NUMBER] * (len([each for each in named if each.rows]) + len(loops)),
        **dict(zip(OF_ROWS, (contacts, closed, contacts + closed), strict=True)),
        "6": TWIST,
    }


def dimensions_of_traced(signature: Signature, axes: Axes) -> dict[str, list[Dimension]]:
    """Return the physical dimensions of all entries that a trace (recorded function) computes, by output.

    If an output is a matrix product, the trace computes its two factors. The right factor has a row per column of the
    output.
    """
    found = {quantity.name: quantity.dimensions(axes) for quantity in signature.stored}
    for product in signature.products:
        n = isqrt(len(found[product.output]))
        output, left = found[product.output][:n], found[product.left][:n]
        found[product.right] = [times(column, row, -1) for column in output for row in left]
    return found


def multiple(unit: float, dimension: Dimension) -> float:
    """Return the factor that converts a quantity of this dimension from SI to the units inside a trace, whose unit of
    length is `unit` m."""
    order = int(dimension.order)
    size = math.prod([unit] * abs(order))
    return size if order >= 0 else 1.0 / size


def are_scaled(quantities: Iterable[Quantity]) -> bool:
    """Return whether one of these quantities has another value in the units inside a trace than in SI, for robots
    without sliding joints."""
    return any(quantity.dimension.order or {"6", *OF_ROWS} & {*quantity.axes} for quantity in quantities)


def scaled_parameters(x: Array, unit: float) -> Array:
    """Return standard parameters in the units inside a trace, whose unit of length is `unit` m. There are 11 per link,
    along the first axis of x or the last."""
    if unit == 1.0:
        return x
    row = np.array([multiple(unit, each) for each in STANDARD])
    found: Array = x * row if x.shape[-1] == len(row) else x * np.tile(row, len(x) // len(row))[:, None]
    return found
