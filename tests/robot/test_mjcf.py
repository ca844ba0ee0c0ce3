"""MJCF files: the same torques as MuJoCo's own model of the file, and as Pinocchio's; what is refused and what is noted."""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from slow_cases import slow_but_for

from psdmc.compiler import derive
from psdmc.errors import InputError
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.model.load import load
from psdmc.model.random_states import on_joints
from psdmc.robot.limits import MAX_BYTES
from psdmc.robot.load import load_robot, load_robot_text
from psdmc.robot.mjcf import to_urdf
from psdmc.robot.mjcf.copies import refuse_many_copies
from psdmc.robot.mujoco_reading import force_from_mujoco, to_mujoco
from psdmc.verification.check import MUJOCO, check_model

mujoco = pytest.importorskip("mujoco")

AGREEMENT = 1e-12
"""Of each joint's largest torque."""

ARM = """<mujoco model="arm"><compiler angle="degree"/><option gravity="0.3 0 -9.5"/>
<default><joint armature="0.02"/></default>
<worldbody><geom type="plane" size="1 1 .1"/>
<body name="a" pos="0 0 .3" euler="0 10 20">
 <joint name="turn" axis="0 0 1" range="-90 90" pos="0.05 0.02 0"/>
 <joint name="slide" type="slide" axis="1 0 1" ref="0.1" range="-1 1" actuatorfrcrange="-40 30"/>
 <geom type="capsule" size=".05" fromto="0 0 0 .3 0 .1"/>
 <body name="b" pos=".3 0 .1"><joint name="elbow" axis="0 1 0" ref="30"/><geom type="box" size=".1 .05 .02" pos=".1 0 0"/>
  <body name="plate" pos=".2 0 0" euler="20 0 0"><geom type="sphere" size=".05"/></body>
  <body pos=".2 .1 0"><joint axis="1 1 0" pos=".1 0 0"/><geom type="ellipsoid" size=".1 .2 .3"/></body></body></body>
</worldbody></mujoco>"""

FLYING = """<mujoco><worldbody><geom type="plane" size="1 1 .1"/>
<body name="trunk" pos="0 0 1" quat="1 .2 .3 .1"><freejoint name="root"/><geom type="box" size=".3 .2 .1" pos=".05 0 0"/>
 <body name="left" pos=".3 .2 0"><joint name="hip_l" axis="0 1 0" pos="0 .01 0"/><geom type="capsule" size=".03" fromto="0 0 0 0 0 -.4"/></body>
 <body name="right" pos=".3 -.2 0"><joint name="hip_r" axis="0 1 .1"/><geom type="capsule" size=".03" fromto="0 0 0 0 0 -.4"/></body>
</body></worldbody></mujoco>"""  # noqa: E501

GRIPPER = """<mujoco><compiler angle="radian"/><worldbody>
<body name="palm"><joint name="wrist" axis="1 0 0"/><geom type="box" size=".1 .05 .02"/>
<body name="l" pos="0 .1 .05"><joint name="left" type="slide" axis="0 1 0" ref=".2"/>
<geom type="box" size=".01 .02 .05"/></body>
<body name="r" pos="0 -.1 .05"><joint name="right" axis="1 1 0" ref=".3"/><geom type="box" size=".01 .02 .05"/></body></body>
</worldbody><equality><joint name="same" joint1="right" joint2="left" polycoef=".1 -1.5 0 0 0"/></equality></mujoco>"""

BALLS = """<mujoco><option gravity="0.3 0 -9.5"/><worldbody>
<body name="torso" pos="0 0 1" euler="10 20 30">
 <joint name="waist" axis="0 1 1" pos=".02 0 .1"/><joint name="spine" type="ball" pos=".1 .05 0" damping=".3"/>
 <joint name="tail" type="slide" axis="1 1 0" ref=".2"/><geom type="box" size=".3 .2 .1" pos=".05 0 0"/>
 <body name="arm" pos=".3 .2 0" euler="5 6 7"><joint name="shoulder" type="ball" range="0 90" limited="true"/>
  <geom type="capsule" size=".03" fromto="0 0 0 .1 0 -.4"/>
  <body name="hand" pos=".1 0 -.4"><joint name="elbow" axis="1 0 0"/><joint type="ball" pos="0 .01 .02"/>
   <geom type="ellipsoid" size=".1 .05 .02" pos="0 0 -.1"/></body></body>
 <body name="leg" pos="0 -.2 0"><joint name="hip" type="ball" pos="0 .1 0"/><geom type="box" size=".1 .05 .3"/></body>
</body></worldbody></mujoco>"""


def written(folder: Path, text: str, name: str = "robot.xml") -> Path:
    (folder / name).write_text(text, encoding="utf-8")
    return folder / name


def of_file(path: Path) -> object:
    """MuJoCo's own model of the file: its rigid bodies alone."""
    model = mujoco.MjModel.from_xml_path(str(path))
    for forces in (model.dof_damping, model.dof_frictionloss, model.jnt_stiffness, model.body_gravcomp):
        forces[:] = 0.0
    bits = mujoco.mjtDisableBit
    model.opt.disableflags = int(bits.mjDSBL_CONTACT | bits.mjDSBL_LIMIT | bits.mjDSBL_EQUALITY)
    return model


def torques(model, q: np.ndarray, qd: np.ndarray, qdd: np.ndarray) -> np.ndarray:
    data = mujoco.MjData(model)
    found = []
    for data.qpos[:], data.qvel[:], data.qacc[:] in zip(q, qd, qdd, strict=True):
        mujoco.mj_inverse(model, data)
        found.append(data.qfrc_inverse.copy())
    return np.array(found)


def states(count: int, nq: int, nv: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(7)
    return rng.uniform(-2, 2, (count, nq)), rng.uniform(-2, 2, (count, nv)), rng.uniform(-9, 9, (count, nv))


def places(model, robot: DynamicsModel) -> list[int]:
    """Where MuJoCo has psdmc's joints, which are in another order on bodies that branch."""
    return [int(model.jnt_dofadr[j]) for j in joint_numbers(model, robot)]


def joint_numbers(model, robot: DynamicsModel) -> list[int]:
    """MuJoCo's numbers of psdmc's joints, of those without a name too."""
    numbers = [mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, name) for name in robot.joint_names]
    rest = [j for j in range(model.njnt) if j not in numbers]
    return [rest.pop(0) if j < 0 else j for j in numbers]


def agrees(ours: np.ndarray, theirs: np.ndarray) -> None:
    error = np.abs(ours - theirs).max(axis=0) / np.abs(theirs).max(axis=0)
    assert error.max() < AGREEMENT, error


def standing(path: Path) -> DynamicsModel:
    robot, model = derive(path, snap=0.0), of_file(path)
    order = places(model, robot)
    q, qd, qdd = states(20, robot.nq, robot.nv)
    theirs = [np.zeros_like(q) for _ in range(3)]
    for whole, own in zip(theirs, (q, qd, qdd), strict=True):
        whole[:, order] = own
    agrees(robot.inverse_dynamics(q, qd, qdd), torques(model, *theirs)[:, order])
    return robot


@pytest.mark.parametrize("number", ["NaN", "nan", "-NAN"])
def test_a_number_that_is_none_is_refused_and_nothing_is_littered(
    number: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    """MuJoCo itself prints a warning, writes MUJOCO_LOG.TXT where it stands, and goes on."""
    monkeypatch.chdir(tmp_path)
    path = written(tmp_path, ARM.replace("0.05 0.02 0", f"0.05 {number} 0"))

    with pytest.raises(InputError, match=r"a number of it is NaN|MuJoCo refuses it"):
        load_robot(path)

    assert [item.name for item in tmp_path.iterdir()] == ["robot.xml"]
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize(("old", "new"), [('ref="0.1"', 'ref="2e4"'), ('ref="30"', 'ref="1e9"')])
def test_reference_positions_far_away_are_refused_by_name(old: str, new: str, tmp_path: Path) -> None:
    name = "slide" if "2e4" in new else "elbow"
    with pytest.raises(InputError, match=rf"joint '{name}': ref [\d.e+]+ is out of range") as refused:
        load_robot(written(tmp_path, ARM.replace(old, new)))
    assert refused.value.hint


def test_joints_anchors_references_armature_and_geometry_as_mujoco_has_them(tmp_path: Path) -> None:
    robot = standing(written(tmp_path, ARM))

    turn, slide, elbow, last = robot.mechanism.joints
    assert (turn.name, slide.name, elbow.name, last.name) == ("turn", "slide", "elbow", "joint3")
    assert [joint.kind for joint in robot.mechanism.joints] == [
        "revolute",
        "prismatic",
        "revolute",
        "revolute",
    ]
    assert (turn.limits.lower, turn.limits.upper) == pytest.approx((-np.pi / 2, np.pi / 2))
    assert (slide.limits.lower, slide.limits.upper, slide.limits.effort) == (-1.0, 1.0, 30.0)
    assert robot.mechanism.parameters[:, 10].tolist() == [0.02] * 4
    assert robot.mechanism.gravity.tolist() == [0.3, 0.0, -9.5]


def random_mjcf(seed: int) -> str:
    """A tree of up to eight bodies with one or two joints each, in any orientation, about any points."""
    rng = np.random.default_rng(seed)
    rows: list[list[int]] = [[] for _ in range(9)]
    for body in range(1, 9):
        rows[int(rng.integers(0, body))].append(body)

    def numbers(count: int, size: float = 0.4) -> str:
        return " ".join(map(repr, rng.uniform(-size, size, count).tolist()))

    def text(body: int) -> str:
        joints = "".join(
            f'<joint name="j{body}_{k}" type="{rng.choice(["hinge", "slide"])}" axis="{numbers(3, 1)}" pos="{numbers(3)}"'
            f' ref="{rng.uniform(-1, 1)!r}" armature="{rng.choice([0.0, 0.1])}"/>'
            for k in range(int(rng.integers(0 if body > 1 else 1, 3)))
        )
        own = f'<inertial pos="{numbers(3)}" quat="{numbers(4, 1)}" mass="{rng.uniform(0.5, 3)!r}" diaginertia=".3 .4 .5"/>'
        below = "".join(map(text, rows[body]))
        return f'<body name="b{body}" pos="{numbers(3)}" quat="{numbers(4, 1)}">{own}{joints}{below}</body>'

    return f'<mujoco><compiler angle="radian"/><worldbody>{"".join(map(text, rows[0]))}</worldbody></mujoco>'


@pytest.mark.parametrize("seed", range(12))
def test_random_trees_have_mujocos_torques(seed: int, tmp_path: Path) -> None:
    standing(written(tmp_path, random_mjcf(seed)))


def test_a_floating_base_floats_without_being_asked(tmp_path: Path) -> None:
    path = written(tmp_path, FLYING)
    robot, model = derive(path, snap=0.0), of_file(path)
    assert robot.joint_names == ("root_joint", "hip_l", "hip_r")
    q, qd, qdd = states(20, robot.nq, robot.nv)
    q[:, 3:7] /= np.linalg.norm(q[:, 3:7], axis=1, keepdims=True)
    theirs = to_mujoco(q, qd, qdd)

    agrees(robot.inverse_dynamics(q, qd, qdd), force_from_mujoco(theirs[0], torques(model, *theirs)))
    with pytest.raises(InputError, match="its root moves freely"):
        derive(path, tip="left")


def test_a_linear_equality_of_joints_is_a_follower(tmp_path: Path) -> None:
    path = written(tmp_path, GRIPPER)
    robot, model = derive(path, snap=0.0), of_file(path)
    assert robot.nv == 2
    assert "equality constraints of joints hold exactly: 'right'" in robot.mechanism.notes
    q, qd, qdd = states(20, 2, 2)
    first = {name: k for k, name in enumerate(n for n in robot.joint_names if n != "right")}
    wrist, left = first["wrist"], first["left"]
    # MuJoCo: right - .3 = .1 - 1.5 (left - .2)
    right = [0.3 + 0.1 - 1.5 * (q[:, left] - 0.2), -1.5 * qd[:, left], -1.5 * qdd[:, left]]
    whole = [np.stack([x[:, wrist], x[:, left], r], axis=1) for x, r in zip((q, qd, qdd), right, strict=True)]
    tau = torques(model, *whole)
    expected = np.zeros((20, 2))
    expected[:, wrist], expected[:, left] = tau[:, 0], tau[:, 1] - 1.5 * tau[:, 2]

    agrees(robot.inverse_dynamics(q, qd, qdd), expected)


def test_pinocchios_reading_of_the_same_file_gives_the_same_torques(tmp_path: Path) -> None:
    text = """<mujoco><compiler angle="radian"/><worldbody>
    <body name="a" pos="0 0 .3"><inertial pos=".1 .02 0" mass="2" diaginertia=".02 .03 .04"/>
     <joint name="j1" type="hinge" axis="0 0 1"/>
     <body name="b" pos=".3 0 .1" quat=".8 .6 0 0"><inertial pos=".1 0 .1" mass="1" diaginertia=".02 .03 .04"/>
      <joint name="j2" type="slide" axis="0 1 0"/>
      <body name="c" pos=".3 0 .1"><inertial pos=".1 0 .1" mass="1" diaginertia=".02 .03 .04"/>
       <joint name="j3" type="hinge" axis="1 0 0"/></body></body></body></worldbody></mujoco>"""
    path = written(tmp_path, text)
    robot, theirs = derive(path, snap=0.0), pin.buildModelFromMJCF(str(path))
    assert list(theirs.names)[1:] == list(robot.joint_names)
    data, given = theirs.createData(), states(20, 3, 3)

    agrees(
        robot.inverse_dynamics(*given),
        np.array([pin.rnea(theirs, data, *state) for state in zip(*given, strict=True)]),
    )


@pytest.mark.parametrize("text", [ARM, FLYING, GRIPPER, BALLS], ids=["arm", "flying", "gripper", "balls"])
def test_a_model_file_holds_all_that_check_needs(text: str, tmp_path: Path) -> None:
    """Also without the MJCF and its includes: the source is embedded as psdmc has translated it."""
    path = written(tmp_path, text)
    robot = derive(path)
    robot.save(tmp_path / "m.npz")
    path.unlink()
    kept = load(tmp_path / "m.npz")

    rows = check_model(kept, None)
    assert rows
    assert all(row.passed for row in rows)
    again = load_robot_text(
        kept.provenance["source_text"], "urdf", source_name="robot.xml", **kept.provenance["options"]
    ).mechanism
    assert again.notes == kept.mechanism.notes
    assert np.array_equal(again.parameters, kept.mechanism.parameters)


def test_included_files_are_read(tmp_path: Path) -> None:
    body = (
        '<mujocoinclude><body name="b"><joint name="j"/><geom size=".1" pos=".2 0 0"/></body></mujocoinclude>'
    )
    written(tmp_path, body, "body.xml")
    path = written(tmp_path, '<mujoco><worldbody><include file="body.xml"/></worldbody></mujoco>', "all.mjcf")

    assert load_robot(path).mechanism.joint_names == ("j",)


def with_more(more: str) -> str:
    return f"""<mujoco><worldbody><site name="s"/>
    <body name="a"><joint name="j1" axis="0 1 0"/><geom size=".1"/><site name="t" pos="0 0 1"/>
    <body name="b" pos="1 0 0"><joint name="j2"/><geom size=".1"/></body></body></worldbody>{more}</mujoco>"""


FIXED = '<tendon><fixed name="rope" {}><joint joint="j1" coef="1"/></fixed></tendon>'
REFUSED = [
    (
        '<equality><joint name="cam" joint1="j1" joint2="j2" polycoef="0 1 .2 0 0"/></equality>',
        "'cam' (joint)",
    ),
    ('<equality><joint name="held" joint1="j1"/></equality>', "equality constraint 'held' (joint)"),
    (FIXED.format('stiffness="3"'), "tendon 'rope' (stiffness)"),
    (FIXED.format('armature="3" damping="1"'), "tendon 'rope' (armature, damping)"),
]


@pytest.mark.parametrize(("more", "message"), REFUSED, ids=[message for _, message in REFUSED])
def test_constraints_are_refused_by_name(more: str, message: str, tmp_path: Path) -> None:
    with pytest.raises(InputError) as refused:
        load_robot(written(tmp_path, with_more(more)))

    assert message in refused.value.message
    assert "\n" not in refused.value.message
    assert "take them out of the file" in str(refused.value.hint)


def balls_agree(path: Path) -> DynamicsModel:
    """psdmc's torques are those of MuJoCo's own model of the file, its quaternions w x y z; a floating base comes first."""
    robot, model = derive(path, snap=0.0), of_file(path)
    given = states(20, robot.nq, robot.nv)
    q, qd, qdd = on_joints(robot.mechanism, given[0]), *given[1:]
    ours, flies = robot.inverse_dynamics(q, qd, qdd), robot.mechanism.types[0].word == "free"
    if flies:
        q, qd, qdd = to_mujoco(q, qd, qdd)
    theirs, at, order = np.zeros((len(q), model.nq)), 0, []
    for kind, j in zip(robot.mechanism.types, joint_numbers(model, robot), strict=True):
        own, first = q[:, at : at + kind.nq], int(model.jnt_qposadr[j])
        theirs[:, first : first + kind.nq] = own[:, [3, 0, 1, 2]] if kind.word == "spherical" else own
        order += [int(model.jnt_dofadr[j]) + k for k in range(kind.nv)]
        at += kind.nq
    rates = [np.zeros_like(qd) for _ in range(2)]
    for whole, own in zip(rates, (qd, qdd), strict=True):
        whole[:, order] = own
    tau = torques(model, theirs, *rates)[:, order]
    agrees(ours, force_from_mujoco(q, tau) if flies else tau)
    return robot


def balled(seed: int) -> str:
    """A random tree with a ball joint for each body's last hinge: MuJoCo takes no turn behind one on the same body."""

    def last_turns(joints: re.Match[str]) -> str:
        before, hinge, behind = joints[0].rpartition('type="hinge"')
        behind = re.sub(r'^ axis="[^"]*"( pos="[^"]*") ref="[^"]*" armature="[^"]*"', r"\1", behind)
        return f'{before}type="ball"{behind}' if hinge else joints[0]

    return re.sub(r"(<joint [^>]*/>)+", last_turns, random_mjcf(seed))


BALLED = [BALLS, *map(balled, (0, 1, 2, 3, 4, 6, 7, 8))]


@pytest.mark.parametrize("text", slow_but_for([BALLED[0], BALLED[2]], BALLED))
def test_ball_joints_turn_as_mujocos(text: str, tmp_path: Path) -> None:
    """Alone on a body, before and behind other joints, about other points than the body's origin."""
    robot = balls_agree(written(tmp_path, text))

    assert "spherical" in [kind.word for kind in robot.mechanism.types]
    assert all(row.passed for row in check_model(robot))


def test_ball_joints_of_a_robot_that_flies(tmp_path: Path) -> None:
    root = '<body name="root" pos="0 0 1"><freejoint/><geom size=".1"/><body name="torso"'
    text = BALLS.replace('<body name="torso"', root).replace("</worldbody>", "</body></worldbody>")
    robot = balls_agree(written(tmp_path, text))

    words = [kind.word for kind in robot.mechanism.types]
    assert (words[0], words.count("spherical")) == ("free", 4)
    assert all(row.passed for row in check_model(robot))


def test_a_ball_joint_can_be_held(tmp_path: Path) -> None:
    robot = derive(written(tmp_path, BALLS), lock={"spine": 0.0, "hip": 0.0})

    assert [kind.word for kind in robot.mechanism.types].count("spherical") == 2
    assert all(row.passed for row in check_model(robot))


def test_what_is_left_out_of_ball_joints_is_said(tmp_path: Path) -> None:
    robot = derive(written(tmp_path, BALLS))
    notes = robot.mechanism.notes

    assert (
        "q of ball joints is a quaternion x y z w, MuJoCo's w x y z: 'spine', 'shoulder', 'joint5', 'hip'"
        in notes
    )
    assert "limits of ball joints are not read: 'shoulder'" in notes
    assert any("'spine'" in note and "damping" in note for note in notes)


def test_a_drive_of_a_ball_joint_is_refused_by_name(tmp_path: Path) -> None:
    text = with_more("").replace('<joint name="j2"/>', '<joint name="shoulder" type="ball" armature=".1"/>')

    with pytest.raises(
        InputError, match="not modelled: armature of ball joint 'shoulder', a drive's inertia"
    ):
        load_robot(written(tmp_path, text))


BALL_BESIDE = """<body name="ball" pos="2 0 1"><freejoint name="fly"/><geom name="shape" size=".1"/></body>
<body name="wall" pos="0 5 0"><geom size=".1"/></body></worldbody>
<equality><weld name="glue" body1="ball"/></equality><sensor><framepos objtype="body" objname="ball"/></sensor>
<contact><exclude body1="ball" body2="a"/></contact>
<keyframe><key name="home" qpos="0 0 2 0 1 1 0 0 0"/></keyframe>"""


def test_of_two_robots_of_which_one_flies_root_names_the_one(tmp_path: Path) -> None:
    """All that is about the other one goes with it: constraints, keyframes, its free joint."""
    alone = with_more("").replace(
        "</worldbody>", '<body name="wall" pos="0 5 0"><geom size=".1"/></body></worldbody>'
    )
    path = written(tmp_path, with_more("").replace("</worldbody>", BALL_BESIDE))
    with pytest.raises(InputError) as refused:
        load_robot(path)
    said = "robot.xml: bodies 'a', 'ball' (free) move independently, and psdmc reads one robot"
    assert (refused.value.message, refused.value.hint) == (said, "choose one of them, such as --root a")

    robot = derive(path, root="a", snap=0.0)
    (tmp_path / "alone").mkdir()
    expected = derive(written(tmp_path / "alone", alone), snap=0.0)
    given = states(20, 2, 2)
    assert np.array_equal(robot.inverse_dynamics(*given), expected.inverse_dynamics(*given))
    standing(tmp_path / "alone" / "robot.xml")
    assert "left out by --root a: 'ball'" in robot.mechanism.notes
    assert robot.provenance["options"]["root"] == "a"
    robot.save(tmp_path / "m.npz")
    assert all(row.passed for row in check_model(load(tmp_path / "m.npz")))

    with pytest.raises(
        InputError, match="--root 'wall' is none of the bodies under the world that move"
    ) as refused:
        load_robot(path, root="wall")
    assert refused.value.hint == "choose one of 'a', 'ball' (free)"
    with pytest.raises(InputError, match="--root names a body of an MJCF"):
        load_robot(written(tmp_path, "<robot name='r'><link name='l'/></robot>", "r.urdf"), root="l")


def test_the_one_that_flies_can_be_chosen_too(tmp_path: Path) -> None:
    path = written(
        tmp_path,
        FLYING.replace(
            "</worldbody>", '<body name="door"><joint name="hinge"/><geom size=".1"/></body></worldbody>'
        ),
    )

    robot = derive(path, root="trunk", snap=0.0)

    alone = derive(written(tmp_path, FLYING, "alone.xml"), snap=0.0)
    assert robot.joint_names == alone.joint_names == ("root_joint", "hip_l", "hip_r")
    assert np.array_equal(robot.mechanism.parameters, alone.mechanism.parameters)


@pytest.mark.parametrize("text", [ARM, FLYING, GRIPPER, BALLS], ids=["arm", "flying", "gripper", "balls"])
def test_check_compares_with_mujocos_own_reading_of_the_file(text: str, tmp_path: Path) -> None:
    path = written(tmp_path, text)
    robot = derive(path)
    robot.save(tmp_path / "m.npz")

    for source in (None, load_robot(path)):
        row = next(row for row in check_model(load(tmp_path / "m.npz"), source) if row.against == MUJOCO)
        assert row.limit is not None, row.remark
        assert row.error < 1e-11


@pytest.mark.parametrize("options", [{"lock": {"elbow": 0.4}}, {"lock": {"slide": 0.2, "turn": 0.1}}, {"tip": "b"},
                                     {"gravity": (1.0, 2.0, -3.0)}, {"drive_inertia": (0.1, 0.2, 0.3, 0.4)}])  # fmt: skip
def test_check_gives_the_options_to_mujocos_reading_too(options: dict[str, Any], tmp_path: Path) -> None:
    row = next(row for row in check_model(derive(written(tmp_path, ARM), **options)) if row.against == MUJOCO)
    assert row.limit is not None, row.remark
    assert row.error < 1e-11


def moved_anchor(real: Callable[..., Any]) -> Callable[..., Any]:
    def read(writer: Any, j: int, origin: np.ndarray, *others: Any) -> Any:
        return real(writer, j, origin + 1e-4, *others)

    return read


def test_a_mistake_in_the_translation_is_noticed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The URDF that psdmc makes of an MJCF is what all others read: MuJoCo's own reading alone tells that it is another
    robot."""
    monkeypatch.setattr(to_urdf, "_at_reference", moved_anchor(to_urdf._at_reference))

    rows = check_model(derive(written(tmp_path, ARM)))

    assert [row.against for row in rows if not row.passed] == [MUJOCO]


def test_forces_and_drives_are_noted_by_name(tmp_path: Path) -> None:
    more = (
        FIXED.format("")
        + '<equality><weld name="off" body1="b" active="false"/></equality>'
        + '<actuator><motor name="m1" joint="j1" gear="30"/><position joint="j2"/></actuator><option density="1.2"/>'
    )
    text = with_more(more).replace('name="j1"', 'name="j1" damping="1" stiffness="2"')

    notes = load_robot(written(tmp_path, text)).mechanism.notes

    for note in (
        f"MJCF, as MuJoCo {mujoco.__version__} compiles it",
        "actuators are not modelled: efforts are those of the joints: 'm1', 'number 1'",
        "tendons without forces of their own are left out: 'rope'",
        "equality constraints that are not active are left out: 'off'",
        "springs of joints are not modelled: 'j1'",
        "forces of the medium (density, viscosity) are not modelled",
        "<dynamics> (damping, friction) of joints is not modelled: 'j1'",
    ):
        assert note in notes


def test_what_mujoco_refuses_is_said_in_a_line(tmp_path: Path) -> None:
    mesh = '<mujoco><asset><mesh name="m" file="missing.stl"/></asset><worldbody/></mujoco>'
    for text in (mesh, "<mujoco><worldbody><body></worldbody></mujoco>", "<mujoco><nonsense/></mujoco>"):
        with pytest.raises(InputError, match=r"robot\.xml: MuJoCo refuses it: ") as refused:
            load_robot(written(tmp_path, text))
        assert "\n" not in refused.value.message


def test_without_mujoco_the_remedy_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "mujoco", None)

    with pytest.raises(InputError, match="MuJoCo is not installed") as refused:
        load_robot(written(tmp_path, ARM))
    assert "pip install 'psdmc[mjcf]'" in str(refused.value.hint)


def test_options_go_before_what_the_file_says(tmp_path: Path) -> None:
    path = written(tmp_path, ARM)

    robot = load_robot(path, gravity=(0, 0, -1.6), drive_inertia=(0.1, 0.2, 0.3), lock={"elbow": 0.3}, snap=0)

    assert robot.mechanism.joint_names == ("turn", "slide", "joint3")
    assert robot.mechanism.parameters[:, 10].tolist() == [0.1, 0.2, 0.3]
    assert robot.mechanism.gravity.tolist() == [0, 0, -1.6]


def test_a_negative_armature_is_refused_and_not_left_out(tmp_path: Path) -> None:
    (tmp_path / "arm.xml").write_text(ARM.replace('name="elbow"', 'name="elbow" armature="-0.9"'))
    with pytest.raises(InputError, match=r"arm.xml: joint 'elbow': armature -0.9, expected 0 or more"):
        load_robot(tmp_path / "arm.xml")


REPEATED = "<mujoco><worldbody><body><joint name='a'/><geom size='.1'/>{}</body></worldbody></mujoco>"
INNER = "<replicate count='{}'><replicate count='{}'><geom size='.1'/></replicate></replicate>"


@pytest.mark.parametrize(
    "part",
    [
        "<replicate count='1000000'/>",
        INNER.format(100, 100),
        "<replicate count='3001'><geom size='.1'/></replicate>",
        "<composite type='cable' count='2000 2 1'/>",
        "<replicate count='80'><include file='more.xml'/></replicate>",
    ],
)
def test_more_copies_than_a_compiler_takes_are_refused_before_it_begins(tmp_path: Path, part: str) -> None:
    sixty = "<geom size='.1'/>" * 60
    (tmp_path / "more.xml").write_text(f"<mujocoinclude>{sixty}</mujocoinclude>")
    (tmp_path / "robot.xml").write_text(REPEATED.format(part))
    with pytest.raises(InputError, match=r"robot.xml: <replicate>.* ask for .* expected 3000 at most"):
        load_robot(tmp_path / "robot.xml")


@pytest.mark.parametrize("name", ["/dev/zero", "..", "missing.xml", "a&#0;b", "fifo"])
def test_what_is_included_and_is_no_file_is_mujocos_matter(tmp_path: Path, name: str) -> None:
    os.mkfifo(tmp_path / "fifo")
    (tmp_path / "robot.xml").write_text(REPEATED.format(f"<include file='{name}'/>"))
    refuse_many_copies(tmp_path / "robot.xml", "robot.xml")


def test_an_included_file_is_not_longer_than_a_robot_s(tmp_path: Path) -> None:
    (tmp_path / "more.xml").write_text(" " * (MAX_BYTES + 1))
    (tmp_path / "robot.xml").write_text(REPEATED.format("<include file='more.xml'/>"))
    with pytest.raises(InputError, match=r"robot.xml: it includes 'more.xml': more than 4 MiB"):
        load_robot(tmp_path / "robot.xml")


def test_copies_that_cannot_be_counted_are_refused(tmp_path: Path) -> None:
    (tmp_path / "robot.xml").write_text(REPEATED.format("<!-- -- --><replicate count='9'/>"))
    with pytest.raises(InputError, match="cannot be counted"):
        load_robot(tmp_path / "robot.xml")


def test_some_copies_are_a_robot_and_loose_comments_are_mujocos_matter(tmp_path: Path) -> None:
    (tmp_path / "robot.xml").write_text(REPEATED.format("<!-- a -- b -->"))
    (tmp_path / "brush.xml").write_text(REPEATED.format(INNER.format(10, 20)))
    plain, brush = (load_robot(tmp_path / name).chain for name in ("robot.xml", "brush.xml"))
    assert brush.parameters[0, 0] == pytest.approx(201 * plain.parameters[0, 0])
