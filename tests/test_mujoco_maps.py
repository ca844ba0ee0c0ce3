"""psdmc.mujoco: positions and rates in MuJoCo's conventions, against MuJoCo's own differences of positions and its inverse
dynamics."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest
from robot.test_mjcf import ARM, BALLS, FLYING, GRIPPER, of_file

import psdmc
from psdmc.errors import InputError
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.model.random_states import states_of
from psdmc.mujoco import from_qpos, from_qvel, to_qpos, to_qvel

mujoco = pytest.importorskip("mujoco")

NAMED = {
    "floating": FLYING,
    "fixed": ARM.replace('<joint axis="1 1 0"', '<joint name="wrist" axis="1 1 0"'),
    "balls": BALLS.replace('<joint type="ball" pos="0 .01', '<joint name="wrist" type="ball" pos="0 .01'),
}


@pytest.fixture(scope="module", params=NAMED)
def robot(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> tuple[DynamicsModel, object]:
    return read(tmp_path_factory.mktemp("mujoco"), request.param)


@cache
def read(folder: Path, name: str) -> tuple[DynamicsModel, object]:
    """psdmc's model and MuJoCo's."""
    path = folder / "robot.xml"
    path.write_text(NAMED.get(name, name), encoding="utf-8")
    return psdmc.derive(path, snap=0.0, expand=False), of_file(path)


def drawn(model: DynamicsModel, *shape: int) -> tuple[np.ndarray, ...]:
    found = states_of(model.mechanism, np.random.default_rng(3), int(np.prod(shape)))
    return tuple(x.reshape(*shape, -1) for x in found)


def test_rates_are_mujocos_difference_of_positions(robot: tuple[DynamicsModel, object]) -> None:
    model, theirs = robot
    q, qd, _ = drawn(model, 6)
    step = 1e-4
    ends = [to_qpos(model, model.integrate(q, sign * step * qd), theirs) for sign in (-1, 1)]
    found = np.zeros((6, theirs.nv))
    for row, start, end in zip(found, *ends, strict=True):
        mujoco.mj_differentiatePos(theirs, row, 2 * step, start, end)
    np.testing.assert_allclose(to_qvel(model, q, qd, theirs), found, rtol=0.0, atol=1e-6)
    np.testing.assert_allclose(from_qvel(model, q, found, theirs), qd, rtol=0.0, atol=1e-6)


def test_torques_are_mujocos(robot: tuple[DynamicsModel, object]) -> None:
    """Accelerations are differences of rates; efforts have the power that MuJoCo's have."""
    model, theirs = robot
    q, qd, qdd = drawn(model, 5)
    step, data = 1e-4, mujoco.MjData(theirs)
    rates = [to_qvel(model, model.integrate(q, h * qd), qd + h * qdd, theirs) for h in (-step, step)]
    data_of = zip(to_qpos(model, q, theirs), to_qvel(model, q, qd, theirs), rates[1] - rates[0], strict=True)
    for here, tau, (data.qpos[:], data.qvel[:], change) in zip(
        q, model.inverse_dynamics(q, qd, qdd), data_of, strict=True
    ):
        data.qacc[:] = change / (2 * step)
        mujoco.mj_inverse(theirs, data)
        found = to_qvel(model, here, np.eye(model.nv), theirs) @ data.qfrc_inverse
        np.testing.assert_allclose(found, tau, rtol=0.0, atol=1e-6 * np.abs(tau).max())


def test_there_and_back_on_any_leading_axes(robot: tuple[DynamicsModel, object]) -> None:
    model, theirs = robot
    q, qd, _ = drawn(model, 2, 3)
    qpos, qvel = to_qpos(model, q, theirs), to_qvel(model, q, qd, theirs)
    assert qpos.shape == (2, 3, theirs.nq)
    assert qvel.shape == (2, 3, theirs.nv)
    np.testing.assert_array_equal(from_qpos(model, qpos, theirs), q)
    np.testing.assert_allclose(from_qvel(model, q, qvel, theirs), qd, rtol=0.0, atol=1e-14)
    np.testing.assert_array_equal(to_qpos(model, q[1, 2], theirs), qpos[1, 2])
    np.testing.assert_array_equal(to_qvel(model, q[1, 2], qd, theirs)[1, 2], qvel[1, 2])
    alone = to_qpos(model, q)
    assert alone.shape == q.shape, "without an MjModel, in the model's own order"
    np.testing.assert_array_equal(from_qpos(model, alone), q)
    np.testing.assert_allclose(from_qvel(model, q, to_qvel(model, q, qd)), qd, rtol=0.0, atol=1e-14)


def test_a_long_quaternion_turns_rates_as_one_of_length_one(tmp_path: Path) -> None:
    model, _ = read(tmp_path, "floating")
    q, qd, _ = drawn(model, 1)
    longer = q.copy()
    longer[:, 3:7] *= 5.0
    np.testing.assert_allclose(to_qvel(model, longer, qd), to_qvel(model, q, qd), rtol=1e-14)


def test_joints_that_follow_have_entries_in_mujoco_only(tmp_path: Path) -> None:
    """right = 0.1 - 1.5 left, about the positions at rest."""
    model, theirs = read(tmp_path, GRIPPER)
    q, qd = np.array([0.4, 0.7]), np.array([1.0, 2.0])
    qpos = to_qpos(model, q, theirs)
    places = [int(theirs.joint(name).qposadr[0]) for name in ("wrist", "left", "right")]
    np.testing.assert_allclose(qpos[places], [0.4, 0.7, 0.3 + 0.1 - 1.5 * (0.7 - 0.2)], rtol=1e-14)
    np.testing.assert_allclose(to_qvel(model, q, qd, theirs)[places], [1.0, 2.0, -3.0], rtol=1e-14)
    np.testing.assert_array_equal(from_qpos(model, qpos, theirs), q)
    np.testing.assert_array_equal(from_qvel(model, q, to_qvel(model, q, qd, theirs), theirs), qd)


def test_joints_that_the_model_has_not_stay_at_rest(tmp_path: Path) -> None:
    """MuJoCo's world has a door too."""
    door = '<body name="door" pos="3 0 0"><joint name="hinge" ref="90"/><geom size=".1"/></body><body name="trunk"'
    (tmp_path / "whole.xml").write_text(FLYING.replace('<body name="trunk"', door), encoding="utf-8")
    theirs = mujoco.MjModel.from_xml_path(str(tmp_path / "whole.xml"))
    model, _ = read(tmp_path, "floating")
    q, qd, _ = drawn(model, 4)
    qpos, qvel = to_qpos(model, q, theirs), to_qvel(model, q, qd, theirs)
    np.testing.assert_array_equal(qpos[:, theirs.joint("hinge").qposadr[0]], np.pi / 2)
    np.testing.assert_array_equal(qvel[:, theirs.joint("hinge").dofadr[0]], 0.0)
    np.testing.assert_array_equal(from_qpos(model, qpos, theirs), q)


def test_what_does_not_fit_is_refused_in_one_line(tmp_path: Path) -> None:
    model, theirs = read(tmp_path, "floating")
    q, qd, _ = drawn(model, 3)
    with pytest.raises(InputError, match=r"^to_qpos: q has shape \(3, 8\), expected \(..., 9\)"):
        to_qpos(model, qd, theirs)
    with pytest.raises(InputError, match=r"^from_qvel: qvel has shape \(3, 9\), expected \(..., 8\)"):
        from_qvel(model, q, q, theirs)
    with pytest.raises(InputError, match=r"^from_qpos: qpos has shape \(\), expected"):
        from_qpos(model, 1.0)
    with pytest.raises(InputError, match=r"^to_qvel: shapes do not broadcast: q \(3, 9\), qd \(2, 8\)"):
        to_qvel(model, q, qd[:2])
    with pytest.raises(InputError, match=r"^to_qpos: q has dtype complex128"):
        to_qpos(model, q + 0j)
    with pytest.raises(InputError, match="a dict was given where an MjModel is expected"):
        to_qpos(model, q, {})
    fixed = mujoco.MjModel.from_xml_string(NAMED["fixed"])
    with pytest.raises(InputError, match="is a free joint, and the MjModel has no such joint"):
        to_qpos(model, q, fixed)
    other = mujoco.MjModel.from_xml_string(FLYING.replace('name="hip_l"', 'name="hip_l" type="slide"'))
    with pytest.raises(
        InputError, match="'hip_l' is a hinge joint, and the MjModel has a slide joint of that name"
    ):
        to_qpos(model, q, other)


def test_joints_that_mujoco_has_not_are_refused() -> None:
    from random_trees import RandomTree

    from psdmc.derivation.derive import derive_model

    planar = derive_model(RandomTree(3, (-1, 0), "LR").mechanism(), expand=False)
    with pytest.raises(InputError, match=r"to_qpos: joint 'joint0' .*, and MuJoCo has no such joint"):
        to_qpos(planar, np.zeros(5))
    placed = derive_model(RandomTree(3, (-1, 0), "RF").mechanism(), expand=False)
    with pytest.raises(InputError, match="is free, but not in the world's frame"):
        to_qpos(placed, np.zeros(8))
