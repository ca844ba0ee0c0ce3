"""The algorithms against Pinocchio on trees whose joints have several coordinates: free, spherical, planar, translating."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from random_trees import COUNT, TREES, RandomTree, assert_near, columns, on_trees
from test_derivatives import assert_blocks_near, found_in, pinocchios

from psdmc.dynamics.choices import Choices
from psdmc.dynamics.composite_body import mass_matrix
from psdmc.dynamics.coordinates import neutral
from psdmc.dynamics.kinematics import forward_kinematics, frame_drifts, jacobian
from psdmc.dynamics.momentum_and_energy import first_moment, kinetic_energy, potential_energy, total_momentum
from psdmc.dynamics.newton_euler import inverse_dynamics
from psdmc.dynamics.regressor import regressor
from psdmc.robot.mechanism import PARAMETERS_PER_LINK, NamedFrame, Placement

KINDS = ("FRRRRRRR", "FSLTRPRS", "SRFRPLTR", "RPLSRFHR", "TLRRSRRF")

trees = on_trees(KINDS)


def lists(*states: np.ndarray) -> tuple[list, ...]:
    return tuple(list(state.T) for state in states)


@trees
def test_torques_are_pinocchios_however_they_are_arranged(parents, kinds, parallel) -> None:
    tree = RandomTree(1, parents, kinds, parallel)
    states = tree.motion(COUNT)
    expected = tree.each(pin.rnea, *states)
    for choices in tree.choices:
        found = inverse_dynamics(tree.frames, tree.bodies, tree.drives, *lists(*states), tree.up, choices)
        assert_near(columns(found), expected)


@trees
def test_the_mass_matrix_is_pinocchios(parents, kinds, parallel) -> None:
    tree = RandomTree(2, parents, kinds, parallel)
    q, _, _ = tree.motion(COUNT)

    def symmetric(model, data, row):
        half = np.triu(pin.crba(model, data, row))
        return (half + np.triu(half, 1).T)[tree.order]

    expected = tree.each(symmetric, q)
    for choices in (Choices(), Choices(fold_double_angle=True)):
        rows = mass_matrix(tree.frames, tree.bodies, tree.drives, list(q.T), choices)
        assert_near(np.stack([columns(row) for row in rows], axis=1), expected)


@trees
def test_the_reference_rates_give_a_skew_symmetric_coriolis_matrix(parents, kinds, parallel) -> None:
    """C v are the velocity torques and dM/dt - 2 C is skew, though v is no derivative of coordinates."""
    tree = RandomTree(4, parents, kinds, parallel)
    q, qd, _ = tree.motion(COUNT)
    still, nowhere = [0.0] * tree.nv, (0.0, 0.0, 0.0)
    bodies, drives = tree.bodies, tree.drives
    for choices in (Choices(), Choices(compound=True, fold=True)):
        by_unit = [
            columns(
                inverse_dynamics(
                    tree.frames, bodies, drives, list(q.T), list(qd.T), still, nowhere, choices, unit
                )
            )
            for unit in np.eye(tree.nv).tolist()
        ]
        matrix = np.stack(by_unit, axis=-1)
        torques = inverse_dynamics(tree.frames, bodies, drives, list(q.T), list(qd.T), still, nowhere)
        np.testing.assert_allclose(np.einsum("sij,sj->si", matrix, qd), columns(torques), atol=1e-11)
        step = 1e-6
        theirs = [(tree.theirs_at(row), tree.theirs(rate)) for row, rate in zip(q, qd, strict=True)]
        moved = {
            h: np.array([pin.integrate(tree.model, row, h * rate)[tree.order_q] for row, rate in theirs])
            for h in (step, -step)
        }
        ahead, behind = (
            np.stack([columns(r) for r in mass_matrix(tree.frames, bodies, drives, list(moved[h].T))], axis=1)
            for h in (step, -step)
        )
        skew = (ahead - behind) / (2 * step) - 2 * matrix
        np.testing.assert_allclose(skew, -skew.transpose(0, 2, 1), atol=1e-6)


@trees
def test_the_regressor_gives_pinocchios_torques(parents, kinds, parallel) -> None:
    tree = RandomTree(5, parents, kinds, parallel)
    states = tree.motion(COUNT)
    here = [Placement.identity()] * tree.n
    wanted = range(PARAMETERS_PER_LINK * tree.n)
    rows = regressor(tree.frames, here, wanted, *lists(*states), tree.up)
    x = np.column_stack([tree.parameters, tree.drives]).ravel()
    found = columns([sum(entry * x[p] for p, entry in row.items()) for row in rows])
    assert_near(found, tree.each(pin.rnea, *states))


@trees
def test_placements_jacobians_and_drifts_of_every_body(parents, kinds, parallel) -> None:
    tree = RandomTree(7, parents, kinds, parallel)
    (q,), (qd,), _ = tree.motion(1)
    place = Placement(RandomTree(8, (-1,), "R").places[0].rotation, np.array([0.1, -0.2, 0.3]))
    fixed = pin.SE3(place.rotation.copy(), place.translation.copy())
    model = tree.model.copy()
    for i, joint in enumerate(tree.joints):
        model.addFrame(pin.Frame(f"at{i}", joint, 0, fixed, pin.FrameType.OP_FRAME))
    data, theirs, rates = model.createData(), tree.theirs_at(q), tree.theirs(qd)
    pin.forwardKinematics(model, data, theirs, rates, np.zeros(model.nv))
    pin.updateFramePlacements(model, data)
    named = [NamedFrame(f"at{i}", i, place) for i in range(tree.n)]
    drifts = frame_drifts(tree.frames, named, q, qd)
    for i, joint in enumerate(tree.joints):
        rotation, origin = forward_kinematics(tree.frames, q)[i]
        np.testing.assert_allclose(np.array(rotation), data.oMi[joint].rotation, atol=1e-14)
        np.testing.assert_allclose(origin, data.oMi[joint].translation, atol=1e-13)
        frame = model.getFrameId(f"at{i}")
        drift = pin.getFrameClassicalAcceleration(model, data, frame, pin.LOCAL_WORLD_ALIGNED)
        np.testing.assert_allclose(drifts[i], drift.vector, atol=1e-11)
        expected = pin.computeFrameJacobian(model, data, theirs, frame, pin.LOCAL_WORLD_ALIGNED)
        found = np.array(jacobian(tree.frames, i, place, q), float)
        np.testing.assert_allclose(found, expected.reshape(6, -1)[:, tree.order], atol=1e-13)


@trees
def test_energies_and_momentum_are_pinocchios(parents, kinds, parallel) -> None:
    tree = RandomTree(9, parents, kinds, parallel)
    (q,), (qd,), _ = tree.motion(1)
    theirs, rates = tree.theirs_at(q), tree.theirs(qd)
    at_rest = tree.theirs_at(np.array(neutral(tree.frames)))
    potential = pin.computePotentialEnergy(tree.model, tree.data, theirs)
    potential -= pin.computePotentialEnergy(tree.model, tree.data, at_rest)
    assert potential_energy(tree.frames, tree.bodies, q, tree.up) == pytest.approx(
        potential, rel=1e-11, abs=1e-11
    )
    kinetic = pin.computeKineticEnergy(tree.model, tree.data, theirs, rates)
    assert kinetic_energy(tree.frames, tree.bodies, tree.drives, q, qd) == pytest.approx(kinetic, rel=1e-12)
    momentum = pin.computeCentroidalMomentum(tree.model, tree.data, theirs, rates)
    mass, centre = tree.parameters[:, 0].sum(), np.array(tree.data.com[0])
    linear, angular = total_momentum(tree.frames, tree.bodies, q, qd)
    np.testing.assert_allclose(linear, momentum.linear, atol=1e-11)
    about_origin = momentum.angular + np.cross(centre, momentum.linear)
    np.testing.assert_allclose(angular, about_origin, atol=1e-11)
    np.testing.assert_allclose(first_moment(tree.frames, tree.bodies, q), mass * centre, atol=1e-11)


@trees
def test_derivatives_are_pinocchios_in_the_tangent_space(parents, kinds, parallel) -> None:
    tree = RandomTree(12, parents, kinds, parallel)
    states = tree.motion(COUNT)
    expected = pinocchios(tree, states)
    for choices in tree.choices:
        assert_blocks_near(found_in(tree, states, choices), expected)


def test_vectors_of_another_length_are_refused() -> None:
    tree = RandomTree(1, TREES["a fork"], "FRR")
    with pytest.raises(ValueError, match="8 values for joints that have 9"):
        mass_matrix(tree.frames, tree.bodies, tree.drives, [0.0] * 8)
