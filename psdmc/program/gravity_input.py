"""Gravity as an input: the signatures and the function bodies of a package generated with the option gravity-input."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace
from functools import cache

from psdmc.program.regions import Call, For, Region, Regions
from psdmc.program.signature import Quantity, Signature

GRAVITY = Quantity(
    "gravity",
    ("3",),
    9.81,
    "acceleration of gravity, m/s^2, along the axes of the robot's base frame",
    "m/s^2",
)


@cache
def takes_gravity(function: Signature) -> Signature:
    """Return the signature with gravity as its last input if the function depends on gravity, else the signature."""
    if not function.depends_on_gravity:
        return function
    return replace(function, inputs=(*function.inputs, GRAVITY))


def pass_gravity_on(body: Regions, functions: Collection[str], is_input: bool) -> Regions:
    """Return the function body with gravity as a further argument of its calls of these functions. If gravity is no
    input of the calling function, it is zero."""

    def passed(region: Region) -> Region:
        if isinstance(region, For):
            return replace(region, regions=tuple(map(passed, region.regions)))
        if isinstance(region, Call) and region.function in functions:
            return replace(region, given=(*region.given, (GRAVITY.name, 0)))
        return region

    zero = {} if is_input or not functions else {GRAVITY.name: (0.0, 0.0, 0.0)}
    return replace(body, regions=tuple(map(passed, body.regions)), constants={**body.constants, **zero})
