"""Derivatives under wrenches, of frames and of the centroidal momentum on random trees of all joint types against
Pinocchio."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
from random_trees import COUNT, RandomTree, on_trees
from test_derivatives import KINDS, assert_blocks_near
from test_wide_joints_in_trees import KINDS as WIDE

from psdmc.dynamics.derivatives import inverse_dynamics_derivatives
from psdmc.dynamics.kinematics import frame_acceleration_slopes, frame_accelerations, local_jacobians
from psdmc.dynamics.momentum_and_energy import momentum_rate_slopes
from psdmc.functions import RECIPES
from psdmc.recipes.on_arrays import entries
from psdmc.robot.mechanism import NamedFrame, Placement
from psdmc.robot.reference import Reference, torque_derivatives

trees = on_trees((*KINDS, *WIDE))


def lists(states) -> list[list]:
    return [list(values.T) for values in states]


@trees
def test_derivatives_under_wrenches_on_every_body_are_pinocchios(parents, kinds, parallel) -> None:
    tree = RandomTree(21, parents, kinds, parallel)
    states = tree.motion(COUNT)
    wrenches = np.random.default_rng(5).uniform(-20.0, 20.0, (COUNT, tree.n, 6))

    def loaded(model, data, *state):
        forces = [pin.Force.Zero() for _ in range(model.njoints)]
        for joint, wrench in zip(tree.joints, wrenches[loaded.state], strict=True):
            forces[joint] = pin.Force(wrench)
        loaded.state += 1
        return torque_derivatives(model, data, *state, forces)[:, tree.order]

    loaded.state = 0
    expected = list(np.moveaxis(tree.each(loaded, *states), 1, 0))
    external = {i: (tuple(wrenches[:, i, :3].T), tuple(wrenches[:, i, 3:].T)) for i in range(tree.n)}
    for choices in tree.choices:
        found = inverse_dynamics_derivatives(
            tree.frames, tree.bodies, tree.drives, *lists(states), tree.up, choices, external
        )
        assert_blocks_near([entries(block, COUNT) for block in found[:3]], expected)


@trees
def test_derivatives_of_frames_on_every_body_are_pinocchios(parents, kinds, parallel) -> None:
    tree = RandomTree(22, parents, kinds, parallel)
    states = tree.motion(COUNT)
    place = Placement(RandomTree(8, (-1,), "R").places[0].rotation, np.array([0.1, -0.2, 0.3]))
    model, names = tree.model.copy(), tuple(f"at{i}" for i in range(tree.n))
    for name, joint in zip(names, tree.joints, strict=True):
        fixed = pin.SE3(place.rotation.copy(), place.translation.copy())
        model.addFrame(pin.Frame(name, joint, 0, fixed, pin.FrameType.OP_FRAME))
    named = [NamedFrame(name, i, place) for i, name in enumerate(names)]
    theirs = _expected(Reference(model, names[0], names), tree, states)
    q, qd, qdd = lists(states)
    (acceleration,) = theirs("frame_acceleration")
    found = entries(frame_accelerations(tree.frames, named, q, qd, qdd), COUNT)
    assert_blocks_near([found], [acceleration])
    slopes = frame_acceleration_slopes(tree.frames, named, q, qd, qdd)
    expected = theirs("frame_acceleration_derivatives")
    assert_blocks_near(
        [entries(block, COUNT) for block in slopes], [block[..., tree.order] for block in expected]
    )
    (jacobian,) = theirs("frame_jacobian_local")
    assert_blocks_near([entries(local_jacobians(tree.frames, named, q), COUNT)], [jacobian[..., tree.order]])


@trees
def test_derivatives_of_the_centroidal_momentum_and_its_rate_are_pinocchios(parents, kinds, parallel) -> None:
    tree = RandomTree(23, parents, kinds, parallel)
    states = tree.motion(COUNT)
    theirs, (q, qd, qdd) = _expected(Reference(tree.model, "tip"), tree, states), lists(states)
    found = momentum_rate_slopes(tree.frames, tree.bodies, q, qd, qdd)
    at_rest = momentum_rate_slopes(tree.frames, tree.bodies, q, [0.0] * len(qd), qd)
    of_rate = theirs("centroidal_momentum_rate_derivatives")
    of_momentum = theirs("centroidal_momentum_derivatives")
    for own, expected in ((found, of_rate), ((at_rest.by_q, at_rest.by_qdd), of_momentum)):
        assert_blocks_near(
            [entries(block, COUNT) for block in own], [block[..., tree.order] for block in expected]
        )


def _expected(robot: Reference, tree: RandomTree, states):
    """The values of a recipe's function of Pinocchio's, at our states in its order."""
    q, *rates = states
    given = {"q": np.array([tree.theirs_at(row) for row in q])}
    given |= {
        name: np.array([tree.theirs(row) for row in values])
        for name, values in zip(("qd", "qdd"), rates, strict=True)
    }
    return lambda function: list(RECIPES[function].pinocchio(robot, given).values())
