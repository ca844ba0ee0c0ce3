"""Drives, forces and switches of newer MJCF files: torques are MuJoCo's, or the word is refused or noted by name."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
import pytest
from test_mjcf import agrees, joint_numbers, states, torques, written

from psdmc.compiler import derive
from psdmc.errors import InputError
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.robot.load import load_robot
from psdmc.robot.mjcf.mujoco_model import kept_warnings

mujoco = pytest.importorskip("mujoco")

ARM = """<mujoco>{top}<worldbody><body name="a" pos="0 0 .3"><joint name="j1" axis="0 1 0" {j1}/>
<geom size=".1" pos=".1 .02 .03"/>
<body name="b" pos=".3 .1 0" euler="10 20 30">{b}<joint name="j2" axis="1 0 .2"/>
<geom type="box" size=".1 .2 .05" pos=".1 0 0"/></body></body></worldbody>{end}</mujoco>"""
FLYING = '<mujoco><worldbody><body name="a">{joint}<geom size=".1"/></body></worldbody><actuator>{motor}</actuator></mujoco>'
TENDON = '<tendon><fixed name="rope" {}><joint joint="j1" coef="2"/></fixed></tendon>'


def arm(top: str = "", j1: str = "", b: str = "", end: str = "") -> str:
    return ARM.format(top=top, j1=j1, b=b, end=end)


def as_mujoco(path: Path) -> DynamicsModel:
    """psdmc's torques are those of MuJoCo's model of the file, nothing of it switched off but contacts."""
    robot, model = derive(path, snap=0.0), mujoco.MjModel.from_xml_path(str(path))
    model.opt.disableflags = int(model.opt.disableflags) | int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
    order = [int(model.jnt_dofadr[j]) for j in joint_numbers(model, robot)]
    given = states(20, robot.nq, robot.nv)
    theirs = [np.zeros_like(own) for own in given]
    for whole, own in zip(theirs, given, strict=True):
        whole[:, order] = own
    agrees(robot.inverse_dynamics(*given), torques(model, *theirs)[:, order])
    return robot


def needs(attribute: str) -> None:
    if not hasattr(mujoco.MjModel, attribute):
        pytest.skip(f"this MuJoCo has no {attribute}")


@pytest.mark.parametrize(
    ("actuators", "inertia"),
    [
        ('<motor joint="j1" gear="-30" armature=".01"/>', 9.5),
        ('<motor jointinparent="j1" gear="3" armature=".1"/><motor joint="j1" gear="2" armature=".5"/>', 3.4),
        ('<dcmotor joint="j1" gear="3" motorconst=".1" resistance="1" armature=".02"/>', 0.68),
    ],
)
def test_armatures_of_actuators_move_with_their_joint(actuators: str, inertia: float, tmp_path: Path) -> None:
    needs("actuator_armature")
    text = arm(j1='armature=".5"', end=f"<actuator>{actuators}</actuator>")
    robot = as_mujoco(written(tmp_path, text))

    assert robot.mechanism.parameters[0, 10] == pytest.approx(inertia, rel=1e-14)


def test_armatures_of_actuators_elsewhere_are_refused_by_name(tmp_path: Path) -> None:
    needs("actuator_armature")
    on_tendon = arm(
        end=TENDON.format("") + '<actuator><motor tendon="rope" gear="3" armature=".1"/></actuator>'
    )
    with pytest.raises(InputError, match=r"tendon 'rope' \(armature of an actuator\)"):
        load_robot(written(tmp_path, on_tendon))
    negative = arm(end='<actuator><motor name="m" joint="j1" gear="3" armature="-.1"/></actuator>')
    with pytest.raises(InputError, match=r"actuator 'm': armature -0.9 at its joint, expected 0 or more"):
        load_robot(written(tmp_path, negative))
    two = '<actuator><motor joint="j1" gear="3e4" armature=".1"/><motor joint="j1" gear="3e4" armature=".1"/></actuator>'
    for actuators, inertia in ((two, r"1\.8e\+08"), (two.replace("3e4", "1e300"), "inf")):
        with pytest.raises(InputError, match=f"joint 'j1': drive inertia {inertia} is out of range"):
            load_robot(written(tmp_path, arm(end=actuators)))
    ball = FLYING.format(
        joint='<joint name="j" type="ball"/>', motor='<motor joint="j" gear="1 0 0" armature=".1"/>'
    )
    with pytest.raises(InputError, match="armature of ball joint 'j'"):
        load_robot(written(tmp_path, ball))


def test_armature_of_a_free_joints_actuator_is_refused(tmp_path: Path) -> None:
    needs("actuator_armature")
    text = FLYING.format(joint='<freejoint name="root"/>', motor='<motor joint="root" armature=".1"/>')
    with pytest.raises(InputError, match=r"free joint 'root' has armature 0\.1, which psdmc does not model"):
        load_robot(written(tmp_path, text))


WALKING = """<mujoco><default><joint armature=".5"/></default><worldbody><body name="trunk" pos="0 0 1">{}
<geom type="box" size=".3 .2 .1" pos=".05 .01 0"/><body name="leg" pos=".3 .2 0" euler="0 10 0">
<joint name="hip" axis="0 1 0"/><geom type="capsule" size=".03" fromto="0 0 0 0 0 -.4"/></body></body>
</worldbody></mujoco>"""


def test_armature_of_a_free_joint_is_refused_where_it_would_enter_mujocos_mass_matrix(tmp_path: Path) -> None:
    """<freejoint> takes none from the defaults: there psdmc's mass matrix is MuJoCo's, with the other joints' armature."""
    heavy = written(tmp_path, WALKING.format('<joint name="root" type="free"/>'), "heavy.xml")
    plain = written(tmp_path, WALKING.format('<freejoint name="root"/>'))
    with pytest.raises(InputError) as refused:
        load_robot(heavy)
    said = "heavy.xml: free joint 'root' has armature 0.5, which psdmc does not model for free joints"
    assert refused.value.message == said
    assert refused.value.hint == (
        'set armature="0" there, or write <freejoint>, which takes none from the defaults'
    )

    robot = derive(plain, snap=0.0)
    q = np.array([0.3, -0.2, 0.9, 0.0, 0.0, 0.0, 1.0, 0.7])
    expected = mass_matrix(plain, q[[0, 1, 2, 6, 3, 4, 5, 7]])
    assert robot.mass_matrix(q) == pytest.approx(expected, rel=1e-12, abs=1e-13)
    assert mass_matrix(heavy, q[[0, 1, 2, 6, 3, 4, 5, 7]])[0, 0] == pytest.approx(expected[0, 0] + 0.5)


def mass_matrix(path: Path, qpos: np.ndarray) -> np.ndarray:
    """MuJoCo's, at an upright root, where its linear rates are along the root's own axes too."""
    model = mujoco.MjModel.from_xml_path(str(path))
    data, full = mujoco.MjData(model), np.zeros((model.nv, model.nv))
    data.qpos[:] = qpos
    mujoco.mj_forward(model, data)
    try:
        mujoco.mj_fullM(model, full, data.qM)
    except (AttributeError, TypeError):
        mujoco.mj_fullM(model, data, full)
    return full


@pytest.mark.parametrize("flag", ["equality", "constraint"])
@pytest.mark.parametrize("kind", ['<weld name="e" body1="b"/>', '<joint name="e" joint1="j1" joint2="j2"/>'])
def test_constraints_that_are_switched_off_do_not_act(flag: str, kind: str, tmp_path: Path) -> None:
    top, end = f'<option><flag {flag}="disable"/></option>', f"<equality>{kind}</equality>"
    robot = as_mujoco(written(tmp_path, arm(top=top, end=end)))

    assert robot.nv == 2
    assert "equality constraints that are not active are left out: 'e'" in robot.mechanism.notes


def test_gravity_that_is_switched_off_does_not_act(tmp_path: Path) -> None:
    robot = as_mujoco(written(tmp_path, arm(top='<option><flag gravity="disable"/></option>')))

    assert robot.mechanism.gravity.tolist() == [0.0, 0.0, 0.0]


def test_a_joint_that_follows_two_is_refused(tmp_path: Path) -> None:
    rules = '<joint joint1="j1" joint2="j2" polycoef="0 .5 0 0 0"/><joint joint1="j1" joint2="j2"/>'
    with pytest.raises(InputError, match="2 equality constraints of joint 'j1'"):
        load_robot(written(tmp_path, arm(end=f"<equality>{rules}</equality>")))


def test_inertia_without_mass_turns_with_its_body(tmp_path: Path) -> None:
    disk = '<body name="disk"><inertial mass="0" pos="0 0 0" diaginertia="1 1 1.5"/></body>'
    plain, heavy = (as_mujoco(written(tmp_path, arm(b=part))) for part in ("", disk))

    q = np.zeros(2)
    assert not np.allclose(plain.mass_matrix(q), heavy.mass_matrix(q), rtol=1e-2)


@pytest.mark.parametrize("law", ['"-1"', '"0 1"', '"0 0 2"'])
@pytest.mark.parametrize("word", ["damping", "stiffness"])
def test_forces_of_any_law_are_noted_or_refused(word: str, law: str, tmp_path: Path) -> None:
    if " " in law:
        needs("dof_dampingpoly")
    notes = load_robot(written(tmp_path, arm(j1=f"{word}={law}"))).mechanism.notes

    of_what = {
        "damping": "damping and friction that is negative, not linear or of a free joint is not modelled",
        "stiffness": "springs of joints are not modelled",
    }
    assert f"{of_what[word]}: 'j1'" in notes
    with pytest.raises(InputError, match=rf"tendon 'rope' \({word}\)"):
        load_robot(written(tmp_path, arm(end=TENDON.format(f"{word}={law}"))))


@pytest.mark.parametrize("word", ["damping", "frictionloss"])
def test_resistance_of_a_free_joint_is_noted(word: str, tmp_path: Path) -> None:
    text = FLYING.format(joint=f'<joint name="root" type="free" {word}="1"/>', motor="")
    note = "damping and friction that is negative, not linear or of a free joint is not modelled: 'root'"
    assert note in load_robot(written(tmp_path, text)).mechanism.notes


def test_damping_of_actuators_is_noted(tmp_path: Path) -> None:
    needs("actuator_damping")
    text = arm(end='<actuator><motor name="m" joint="j1" damping="1"/><motor joint="j2"/></actuator>')
    assert "damping of actuators is not modelled: 'm'" in load_robot(written(tmp_path, text)).mechanism.notes


@pytest.mark.parametrize(("least", "most", "effort"), [(-40, 30, 30.0), (-20, 30, 20.0), (0, 30, 30.0)])
def test_efforts_of_two_directions_are_limited_to_the_smaller(
    least: float, most: float, effort: float, tmp_path: Path
) -> None:
    """Motions that are planned with this limit can be run in both directions."""
    mechanism = load_robot(
        written(tmp_path, arm(j1=f'range="-9 9" actuatorfrcrange="{least} {most}"'))
    ).mechanism

    assert mechanism.joints[0].limits.effort == effort
    assert (
        "limits of efforts differ by direction, the smaller that is not zero is taken for both: 'j1'"
        in mechanism.notes
    ) == (-least != most)


def test_an_infinite_gravity_is_refused_unless_another_is_given(tmp_path: Path) -> None:
    path = written(tmp_path, arm(end='<option gravity="0.3 infinity -9.5"/>'))
    with pytest.raises(InputError, match=r"gravity 0\.3 inf -9\.5 is not finite"):
        load_robot(path)
    assert load_robot(path, gravity=(0.0, 0.0, -1.6)).mechanism.gravity.tolist() == [0.0, 0.0, -1.6]


def test_mujoco_s_python_warnings_are_kept_and_those_of_others_are_not() -> None:
    with kept_warnings(FakeMujoco()) as said:
        warnings.warn("singular,\n at DOF 6", UserWarning, stacklevel=1)
    assert said == ["singular, at DOF 6"]
    with pytest.warns(RuntimeWarning, match="of another"), kept_warnings(FakeMujoco()) as said:
        warnings.warn("of another", RuntimeWarning, stacklevel=1)
    assert said == []


class FakeMujoco:
    """MuJoCo's callback for warnings, which no one calls."""

    def get_mju_user_warning(self) -> None:
        return None

    def set_mju_user_warning(self, callback: object) -> None:
        pass
