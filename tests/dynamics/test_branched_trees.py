"""The algorithms on small trees against Pinocchio: they walk parents, and no joint's number says what it hangs on."""

from __future__ import annotations

from itertools import product

import numpy as np
import pinocchio as pin
import pytest
from random_trees import COUNT, KINDS, TREES, RandomTree, assert_near, columns, on_trees

from psdmc.dynamics.choices import Choices
from psdmc.dynamics.composite_body import mass_matrix
from psdmc.dynamics.kinematics import (
    carried_by,
    forward_kinematics,
    frame_drifts,
    frame_placement,
    jacobian,
    path_to,
)
from psdmc.dynamics.momentum_and_energy import first_moment, kinetic_energy, potential_energy, total_momentum
from psdmc.dynamics.newton_euler import inverse_dynamics
from psdmc.dynamics.regressor import regressor
from psdmc.robot.mechanism import PARAMETERS_PER_LINK, NamedFrame, Placement

trees = on_trees(KINDS)


@trees
def test_inverse_dynamics_is_pinocchios_rnea_however_it_is_arranged(parents, kinds, parallel) -> None:
    tree = RandomTree(1, parents, kinds, parallel)
    q, qd, qdd = tree.states(COUNT, 3)
    expected = tree.each(pin.rnea, q, qd, qdd)
    for choices in tree.choices:
        states = (list(q.T), list(qd.T), list(qdd.T))
        found = inverse_dynamics(tree.frames, tree.bodies, tree.drives, *states, tree.up, choices)
        assert_near(columns(found), expected)


@trees
def test_the_mass_matrix_is_pinocchios_crba(parents, kinds, parallel) -> None:
    tree = RandomTree(2, parents, kinds, parallel)
    (q,) = tree.states(COUNT, 1)

    def upper(model, data, row):
        half = np.triu(pin.crba(model, data, row))
        return (half + np.triu(half, 1).T)[tree.order]

    expected = tree.each(upper, q)
    for choices in (Choices(), Choices(fold_double_angle=True)):
        rows = mass_matrix(tree.frames, tree.bodies, tree.drives, list(q.T), choices)
        found = np.stack([columns(row) for row in rows], axis=1)
        assert_near(found, expected)


def test_joints_on_different_branches_have_an_exact_zero_in_the_mass_matrix() -> None:
    tree = RandomTree(3, TREES["a trunk with two arms"], "RRRRRR")
    rows = mass_matrix(tree.frames, tree.bodies, tree.drives, [0.3] * 6)
    for i, j in product((2, 3), (4, 5)):
        assert rows[i][j] == rows[j][i] == 0.0
        assert isinstance(rows[i][j], float)


@trees
def test_the_reference_rate_gives_a_skew_symmetric_coriolis_matrix(parents, kinds, parallel) -> None:
    """Column j is the torque of joint j's unit reference rate: C qd are the velocity torques, dM/dt - 2 C is skew."""
    tree = RandomTree(4, parents, kinds, parallel)
    q, qd = tree.states(COUNT, 2)
    still = [0.0] * tree.n
    for choices in (Choices(), Choices(compound=True, fold=True)):
        matrix = np.stack(
            [
                columns(
                    inverse_dynamics(
                        tree.frames, tree.bodies, tree.drives, list(q.T), list(qd.T), still,
                        (0.0, 0.0, 0.0), choices, [float(i == j) for i in range(tree.n)],
                    )
                )
                for j in range(tree.n)
            ],
            axis=-1,
        )  # fmt: skip
        torques = inverse_dynamics(
            tree.frames, tree.bodies, tree.drives, list(q.T), list(qd.T), still, (0.0, 0.0, 0.0)
        )
        np.testing.assert_allclose(np.einsum("sij,sj->si", matrix, qd), columns(torques), atol=1e-11)
        step = 1e-6
        ahead, behind = (
            np.stack(
                [
                    columns(row)
                    for row in mass_matrix(tree.frames, tree.bodies, tree.drives, list((q + h * qd).T))
                ],
                axis=1,
            )
            for h in (step, -step)
        )
        skew = (ahead - behind) / (2 * step) - 2 * matrix
        np.testing.assert_allclose(skew, -skew.transpose(0, 2, 1), atol=1e-7)


@trees
def test_the_regressor_gives_the_torques_and_pinocchios_rows(parents, kinds, parallel) -> None:
    tree = RandomTree(5, parents, kinds, parallel)
    q, qd, qdd = tree.states(COUNT, 3)
    wanted = range(PARAMETERS_PER_LINK * tree.n)
    here = [Placement.identity()] * tree.n
    rows = regressor(tree.frames, here, wanted, list(q.T), list(qd.T), list(qdd.T), tree.up)
    x = np.column_stack([tree.parameters, tree.drives]).ravel()
    found = np.stack([sum(entry * x[p] for p, entry in row.items()) for row in rows], axis=1)
    assert_near(found, tree.each(pin.rnea, q, qd, qdd))
    # A body's parameters act on the joints that carry it, and on no others.
    for k in range(tree.n):
        acting = [i for i, row in enumerate(rows) if PARAMETERS_PER_LINK * k in row]
        assert acting == list(path_to(tree.frames, k))


@trees
def test_two_velocities_that_are_equal_give_what_one_gives(parents, kinds, parallel) -> None:
    """Whether there is one velocity is what the caller says, not whether two arguments are one object."""
    tree = RandomTree(6, parents, kinds, parallel)
    q, qd, qdd = tree.states(COUNT, 3)
    states = (list(q.T), list(qd.T), list(qdd.T))
    one = inverse_dynamics(tree.frames, tree.bodies, tree.drives, *states, tree.up)
    for choices in tree.choices:
        same = inverse_dynamics(
            tree.frames, tree.bodies, tree.drives, *states, tree.up, choices, qd_r=states[1]
        )
        assert_near(columns(same), columns(one))


@trees
def test_placements_and_jacobians_of_every_body(parents, kinds, parallel) -> None:
    tree = RandomTree(7, parents, kinds, parallel)
    (q,) = tree.states(1, 1)
    place = Placement(RandomTree(8, (-1,), "R").places[0].rotation, np.array([0.1, -0.2, 0.3]))
    fixed = pin.SE3(place.rotation.copy(), place.translation.copy())
    model = tree.model.copy()
    for i, joint in enumerate(tree.joints):
        model.addFrame(pin.Frame(f"at{i}", joint, 0, fixed, pin.FrameType.OP_FRAME))
    data = model.createData()
    pin.framesForwardKinematics(model, data, tree.theirs(q[0]))
    placed = forward_kinematics(tree.frames, q[0])
    for i, joint in enumerate(tree.joints):
        np.testing.assert_allclose(np.array(placed[i][0]), data.oMi[joint].rotation, atol=1e-14)
        frame = model.getFrameId(f"at{i}")
        rotation, origin = frame_placement(tree.frames, i, place, q[0])
        np.testing.assert_allclose(np.array(rotation), data.oMf[frame].rotation, atol=1e-14)
        np.testing.assert_allclose(origin, data.oMf[frame].translation, atol=1e-13)
        expected = pin.computeFrameJacobian(
            model, data, tree.theirs(q[0]), frame, pin.LOCAL_WORLD_ALIGNED
        ).reshape(6, -1)[:, tree.order]
        found = np.array(jacobian(tree.frames, i, place, q[0]), float)
        np.testing.assert_allclose(found, expected, atol=1e-13)


@trees
def test_energies_are_pinocchios(parents, kinds, parallel) -> None:
    tree = RandomTree(9, parents, kinds, parallel)
    q, qd = tree.states(COUNT, 2)
    at_zero = pin.computePotentialEnergy(tree.model, tree.data, tree.theirs(np.zeros(tree.n)))
    for row, rate in zip(q, qd, strict=True):
        states = tree.theirs(row), tree.theirs(rate)
        kinetic = pin.computeKineticEnergy(tree.model, tree.data, *states)
        potential = pin.computePotentialEnergy(tree.model, tree.data, states[0]) - at_zero
        found = kinetic_energy(tree.frames, tree.bodies, tree.drives, row.tolist(), rate.tolist())
        assert found == pytest.approx(kinetic, rel=1e-12)
        assert potential_energy(tree.frames, tree.bodies, row.tolist(), tree.up) == pytest.approx(
            potential, rel=1e-11, abs=1e-11
        )


@trees
def test_momentum_and_first_moment_are_pinocchios(parents, kinds, parallel) -> None:
    tree = RandomTree(10, parents, kinds, parallel)
    q, qd = tree.states(1, 2)[:, 0]
    momentum = pin.computeCentroidalMomentum(tree.model, tree.data, tree.theirs(q), tree.theirs(qd))
    mass, centre = tree.parameters[:, 0].sum(), np.array(tree.data.com[0])
    linear, angular = total_momentum(tree.frames, tree.bodies, q, qd)
    np.testing.assert_allclose(linear, momentum.linear, atol=1e-12)
    about_origin = momentum.angular + np.cross(centre, momentum.linear)
    np.testing.assert_allclose(angular, about_origin, atol=1e-12)
    np.testing.assert_allclose(first_moment(tree.frames, tree.bodies, q), mass * centre, atol=1e-12)


@trees
def test_drifts_of_frames_on_every_body_are_pinocchios(parents, kinds, parallel) -> None:
    tree = RandomTree(11, parents, kinds, parallel)
    q, qd = tree.states(1, 2)[:, 0]
    place = Placement(RandomTree(8, (-1,), "R").places[0].rotation, np.array([0.1, -0.2, 0.3]))
    fixed = pin.SE3(place.rotation.copy(), place.translation.copy())
    model = tree.model.copy()
    for i, joint in enumerate(tree.joints):
        model.addFrame(pin.Frame(f"at{i}", joint, 0, fixed, pin.FrameType.OP_FRAME))
    data, still = model.createData(), np.zeros(tree.n)
    pin.forwardKinematics(model, data, tree.theirs(q), tree.theirs(qd), still)
    named = [NamedFrame(f"at{i}", i, place) for i in range(tree.n)]
    for i, found in enumerate(frame_drifts(tree.frames, named, q, qd)):
        expected = pin.getFrameClassicalAcceleration(
            model, data, model.getFrameId(f"at{i}"), pin.LOCAL_WORLD_ALIGNED
        )
        np.testing.assert_allclose(found, expected.vector, atol=1e-11)


def test_what_each_joint_carries() -> None:
    tree = RandomTree(0, TREES["a trunk with two arms"], "RRRRRR")
    assert carried_by(tree.frames) == ((1, 2, 3, 4, 5), (2, 3, 4, 5), (3,), (), (5,), ())
    assert path_to(tree.frames, 5) == (0, 1, 4, 5)
