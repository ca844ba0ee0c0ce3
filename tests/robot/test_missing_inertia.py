"""Moving links without <inertial>: which are named, what is said of them, and which words make them unknown."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from small_robots import load_dh, load_urdf
from urdf_text import INERTIAL, joint, link

from psdmc.errors import InputError
from psdmc.model.chain_json import chain_from_json, chain_to_json
from psdmc.robot.load import load_robot

ZERO = '<inertial><mass value="0"/><inertia ixx="0" iyy="0" izz="0" ixy="0" ixz="0" iyz="0"/></inertial>'


def arm(*inertials: str) -> tuple[str, ...]:
    """Links link1, link2 and so on with these <inertial>s, each on the one before, and a frame on the last."""
    parts = [link("link0")]
    for k, inertial in enumerate(inertials, start=1):
        parts += [link(f"link{k}", inertial), joint(f"j{k}", f"link{k - 1}", f"link{k}")]
    return (*parts, link("tool0", ""), joint("flange", f"link{len(inertials)}", "tool0", kind="fixed"))


def test_a_massless_link_in_the_middle_is_named_with_its_option() -> None:
    chain = load_urdf(*arm(INERTIAL, "", INERTIAL)).chain

    assert chain.massless == ("link2",)
    assert chain.notes == (
        "warning: link 'link2' has no <inertial>: treated as massless. Add <inertial>, or keep its parameters as unknowns "
        "with --unknown link2.",
    )


def test_joints_that_move_no_inertia_are_named() -> None:
    (note,) = load_urdf(*arm(INERTIAL, "", "")).chain.notes

    assert note == (
        "warning: 2 links have no <inertial> and are treated as massless: 'link2', 'link3'. Joints 'j2', 'j3' move no "
        "inertia: forward dynamics cannot be generated. Add <inertial>, or type --unknown link2,link3 to keep their "
        "parameters as unknowns."
    )


def test_a_joint_with_a_drive_inertia_moves_one() -> None:
    (note,) = load_urdf(*arm(INERTIAL, ""), drive_inertia=[0.1, 0.2]).chain.notes

    assert "moves no inertia" not in note


def test_of_many_links_three_are_named() -> None:
    (note,) = load_urdf(*arm(*[""] * 5, INERTIAL)).chain.notes

    assert note == (
        "warning: 5 links have no <inertial> and are treated as massless: 'link1', 'link2', 'link3' and 2 more. "
        "Add <inertial>, or type --unknown missing (all such links) to keep their parameters as unknowns."
    )


def test_a_body_is_a_link_with_all_that_is_fixed_to_it() -> None:
    """A link without <inertial> that carries a fixed one with mass is a body of mass."""
    fixed = (link("shell"), joint("glue", "link2", "shell", kind="fixed"))
    chain = load_urdf(*arm(INERTIAL, ""), *fixed).chain

    assert chain.massless == ()
    assert not chain.notes


def test_a_link_whose_inertial_is_zero_is_massless_without_a_warning() -> None:
    chain = load_urdf(*arm(INERTIAL, ZERO, INERTIAL)).chain

    assert chain.massless == ()
    assert chain.notes == ("link 'link2': assumed zero: m",)
    assert np.isnan(load_urdf(*arm(INERTIAL, ZERO), unknown=("link2",)).chain.parameters[1, :10]).all()


def test_a_frame_with_an_inertial_of_zeros_does_not_hide_a_link_without_one() -> None:
    parts = arm(INERTIAL, "")
    chain = load_urdf(*parts, link("tip", ZERO), joint("end", "link2", "tip", kind="fixed")).chain

    assert chain.massless == ("link2",)
    assert "--unknown link2" in chain.notes[0]


def test_a_file_of_zeros_is_no_file_without_inertia() -> None:
    """What the file states is known."""
    chain = load_urdf(*arm(ZERO, "")).chain
    assert not chain.parameters[0].any()
    assert np.isnan(chain.parameters[1, :10]).all()


def test_links_of_a_locked_joint_belong_to_the_body_that_carries_them() -> None:
    chain = load_urdf(*arm(INERTIAL, "", ""), lock={"j3": 0.5}, unknown=("link3",)).chain

    assert chain.massless == ()
    assert np.isnan(chain.parameters[:, 0]).tolist() == [False, True]


def test_a_link_that_does_not_move_cannot_be_unknown() -> None:
    for name, said in {
        "link0": "--unknown link0: link 'link0' does not move, so its inertia has no effect",
        "knee\x1b": "--unknown knee\\x1b: there is no link 'knee\\x1b'",
    }.items():
        with pytest.raises(InputError) as refused:
            load_urdf(*arm(INERTIAL, ""), unknown=(name,))
        assert refused.value.message == f"arm.urdf: {said}"
        assert refused.value.hint == (
            "moving links: 'link1', 'link2', 'tool0'; --unknown all is all of them, --unknown missing those without "
            "<inertial>"
        )


def test_of_a_dh_table_nothing_is_named() -> None:
    with pytest.raises(InputError) as refused:
        load_dh('name = "one"', unknown=("link1",))
    assert refused.value.message == "arm.toml: --unknown names links of a URDF"
    assert refused.value.hint == "in a DH table leave out what is unknown of a link"


def test_words_of_the_option_are_texts() -> None:
    with pytest.raises(InputError, match="unknown is 'all', expected links' names"):
        load_urdf(*arm(INERTIAL), unknown="all")


def test_model_files_keep_massless_links_and_are_as_before_without_any() -> None:
    with_one, without = load_urdf(*arm(INERTIAL, "")).chain, load_urdf(*arm(INERTIAL)).chain

    assert chain_from_json(chain_to_json(with_one)).massless == ("link2",)
    assert "massless" not in chain_to_json(without)
    with pytest.raises(ValueError, match="massless"):
        chain_from_json(chain_to_json(with_one) | {"massless": [3]})


def mjcf(folder: Path, *masses: str) -> Path:
    """A chain of bodies with these geoms, the first on two joints."""
    bodies = "".join(
        f'<body name="b{k}" pos="0.1 0 0.2"><joint name="j{k}" axis="0 1 0"/>'
        + ('<joint name="cross" axis="1 0 0"/>' if k == 1 else "")
        + geom
        for k, geom in enumerate(masses, start=1)
    )
    path = folder / "arm.xml"
    path.write_text(f"<mujoco><worldbody>{bodies}{'</body>' * len(masses)}</worldbody></mujoco>")
    return path


GEOM = '<geom type="box" size="0.1 0.05 0.02" mass="2"/>'


def test_bodies_that_mujoco_refuses_for_want_of_mass_are_massless(tmp_path: Path) -> None:
    """Nothing is said of the link between a body's two joints."""
    mujoco = pytest.importorskip("mujoco")
    path = mjcf(tmp_path, GEOM, "", GEOM)
    with pytest.raises(ValueError, match="larger than mjMINVAL"):
        mujoco.MjModel.from_xml_path(str(path))
    chain = load_robot(path).chain

    assert chain.massless == ("b2",)
    assert [note for note in chain.notes if note.startswith("warning: ")] == [
        "warning: link 'b2' has no <inertial>: treated as massless. Add <inertial>, or keep its parameters as unknowns with "
        "--unknown b2."
    ]
    assert chain.parameters[:, 0].tolist() == [0.0, 2.0, 0.0, 2.0]
    assert np.isnan(load_robot(path, unknown=("b2",)).chain.parameters[2, :10]).all()


def test_an_mjcf_without_any_mass_is_of_unknown_inertia(tmp_path: Path) -> None:
    pytest.importorskip("mujoco")
    chain = load_robot(mjcf(tmp_path, "", "")).chain

    assert np.isnan(chain.parameters[:, 0]).tolist() == [False, True, True]
    assert chain.massless == ()


def test_an_mjcf_whose_mass_is_a_point_is_refused_as_mujoco_does(tmp_path: Path) -> None:
    pytest.importorskip("mujoco")
    point = '<inertial pos="0 0 0" mass="1" diaginertia="0 0 0"/>'
    with pytest.raises(InputError, match="mass and inertia of moving bodies"):
        load_robot(mjcf(tmp_path, point, ""))


def test_xacro_is_read_alike(tmp_path: Path) -> None:
    pytest.importorskip("xacro")
    body = "".join(arm(INERTIAL, "", INERTIAL))
    path = tmp_path / "arm.urdf.xacro"
    path.write_text(
        f'<robot name="arm" xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:property name="a" value="1"/>{body}</robot>'
    )
    assert load_robot(path).chain.massless == ("link2",)
