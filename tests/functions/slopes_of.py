"""Derivatives of a function against complex steps of that function's own PROGRAM, which knows nothing of derivatives."""

from __future__ import annotations

import numpy as np
from complex_step import slopes_along
from lowered import lowered
from wide_robots import WideRobot, wide_robot

from psdmc.functions import RECIPES

Array = np.ndarray


def are_slopes(derivatives: str, function: str, name: str, exact: float = 1e-10) -> None:
    """Every output of `derivatives` that is called d(output)_d(input), relative to its largest entry. The other inputs are
    those without derivatives."""
    own = wide_robot(name)
    found = RECIPES[derivatives].reference(own.arrays, own.given)
    signature = RECIPES[function].signature
    program = lowered(own.model, functions=[function])[function].single
    point = {each.name: own.given[each.name].reshape(len(own.given["q"]), -1) for each in signature.inputs}
    compared = 0
    pairs = [(output, by) for by in signature.inputs for output in signature.outputs]
    for by in dict.fromkeys(by for output, by in pairs if f"d{output.name}_d{by.name}" in found):
        way = _tangents(own) if by.name == "q" else np.eye(point[by.name].shape[1])[None]
        for output in signature.outputs:
            if f"d{output.name}_d{by.name}" not in found:
                continue
            slopes = slopes_along(program, point, {by.name: way}, output.name, own.sizes.size(output))[1]
            values = found[f"d{output.name}_d{by.name}"]
            error = np.abs(slopes.reshape(values.shape) - values).max()
            assert error <= exact * np.abs(values).max(), (output.name, by.name, error)
            compared += 1
    assert compared == len([each for each in RECIPES[derivatives].signature.outputs if "_d" in each.name])


def _tangents(own: WideRobot) -> Array:
    """(k, nq, nv) how the coordinates move at unit rates."""
    units = np.eye(own.model.nv)
    return np.stack([own.pinocchio.coordinate_rates(own.given["q"], unit) for unit in units], axis=-1)
