"""Parallelograms become shared coordinates: closed in Pinocchio's frames, as many base parameters as a rank says."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pinocchio
import pytest

import psdmc
from psdmc.robot.coordinates import MimicMap
from psdmc.robot.load import load_robot, load_robot_text

HERE = Path(__file__).parents[2] / "examples" / "palletiser"
PALLETISER, LOOPS = HERE / "palletiser.urdf", HERE / "palletiser_loops.toml"
ENDS = [
    ("upper_arm", (-0.25, 0.0, 0.0), "rod", (0.0, 0.0, 0.945)),
    ("triangle", (-0.11, 0.0, 0.16), "lower_link", (0.0, 0.0, 0.945)),
    ("wrist", (0.1, 0.0, 0.17), "upper_link", (1.025, 0.0, 0.0)),
]
"""Both ends of each loop of the palletiser, in their links."""


def linkage(lengths: Sequence[float], angles: Sequence[float] = (0.5, 0.0, 0.5), more: str = "") -> str:
    """A planar linkage of a crank, a coupler on it and a rocker, the base being its fourth side. The angles are those
    of the file's zero."""
    crank, coupler, rocker, base = lengths
    joints = [("crank", "base", 0.0), ("coupler", "crank", crank), ("rocker", "base", base)]
    tables = [
        f'[[joint]]\nname = "{name}"\nparent = "{parent}"\na = {a}\ntheta = {angle}\n[joint.link]\nmass = 1.0\n'
        "com = [0.1, 0.02, 0.0]\ninertia_com = { xx = 0.1, yy = 0.1, zz = 0.1, xy = 0.0, xz = 0.0, yz = 0.0 }\n"
        for (name, parent, a), angle in zip(joints, angles, strict=True)
    ]
    loop = (
        f'[[loop]]\nname = "pin"\nrows = ["x", "y"]\nfirst = {{ link = "link3", xyz = [{rocker}, 0.0, 0.0] }}\n'
        f'second = {{ link = "link2", xyz = [{coupler}, 0.0, 0.0] }}\n{more}'
    )
    return 'name = "linkage"\nconvention = "modified"\ngravity = [0.0, -9.81, 0.0]\n' + "".join(tables) + loop


def loaded(*arguments: object, **keywords: object):
    return load_robot_text(linkage(*arguments, **keywords), "dh", source_name="linkage.toml").mechanism


def test_loops_of_the_palletiser_are_closed_in_pinocchio_in_random_positions():
    robot = load_robot(PALLETISER, loops=LOOPS).mechanism
    assert robot.loops == ()
    assert robot.v_names == ("axis_1", "axis_2", "axis_4", "axis_3")
    model = pinocchio.buildModelFromUrdf(str(PALLETISER))
    data = model.createData()
    mimic_map = MimicMap.of(robot.coordinates, robot.types)
    for q in np.random.default_rng(1).uniform(-3.0, 3.0, (20, 4)):
        own = dict(zip(robot.joint_names, mimic_map.positions(q), strict=True))
        pinocchio.framesForwardKinematics(model, data, configured(model, own))
        place = {name: data.oMf[model.getFrameId(name)] for end in ENDS for name in (end[0], end[2])}
        for first, one, second, other in ENDS:
            gap = place[first].act(np.array(one)) - place[second].act(np.array(other))
            assert np.abs(gap).max() < 1e-14
        assert place["wrist"].rotation[2] == pytest.approx(
            [0.0, 0.0, 1.0], abs=1e-14
        )  # the flange stays level


def configured(model: pinocchio.Model, own: dict[str, float]) -> np.ndarray:
    """Pinocchio's q, in which continuous joints have a cosine and a sine."""
    q = pinocchio.neutral(model)
    for joint, name in zip(model.joints, model.names, strict=True):
        if name in own:
            angle = own[name]
            q[joint.idx_q : joint.idx_q + joint.nq] = (
                angle if joint.nq == 1 else (np.cos(angle), np.sin(angle))
            )
    return q


def test_base_parameters_of_the_palletiser_are_as_many_as_the_rank_of_pinocchio_s_regressor():
    model = psdmc.derive(PALLETISER, loops=LOOPS)
    robot, tree = model.mechanism, pinocchio.buildModelFromUrdf(str(PALLETISER))
    data, mimic_map = tree.createData(), MimicMap.of(model.mechanism.coordinates, model.mechanism.types)
    order = [tree.joints[tree.getJointId(name)].idx_v for name in robot.joint_names]
    rows = []
    rng = np.random.default_rng(2)
    for _ in range(60):
        q, qd, qdd = rng.uniform(-2.0, 2.0, (3, 4))
        own = dict(zip(robot.joint_names, mimic_map.positions(q), strict=True))
        rates = np.zeros((2, tree.nv))
        rates[:, order] = mimic_map.rates(np.stack([qd, qdd]))
        found = pinocchio.computeJointTorqueRegressor(tree, data, configured(tree, own), *rates)
        rows.append(mimic_map.ratios.T @ found[order])
    sizes = np.linalg.svd(np.concatenate(rows), compute_uv=False)
    rank = int(np.count_nonzero(sizes > 1e-9 * sizes[0]))
    assert sizes[rank - 1] > 1e6 * sizes[rank]  # a clear gap
    assert model.l == rank == 25


def test_the_coupled_model_moves_as_the_tree_with_loops_that_stay():
    tables = [table | {"follows": []} for table in loop_tables()]
    coupled = psdmc.derive(PALLETISER, loops=LOOPS)
    tree = psdmc.derive(PALLETISER, loops=tables)
    assert list(tree.loops) == ["drive", "level_lower", "level_upper"]
    mimic_map = MimicMap.of(coupled.mechanism.coordinates, coupled.mechanism.types)
    assert coupled.joint_names == tree.joint_names
    rng, motors = np.random.default_rng(3), list(coupled.mechanism.own_joints)
    for _ in range(5):
        q, qd, tau = rng.uniform(-1.0, 1.0, (3, 4))
        whole = np.zeros(10)
        whole[motors] = 1e3 * tau
        contacts = np.zeros(len(tree.contacts))
        qdd, _ = tree.constrained_forward_dynamics(
            mimic_map.positions(q), mimic_map.rates(qd), whole, contacts
        )
        expected = coupled.forward_dynamics(q, qd, 1e3 * tau)
        np.testing.assert_allclose(qdd, mimic_map.rates(expected), rtol=1e-9, atol=1e-9)


def loop_tables() -> list[dict[str, object]]:
    import tomllib

    return list(tomllib.loads(LOOPS.read_text(encoding="utf-8"))["loop"])


def test_a_parallelogram_that_is_flat_or_open_at_zero_is_found():
    for angles, offsets in (
        ((0.0, 0.0, 0.0), (0.0, 0.0)),  # flat: two ways lead from there
        ((0.5, -0.2, 0.3), (0.2 - 0.5, 0.5 - 0.3)),  # open
    ):
        robot = loaded((0.2, 0.5, 0.2, 0.5), angles)
        assert not robot.loops
        coupler, rocker = robot.coordinates[1:]
        assert (coupler.shares, rocker.shares) == (((0, -1.0),), ((0, 1.0),))
        assert (coupler.offset, rocker.offset) == pytest.approx(offsets, abs=1e-12)


TIP = 0.2 * np.exp(0.5j)
CROSSED = 2.0 * np.angle(0.5 - TIP)
"""Angle of the coupler of a crossed parallelogram: mirrored at the diagonal."""


@pytest.mark.parametrize(
    ("lengths", "angles"),
    [
        ((0.2, 0.5, 0.4, 0.45), (0.5, 0.0, 1.2)),
        ((0.2, 0.5, 0.2, 0.5), (0.5, CROSSED - 0.5, np.angle(TIP + 0.5 * np.exp(1j * CROSSED) - 0.5))),
    ],
    ids=["four-bar linkage", "crossed parallelogram"],
)
def test_other_linkages_stay_loops(lengths, angles):
    robot = loaded(lengths, angles)
    assert [loop.name for loop in robot.loops] == ["pin"]
    assert not robot.has_mimic_joints


def test_follows_names_the_joints_without_motors_or_keeps_the_loop():
    shape = ((0.2, 0.5, 0.2, 0.5), (0.5, -0.5, 0.5))
    assert loaded(*shape).own_joints == (0,)
    assert loaded(*shape, more='follows = ["crank", "coupler"]').own_joints == (2,)
    assert loaded(*shape, more='passive = ["crank", "coupler"]').own_joints == (2,)
    assert len(loaded(*shape, more="follows = []").loops) == 1


def test_joints_that_cannot_follow_are_an_error():
    with pytest.raises(psdmc.InputError, match="loop 'pin': joints cannot follow linearly"):
        loaded((0.2, 0.5, 0.4, 0.45), (0.5, 0.0, 1.2), more='follows = ["coupler"]')
    with pytest.raises(psdmc.InputError, match="joint 'crank' cannot follow others: found"):
        loaded((0.2, 0.5, 0.2, 0.5), more='follows = ["crank", "coupler", "rocker"]')
    with pytest.raises(psdmc.InputError, match="joint 'crank' cannot follow others: found"):
        loaded((0.2, 0.5, 0.2, 0.5), more='passive = ["crank", "coupler", "rocker"]')


def test_a_model_file_keeps_sums_and_a_urdf_cannot(tmp_path):
    model = psdmc.derive(PALLETISER, loops=LOOPS)
    psdmc.save(model, tmp_path / "palletiser.npz")
    again = psdmc.load(tmp_path / "palletiser.npz")
    assert again.mechanism.coordinates == model.mechanism.coordinates
    assert again.mechanism.has_sums
    with pytest.raises(psdmc.InputError, match="joint 'elbow' follows several joints"):
        psdmc.export_urdf(model, tmp_path / "palletiser.urdf")
