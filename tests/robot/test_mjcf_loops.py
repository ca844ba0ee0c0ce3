"""Closed loops of MJCFs: MuJoCo's own constraint residuals and accelerations, for `connect` and `weld`."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from slow_cases import slow_but_for

import psdmc
from psdmc.errors import InputError
from psdmc.robot.load import load_robot

mujoco = pytest.importorskip("mujoco")

HARD = 'solref="-1e7 -1e4" solimp="0.99999 0.99999 0.001 0.5 2"'
ARM = """<body name="{n}1" pos="{x} 0 0.1" quat="0.9 0.1 -0.2 0.3"><joint axis="0 0 1" name="{n}a"/>
<geom size=".1" pos=".1 0 0"/><body name="{n}2" pos=".3 .1 0"><joint axis="0 1 0.2" pos="0.02 0 0.01" name="{n}b"/>
<geom size=".08" pos="0 .1 .1"/><body name="{n}3" pos="0 .3 .1"><joint axis="1 0.1 0" name="{n}c"/>
<joint axis="0 0.3 1" name="{n}d"/><geom size=".07" pos=".1 .1 0"/><site name="{n}s" pos=".1 .2 .3" quat="1 .2 .3 .4"/>
<site name="{n}t" pos="-.2 .1 .1" quat="1 .2 -2 .4"/></body></body></body>"""

CONNECT = '<connect name="hook" body1="l3" body2="r3" anchor="0.1 0.3 0.2" {hard}/>'
KINDS = {
    "connect": CONNECT,
    "weld": '<weld name="hook" body1="l3" body2="r3" anchor="0.1 0 0.2" relpose="0.1 0.2 -0.1 0.8 0.1 0.5 0.2" {hard}/>',
    "sites": '<connect name="hook" site1="ls" site2="rs" {hard}/>',
    "welded sites": '<weld name="hook" site1="ls" site2="rt" {hard}/>',
    "world": '<connect name="hook" body1="l3" anchor="0 0.1 0.2" {hard}/>',
}


def written(tmp_path: Path, equality: str) -> Path:
    path = tmp_path / "loop.xml"
    arms = ARM.format(n="l", x=0) + ARM.format(n="r", x=0.5)
    path.write_text(
        '<mujoco><option cone="elliptic" tolerance="0" iterations="100"><flag contact="disable"/></option>'
        f"<worldbody>{arms}</worldbody><equality>{equality.format(hard=HARD)}</equality></mujoco>",
        encoding="utf-8",
    )
    return path


@pytest.mark.parametrize("kind", slow_but_for(["connect", "welded sites", "world"], KINDS))
def test_constraints_are_mujocos(kind: str, tmp_path: Path) -> None:
    """Positions of the residual at any state, and the motions that the constraint leaves at closed ones."""
    path = written(tmp_path, KINDS[kind])
    model = psdmc.derive(path, expand=False)
    theirs = mujoco.MjModel.from_xml_path(str(path))
    data, rng = mujoco.MjData(theirs), np.random.default_rng(3)
    assert model.q_names == tuple(theirs.joint(k).name for k in range(theirs.njnt))
    for q in rng.uniform(-1.0, 1.0, (5, model.nv)):
        data.qpos[:] = q
        mujoco.mj_forward(theirs, data)
        distance = np.linalg.norm(data.efc_pos[:3])
        assert abs(np.linalg.norm(model.loop_error(q)[:3]) - distance) < 1e-12 * max(1.0, distance)
    q = closed(model)
    data.qpos[:] = q
    mujoco.mj_forward(theirs, data)
    assert np.abs(data.efc_pos).max() < 1e-9
    rows = data.efc_J.reshape(-1, model.nv).copy()
    assert np.abs(rows @ null(model.loop_jacobian(q))).max() < 1e-12
    tau, still, active = rng.normal(size=model.nv), np.zeros(model.nv), np.zeros(len(model.contacts))
    # At rest, with MuJoCo's matrices and no softness.
    dense = np.block([[full_mass(theirs, data), rows.T], [rows, np.zeros((len(rows), len(rows)))]])
    expected = np.linalg.solve(dense, np.append(tau - data.qfrc_bias, np.zeros(len(rows))))[: model.nv]
    found = model.constrained_forward_dynamics(q, still, tau, active)
    assert np.abs(found.qdd - expected).max() < 1e-9 * np.abs(expected).max()
    if len(rows) > 3:
        return
    # In motion, with the least softness that MuJoCo takes.
    qd = null(rows) @ rng.normal(size=model.nv - len(rows))
    data.qvel[:], data.qfrc_applied[:] = qd, tau
    mujoco.mj_forward(theirs, data)
    found = model.constrained_forward_dynamics(q, qd, tau, active)
    assert np.abs(found.qdd - data.qacc).max() < 1e-3 * np.abs(data.qacc).max()


def full_mass(model: mujoco.MjModel, data: mujoco.MjData) -> np.ndarray:
    """MuJoCo's mass matrix, row by row."""
    found = np.zeros((model.nv, model.nv))
    for row, unit in zip(found, np.eye(model.nv), strict=True):
        mujoco.mj_mulM(model, data, row, unit)
    return found


def closed(model: psdmc.DynamicsModel) -> np.ndarray:
    """Newton's method from some states, until one ends closed."""
    for q in np.random.default_rng(1).uniform(-1.5, 1.5, (200, model.nv)):
        for _ in range(60):
            step = 1e-300 + np.linalg.lstsq(model.loop_jacobian(q), -model.loop_error(q), rcond=1e-6)[0]
            q = q + step * min(1.0, 0.5 / np.abs(step).max())
        if np.abs(model.loop_error(q)).max() < 1e-13:
            return q
    raise AssertionError("no state closes the loop")


def null(rows: np.ndarray) -> np.ndarray:
    return np.linalg.svd(rows)[2][len(rows) :].T


def test_tables_change_constraints_by_name(tmp_path: Path) -> None:
    path = written(tmp_path, CONNECT)
    plain = load_robot(path)
    assert plain.mechanism.rows_of_loops == ((0, 1, 2),)
    changed = load_robot(path, loops=[{"name": "hook", "rows": ["x"]}])
    assert changed.mechanism.rows_of_loops == ((0,),)
    assert np.array_equal(
        changed.mechanism.loops[0].first.placement.translation,
        plain.mechanism.loops[0].first.placement.translation,
    )
    again = load_robot(path, **changed.options.as_json())
    assert again.mechanism.rows_of_loops == ((0,),)
    more = load_robot(path, loops=[{"name": "other", "rows": 3, "first": "l1", "second": "r3"}])
    assert [loop.name for loop in more.mechanism.loops] == ["hook", "other"]
    with pytest.raises(InputError, match="2 loops are called 'hook'"):
        load_robot(path, loops=[{"name": "hook", "rows": ["x"]}, {"name": "hook", "rows": ["z"]}])


def test_a_floating_robot_is_held_to_the_world(tmp_path: Path) -> None:
    text = """<mujoco><worldbody><body name="hull" pos="0 0 1"><freejoint name="fly"/><geom size=".1"/>
    <body name="arm" pos=".1 0 0"><joint name="j" axis="0 1 0"/><geom size=".1" pos=".2 0 0"/></body></body></worldbody>
    <equality><connect name="rope" body1="arm" anchor=".2 0 0"/></equality></mujoco>"""
    path = tmp_path / "floating.xml"
    path.write_text(text, encoding="utf-8")
    model = psdmc.derive(path, expand=False)
    theirs = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(theirs)
    mujoco.mj_forward(theirs, data)
    q = np.array([*data.qpos[:3], *data.qpos[4:7], data.qpos[3], data.qpos[7]])
    assert np.abs(model.loop_error(q)).max() < 1e-14
    q[:3] += [0.1, 0.2, 0.3]
    np.testing.assert_allclose(
        np.linalg.norm(model.loop_error(q)), np.linalg.norm([0.1, 0.2, 0.3]), rtol=1e-12
    )


def test_redundant_rows_of_a_connect_are_told_with_the_tables_that_leave_them_out(tmp_path: Path) -> None:
    text = """<mujoco><worldbody><body name="a"><joint name="ja" axis="0 1 0"/><geom size=".1"/>
    <body name="b" pos=".2 0 0"><joint name="jb" axis="0 1 0"/><geom size=".1" pos=".1 0 0"/></body></body>
    <body name="c" pos=".4 0 0"><joint name="jc" axis="0 1 0"/><geom size=".1" pos=".1 0 0"/></body></worldbody>
    <equality><connect name="pin" body1="b" body2="c" anchor=".3 0 .2"/></equality></mujoco>"""
    path = tmp_path / "flat.xml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match="redundant rows: y of loop 'pin'") as error:
        psdmc.derive(path, expand=False)
    assert 'rows = ["x", "z"] in loop \'pin\'' in str(error.value.hint)
    assert psdmc.derive(path, loops=[{"name": "pin", "rows": ["x", "z"]}], expand=False).loops


def test_equal_limbs_that_a_loop_joins_keep_it_in_c(tmp_path: Path) -> None:
    """Without the loop, both arms and their contacts are computed in lanes."""
    model = psdmc.derive(written(tmp_path, CONNECT), expand=False)
    robot = psdmc.compile(model, functions=["constrained_forward_dynamics"])
    q, qd, tau = np.random.default_rng(2).normal(size=(3, 9, model.nv))
    active = np.zeros(len(model.contacts))
    found, expected = (each.constrained_forward_dynamics(q, qd, tau, active) for each in (robot, model))
    one = robot.constrained_forward_dynamics(q[4], qd[4], tau[4], active)
    for many, single, values in zip(found, one, expected, strict=True):
        assert np.abs(many - values).max() < 1e-9 * np.abs(values).max()
        assert np.abs(single - values[4]).max() < 1e-9 * np.abs(values).max()
