"""check reads the file itself: mistakes of psdmc's own placements, axes, frames and gravity are noticed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from bundled import ROBOTS
from slow_cases import slow_but_for
from urdf_text import INERTIAL, joint, link, urdf

from psdmc.derivation.derive import derive_model, provenance_of
from psdmc.functions import RECIPES
from psdmc.robot import dh
from psdmc.robot.load import LoadedRobot, load_robot, load_robot_text
from psdmc.robot.mechanism import Placement
from psdmc.robot.placement import snap_axis
from psdmc.robot.urdf import urdf_draft
from psdmc.robot.urdf.urdf_draft import placement_of
from psdmc.verification.check import MUJOCO, CheckRow, check_model, readers

OF_THE_TIP = {
    recipe.title
    for recipe in RECIPES.values()
    if {"frames", "contacts", "contact_rows", "constraint_rows"}
    & {axis for each in (*recipe.signature.inputs, *recipe.signature.outputs) for axis in each.axes}
} | {"Jacobian"}
"""Functions that a frame's place matters to."""


def oblique_urdf(body: str = INERTIAL, kind: str = "continuous") -> str:
    """A base turned in the root, three joints about oblique axes, and a tool."""
    links = [link(name, body) for name in ("root", "base", "a", "b", "c", "tool")]
    joints = [
        ("mount", "fixed", "root", "base", "0 0 0.3", "0.4 -0.2 0.1", "0 0 1"),
        ("j1", "revolute", "base", "a", "0.1 0.2 0.3", "0.4 0.1 -0.3", "0 1 0"),
        ("j2", "prismatic", "a", "b", "-0.1 0.3 0.1", "-0.2 0.7 0.1", "-0.3 0.5 -0.7"),
        ("j3", kind, "b", "c", "0.2 0 0.4", "1.1 0 0.2", "1 0 0.5"),
        ("flange", "fixed", "c", "tool", "0 0.1 0.2", "0.3 0.2 0.1", "0 0 1"),
    ]
    rows = [
        joint(name, parent, child, kind=kind, xyz=xyz, rpy=rpy, axis=axis, extra="")
        for name, kind, parent, child, xyz, rpy, axis in joints
    ]
    return urdf(*links, *rows, name="oblique")


def oblique() -> LoadedRobot:
    return load_robot_text(oblique_urdf(), "urdf", source_name="oblique.urdf", base="base")


def rounded() -> LoadedRobot:
    return load_robot(ROBOTS / "rounded_arm.urdf")


def scara() -> LoadedRobot:
    return load_robot(ROBOTS / "scara.toml")


def kr6() -> LoadedRobot:
    return load_robot(ROBOTS / "kr6.toml")


def modified() -> LoadedRobot:
    text = (ROBOTS / "kr6.toml").read_text(encoding="utf-8").replace('"standard"', '"modified"')
    return load_robot_text(text, "dh", source_name="modified.toml")


def checked(make: Callable[[], LoadedRobot]) -> tuple[CheckRow, ...]:
    loaded = make()
    return check_model(derive_model(loaded.chain, expand=False, provenance=provenance_of(loaded)))


ALL = [oblique, rounded, scara, kr6, modified]


@pytest.mark.parametrize("make", ALL)
def test_right_robots_pass(make: Callable[[], LoadedRobot]) -> None:
    rows = checked(make)

    assert all(row.passed for row in rows), rows
    placed = next(row for row in rows if row.name.startswith("placements"))
    assert placed.error < 1e-14


def shifted(place: Placement, by: float) -> Placement:
    return Placement(place.rotation, place.translation + np.array([0.0, 0.0, by]))


def offset_origin(joint, snap, snaps, segment):
    """The second joint of the chain 1 mm off."""
    place = placement_of(joint.origin, snap)
    return shifted(place, 1e-3) if segment == 1 else place


def transposed_origin(joint, snap, snaps, segment):
    place = placement_of(joint.origin, snap)
    return Placement(place.rotation.T, place.translation)


def turned_origin(joint, snap, snaps, segment):
    """Every joint after the first 1e-3 rad off, about its z."""
    place = placement_of(joint.origin, snap)
    c, s = np.cos(1e-3), np.sin(1e-3)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    return Placement(place.rotation @ turn if segment > 0 else place.rotation, place.translation)


def reversed_axis(axis, snap):
    found, angle = snap_axis(axis, snap)
    return -found, angle


def tilted_axis(axis, snap):
    found, _ = snap_axis(axis, snap)
    tilted = found + 1e-3 * np.roll(found, 1)
    return tilted / np.linalg.norm(tilted), 0.0


URDF_MISTAKES = {
    "offset": ("_origin", offset_origin),
    "transposed": ("_origin", transposed_origin),
    "turned": ("_origin", turned_origin),
    "reversed axis": ("snap_axis", reversed_axis),
    "tilted axis": ("snap_axis", tilted_axis),
}


URDF_CASES = [(make, mistake) for make in (oblique, rounded) for mistake in URDF_MISTAKES]


@pytest.mark.parametrize(
    ("make", "mistake"),
    slow_but_for([*URDF_CASES[: len(URDF_MISTAKES)], URDF_CASES[-1]], URDF_CASES, spread=True),
)
def test_a_mistake_in_placing_a_urdfs_joints_is_noticed(make, mistake: str, monkeypatch) -> None:
    monkeypatch.setattr(urdf_draft, *URDF_MISTAKES[mistake])

    rows = checked(make)

    assert not next(row for row in rows if row.name.startswith("placements")).passed
    mujoco = next(row for row in rows if row.against == MUJOCO)
    if mujoco.limit is not None:
        assert not mujoco.passed


def test_a_tip_in_the_wrong_place_is_noticed_though_no_torque_tells(monkeypatch) -> None:
    real = urdf_draft._placed

    def misplaced(route, snap):
        placed = real(route, snap)
        tip = replace(placed.tip, placement=shifted(placed.tip.placement, 1e-3))
        return replace(placed, tip=tip)

    monkeypatch.setattr(urdf_draft, "_placed", misplaced)

    for make in (oblique, rounded):
        failed = {row.name for row in checked(make) if not row.passed}
        assert "placements of links and tip" in failed
        assert failed <= {"placements of links and tip", *OF_THE_TIP}


def test_gravity_turned_the_wrong_way_is_noticed(monkeypatch) -> None:
    real = urdf_draft._base_rotation

    def transposed(route, snap):
        rotation, snaps = real(route, snap)
        return rotation.T, snaps

    monkeypatch.setattr(urdf_draft, "_base_rotation", transposed)

    failed = [row.name for row in checked(oblique) if not row.passed]
    assert {"gravity", "gravity in the base frame"} <= set(failed)


def reversed_twist(axis, angle):
    return dh_about(axis, -angle if axis == 0 else angle)


def offset_turn(axis, angle):
    return dh_about(axis, angle + 1e-3 if axis == 2 else angle)


def shifted_row(real):
    def read(text, source):
        robot = real(text, source)
        rows = (robot.joints[0], replace(robot.joints[1], a=robot.joints[1].a + 1e-3), *robot.joints[2:])
        return replace(robot, joints=rows)

    return read


dh_about = dh.about


@pytest.mark.parametrize("make", slow_but_for([modified], [kr6, modified]))
@pytest.mark.parametrize("mistake", ["twist", "turn", "offset", "convention"])
def test_a_mistake_in_placing_a_dh_tables_joints_is_noticed(make, mistake: str, monkeypatch) -> None:
    if mistake == "convention":
        real = dh.read_dh
        other = {"standard": "modified", "modified": "standard"}
        monkeypatch.setattr(
            dh, "read_dh", lambda *a: replace(real(*a), convention=other[real(*a).convention])
        )
    elif mistake == "offset":
        monkeypatch.setattr(dh, "read_dh", shifted_row(dh.read_dh))
    else:
        monkeypatch.setattr(dh, "about", reversed_twist if mistake == "twist" else offset_turn)

    assert "placements of links and tip" in [row.name for row in checked(make) if not row.passed]


def test_a_snap_may_not_excuse_what_it_does_not_say(monkeypatch) -> None:
    """1e-3 rad in the segment after the one that was snapped, and more than --snap allows in that one."""
    real = urdf_draft._record

    def boast(snaps, where, angle, segment):
        real(snaps, where, max(angle, 1e-2) if segment == 2 else angle, segment)

    monkeypatch.setattr(urdf_draft, "_origin", turned_origin_that_records)
    monkeypatch.setattr(urdf_draft, "_record", boast)

    assert not all(row.passed for row in checked(rounded))


def turned_origin_that_records(joint, snap, snaps, segment):
    urdf_draft._record(snaps, "boast", 1e-6, segment)
    return turned_origin(joint, snap, snaps, segment)


def test_mujoco_reads_the_file_too() -> None:
    pytest.importorskip("mujoco")
    rows = checked(oblique)
    row = next(row for row in rows if row.against == MUJOCO)

    assert row.error < 1e-12
    assert "MuJoCo" in readers(rows)


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (scara, "not compared: MuJoCo reads no DH tables"),
        (
            lambda: load_robot_text(oblique_urdf(INERTIAL.replace('izz="0.025"', 'izz="0.25"')), "urdf"),
            "not compared: MuJoCo refuses it: ",
        ),
        (
            lambda: load_robot_text(oblique_urdf().replace('rpy="1.1 0 0.2"', 'quat_xyzw="0 0 0 1"'), "urdf"),
            "not compared: MuJoCo reads no quat_xyzw",
        ),
        (
            lambda: load_robot_text(oblique_urdf(INERTIAL.replace('value="1.5"', 'value="0 "')), "urdf"),
            "not compared: MuJoCo drops inertia without mass, as link 'a' has it",
        ),
        (
            lambda: load_robot_text(oblique_urdf(), "urdf", assume_zero=("c:mx",)),
            "not compared: MuJoCo needs all inertial parameters",
        ),
    ],
)
def test_what_mujoco_does_not_read_is_said(make, said: str) -> None:
    pytest.importorskip("mujoco")
    rows = checked(make)
    row = next(row for row in rows if row.against == MUJOCO)

    assert row.remark.startswith(said)
    assert row.passed
    assert "MuJoCo" not in readers(rows)


def test_a_last_link_without_inertia_is_no_failure() -> None:
    text = oblique_urdf()
    for name in ("c", "tool"):
        text = text.replace(f'<link name="{name}">{INERTIAL}</link>', f'<link name="{name}"/>')

    rows = checked(lambda: load_robot_text(text, "urdf"))

    assert all(row.passed for row in rows), rows
    forward = next(row for row in rows if row.against == "aba")
    assert forward.remark == "not compared: the mass matrix is singular"


def test_without_mujoco_it_is_said(monkeypatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "mujoco", None)

    row = next(row for row in checked(oblique) if row.against == MUJOCO)

    assert row.remark == "not compared: MuJoCo is not installed"


def test_drive_inertia_and_gravity_of_the_caller_reach_both_readers() -> None:
    def make() -> LoadedRobot:
        options = {"gravity": (1.0, 2.0, -3.0), "drive_inertia": (0.3, 0.2, 0.1)}
        return load_robot_text(oblique_urdf(), "urdf", base="base", **options)  # type: ignore[arg-type]

    assert all(row.passed for row in checked(make))
