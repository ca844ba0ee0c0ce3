"""Joints that follow others, against Pinocchio's mimic joints; and joints that are held."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from mimic_trees import as_urdf
from random_trees import TREES, RandomTree

from psdmc.derivation.derive import derive_model
from psdmc.dynamics.composite_body import mass_matrix
from psdmc.dynamics.coordinates import on_coordinates
from psdmc.dynamics.frames import Mimic
from psdmc.dynamics.newton_euler import inverse_dynamics
from psdmc.errors import InputError
from psdmc.robot.coordinates import Coordinate, MimicMap, leaders
from psdmc.robot.mechanism import Placement

FINGERS = (Coordinate(0), Coordinate(1), Coordinate(1, -0.7, 0.2), Coordinate(3), Coordinate(1, 1.3, -0.4))
"""Five joints, three coordinates: two fingers follow a third."""

PARENTS = (-1, 0, 0, 1, 2)


@pytest.mark.parametrize("kinds", ["RRRRR", "RPPRP", "PRRPR"])
def test_mimic_joints_are_pinocchios(kinds: str) -> None:
    tree = RandomTree(21, PARENTS, kinds)
    model = pin.buildModelFromXML(as_urdf(tree, FINGERS), mimic=True)
    model.gravity.linear = tree.gravity.copy()
    data = model.createData()
    assert (model.nq, model.nv) == (3, 3)
    order = [model.joints[model.getJointId(f"joint{i}")].idx_v for i in leaders(FINGERS)]
    still = [0.0] * tree.n
    mimic_map = MimicMap.of(FINGERS, tree.mechanism().types)
    for q, qd, qdd in np.random.default_rng(0).uniform(-2.0, 2.0, (20, 3, 3)):
        states = (mimic_map.positions(q), mimic_map.rates(qd), mimic_map.rates(qdd))
        theirs = np.zeros((3, 3))
        theirs[:, order] = q, qd, qdd
        tau = inverse_dynamics(tree.frames, tree.bodies, still, *states, tree.up)
        expected = pin.rnea(model, data, *theirs)[order]
        np.testing.assert_allclose(mimic_map.summed(np.array(tau)), expected, rtol=1e-11)
        of_joints = mass_matrix(tree.frames, tree.bodies, still, states[0])
        M = mimic_map.summed(mimic_map.summed(np.array(of_joints)), axis=0)
        upper = np.triu(pin.crba(model, data, theirs[0]))
        whole = upper + np.triu(upper, 1).T
        np.testing.assert_allclose(M, whole[np.ix_(order, order)], rtol=1e-11, atol=1e-12)


def test_held_joints_stand_still() -> None:
    tree = RandomTree(22, TREES["a trunk with two arms"], "RRPRRP")
    held = {2: 0.3, 4: -0.8}
    coordinates = tuple(
        Coordinate(None, offset=held[i]) if i in held else Coordinate(i) for i in range(tree.n)
    )
    free = list(leaders(coordinates))
    assert free == [0, 1, 3, 5]
    q, qd, qdd = np.random.default_rng(1).uniform(-2.0, 2.0, (3, len(free)))
    mimic_map = MimicMap.of(coordinates, tree.mechanism().types)
    states = (mimic_map.positions(q), mimic_map.rates(qd), mimic_map.rates(qdd))
    tau = inverse_dynamics(tree.frames, tree.bodies, tree.drives, *states, tree.up)
    whole = np.array([[held.get(i, 0.0) for i in range(tree.n)], np.zeros(tree.n), np.zeros(tree.n)])
    whole[:, free] = q, qd, qdd
    (expected,) = tree.each(pin.rnea, *whole[:, None])
    np.testing.assert_allclose(mimic_map.summed(np.array(tau)), expected[free], rtol=1e-11)


@pytest.mark.parametrize("kinds", ["RRRRR", "RPPRP", "PRRPR"])
def test_models_with_mimic_joints_are_pinocchios(kinds: str) -> None:
    """Ratios between angles and lengths too; in a chain of metres, whose unit is not one."""
    tree = RandomTree(21, PARENTS, kinds)
    tree.places = [Placement(place.rotation, 8.0 * place.translation) for place in tree.places]
    robot = replace(tree.mechanism(), coordinates=FINGERS)
    robot = replace(robot, parameters=robot.parameters * ([1.0] * 10 + [0.0]))
    oracle = pin.buildModelFromXML(as_urdf(tree, FINGERS), mimic=True)
    oracle.gravity.linear = tree.gravity.copy()
    model, data = derive_model(robot), oracle.createData()
    q, qd, qdd = np.random.default_rng(3).uniform(-2.0, 2.0, (3, 20, 3))
    tau = np.array([pin.rnea(oracle, data, *state) for state in zip(q, qd, qdd, strict=True)])
    np.testing.assert_allclose(
        model.inverse_dynamics(q, qd, qdd), tau, rtol=0, atol=1e-12 * np.abs(tau).max()
    )
    rows = model.regressor(q, qd, qdd) @ model.theta_b
    np.testing.assert_allclose(rows, tau, rtol=0, atol=1e-12 * np.abs(tau).max())
    assert model.certificate.shape == (3,)
    assert model.l < derive_model(replace(robot, coordinates=())).l


def test_a_joint_that_is_held_is_for_readers_to_merge() -> None:
    chain = RandomTree(23, (-1, 0, 1), "RRR").mechanism()
    with pytest.raises(InputError, match=r"joint 'joint1' is held at 0\.5"):
        derive_model(replace(chain, coordinates=(Coordinate(0), Coordinate(None, offset=0.5), Coordinate(2))))


@pytest.mark.parametrize(
    ("coordinates", "message"),
    [
        ((Coordinate(0),), "1 coordinates for 3 joints"),
        ((Coordinate(1), Coordinate(0), Coordinate(2)), "joint 0 follows joint 1, which has no coordinate"),
        ((Coordinate(0), Coordinate(0), Coordinate(1)), "joint 2 follows joint 1, which has no coordinate"),
        ((Coordinate(0), Coordinate(7), Coordinate(2)), "joint 1 follows joint 7"),
    ],
)
def test_rings_and_mimics_of_mimics_are_no_coordinates(coordinates, message: str) -> None:
    chain = RandomTree(24, (-1, 0, 1), "RRR").mechanism()
    with pytest.raises(ValueError, match=message):
        replace(chain, coordinates=coordinates)


def test_a_ratio_is_a_number() -> None:
    with pytest.raises(ValueError, match="nan"):
        Coordinate(0, float("nan"))


class Noted:
    """A value that notes when it is multiplied, as a recorded operation does."""

    def __init__(self, name: str, noted: list[str]) -> None:
        self.name, self.noted = name, noted

    def __mul__(self, ratio: float) -> float:
        self.noted.append(self.name)
        return 0.0


def test_mimic_joints_values_are_computed_in_one_order_in_all_processes() -> None:
    """It is the order of the generated code. The order of a set of names changes with PYTHONHASHSEED."""
    first, second, *_ = RandomTree(21, PARENTS, "RRRRR").frames
    frames, noted = (first, replace(second, mimic=Mimic(((0, 2.0),), 0.0))), []
    names = ("q", "qd", "qdd", "qd_r", "qdd_r", "weights")

    @on_coordinates()
    def algorithm(frames, weights, qdd_r, qd_r, qdd, qd, q) -> None:
        pass

    algorithm(frames, **{name: [Noted(name, noted)] for name in names})

    assert noted == [*names]
