"""Inverse dynamics of a mechanism with closed loops: torques of the motors from a motion, without torques at passive
joints."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from psdmc.functions import loop_jacobian, passive_motion
from psdmc.program.signature import PIVOTS, QD, QDD, TAU, Q, Quantity, Signature
from psdmc.recipes.closed_loops import ACCELERATIONS_MEAN, PASSIVE, RATES_MEAN, ROW_WORDS, motion
from psdmc.recipes.on_arrays import columns
from psdmc.recipes.recipe import Arrays, Given, Ingredients, Needs, Outputs, Recipe, Reference, RobotOnArrays
from psdmc.recipes.torques_and_accelerations import torques

LOOP_FORCES = Quantity(
    "loop_forces",
    ("loop_rows",),
    means="forces (N) and moments (N m) that keep the closed loops closed, on each loop's second frame, "
    f"{ROW_WORDS.format('entry')}",
    unit="J",
    powers=(-1,),
)


def trace(g: Ingredients) -> Outputs:
    state = g.inputs["q"], g.inputs["qd"], g.inputs["qdd"]
    joints, rates, accelerations = motion(g.frames, g.loops, state, g.si, g.root)
    of_tree = torques(g, rates, accelerations, g.base_acceleration)
    forces = joints.forces(of_tree)
    return {"tau": joints.carried(of_tree, forces), "loop_forces": forces, PIVOTS: joints.signs}


def reference(robot: RobotOnArrays, given: Given) -> Arrays:
    count, state = len(given["q"]), (list(given["q"].T), list(given["qd"].T), list(given["qdd"].T))
    joints, rates, accelerations = motion(robot.frames, robot.chain.loops, state)
    qd, qdd = columns(rates, count), columns(accelerations, count)
    of_tree = list(robot.torques(given["q"], qd, qdd, robot.base_acceleration).T)
    forces = joints.forces(of_tree)
    found = {"tau": joints.carried(of_tree, forces), "loop_forces": forces, PIVOTS: joints.signs}
    return {name: columns(values, count) for name, values in found.items()}


def pinocchio(robot: Reference, given: Given) -> Arrays:
    """Solve the full linear system for the torques of the other joints and the loops' forces."""
    jacobian = loop_jacobian.RECIPE.pinocchio(robot, given)["J"]
    own = passive_motion.RECIPE.pinocchio(robot, given)
    of_tree = robot.inverse_dynamics(given["q"], own["qd_closed"], own["qdd_closed"])
    nv = of_tree.shape[1]
    chosen = np.delete(np.eye(nv), list(robot.passive), axis=1)
    whole = np.concatenate(
        [np.broadcast_to(chosen, (len(of_tree), *chosen.shape)), np.swapaxes(jacobian, 1, 2)], axis=2
    )
    found = np.linalg.solve(whole, of_tree[..., None])[..., 0]
    cut = chosen.shape[1]
    return {"tau": found[:, :cut] @ chosen.T, "loop_forces": found[:, cut:]}


RECIPE = Recipe(
    Signature(
        "loop_inverse_dynamics",
        462,
        "joint torques of a motion of a mechanism with closed loops, 0 at passive joints: "
        "M qdd + h = tau + J^T loop_forces, with the rates and accelerations of passive_motion",
        (Q, replace(QD, means=RATES_MEAN), replace(QDD, means=ACCELERATIONS_MEAN)),
        (replace(TAU, means=f"{TAU.means}; 0 for passive joints"), LOOP_FORCES),
        theta=True,
        summary="Compute the joint torques with which a mechanism with closed loops moves as its motors do. Also compute "
        "the forces of the loops. Passive joints have no torque.",
        factorises=(PASSIVE,),
    ),
    "inverse dynamics with closed loops",
    trace,
    reference,
    "rnea, getFrameJacobian, getFrameClassicalAcceleration",
    pinocchio,
    shares="inverse_dynamics",
    needs=Needs.PASSIVE,
    closes=True,
)
