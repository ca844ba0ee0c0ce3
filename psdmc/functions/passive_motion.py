"""Rates and accelerations of all joints of a mechanism with closed loops, from those of the joints with motors."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from psdmc.functions import loop_drift, loop_jacobian
from psdmc.program.signature import PIVOTS, QD, QDD, Q, Signature
from psdmc.recipes.closed_loops import ACCELERATIONS_MEAN, PASSIVE, RATES_MEAN, motion
from psdmc.recipes.on_arrays import columns
from psdmc.recipes.recipe import Arrays, Given, Ingredients, Needs, Outputs, Recipe, Reference, RobotOnArrays
from psdmc.robot.mechanism import Array

CLOSED_QD = replace(
    QD, name="qd_closed", means="rates of all joints that keep the loops closed, rad/s or m/s"
)
CLOSED_QDD = replace(
    QDD, name="qdd_closed", means="accelerations of all joints that keep the loops closed, rad/s^2 or m/s^2"
)


def trace(g: Ingredients) -> Outputs:
    state = g.inputs["q"], g.inputs["qd"], g.inputs["qdd"]
    joints, rates, accelerations = motion(g.frames, g.loops, state, g.si, g.root)
    return {"qd_closed": rates, "qdd_closed": accelerations, PIVOTS: joints.signs}


def reference(robot: RobotOnArrays, given: Given) -> Arrays:
    state = list(given["q"].T), list(given["qd"].T), list(given["qdd"].T)
    joints, *found = motion(robot.frames, robot.chain.loops, state)
    names = ("qd_closed", "qdd_closed", PIVOTS)
    return {
        name: columns(values, len(given["q"]))
        for name, values in zip(names, (*found, joints.signs), strict=True)
    }


def pinocchio(robot: Reference, given: Given) -> Arrays:
    jacobian = loop_jacobian.RECIPE.pinocchio(robot, given)["J"]
    rates = completed(robot, jacobian, given["qd"], np.zeros(jacobian.shape[:2]))
    drift = loop_drift.RECIPE.pinocchio(robot, {**given, "qd": rates})["drift"]
    return {"qd_closed": rates, "qdd_closed": completed(robot, jacobian, given["qdd"], drift)}


def completed(robot: Reference, jacobian: Array, rates: Array, bias: Array) -> Array:
    """Return the rates (k, nv) with the passive entries that satisfy J x + bias = 0, by a dense solver."""
    passive, found = list(robot.passive), rates.copy()
    found[:, passive] = 0.0
    right = -(jacobian @ found[..., None]) - bias[..., None]
    found[:, passive] = np.linalg.solve(jacobian[..., passive], right)[..., 0]
    return found


RECIPE = Recipe(
    Signature(
        "passive_motion",
        460,
        "rates and accelerations of all joints that keep the closed loops closed, from those of the joints that are not "
        "passive: J qd_closed = 0 and J qdd_closed + dJ/dt qd_closed = 0",
        (Q, replace(QD, means=RATES_MEAN), replace(QDD, means=ACCELERATIONS_MEAN)),
        (CLOSED_QD, CLOSED_QDD),
        theta=False,
        summary="Compute rates and accelerations of all joints of a mechanism with closed loops from those of the joints "
        "with motors.",
        factorises=(PASSIVE,),
    ),
    "motion of passive joints",
    trace,
    reference,
    "getFrameJacobian, getFrameClassicalAcceleration",
    pinocchio,
    needs=Needs.PASSIVE,
)
