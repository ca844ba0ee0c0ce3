"""Contacts of a robot: how they are declared, kept and refused."""

from __future__ import annotations

from pathlib import Path

import pytest
from bundled import robot_path
from command_line import typed
from test_named_frames import TOOL, URDF

import psdmc
from psdmc.errors import InputError
from psdmc.model.chain_json import chain_from_json, chain_to_json
from psdmc.robot.load import load_robot_text

ARM = {"base": "pedestal", "tip": "hand"}


def contacts_of(**options: object) -> list[tuple[str, int]]:
    robot = load_robot_text(URDF, "urdf", **ARM, **options).mechanism
    return [(frame.name, frame.rows) for frame in robot.contacts]


def test_every_named_frame_is_a_point_where_no_contacts_are_declared() -> None:
    assert contacts_of() == [("hand", 3)]
    assert contacts_of(frames=["eye", "camera"]) == [("eye", 3), ("camera", 3)]


def test_contacts_are_points_or_surfaces_and_become_frames() -> None:
    assert contacts_of(contacts=["camera", "eye:6", "tcp:3"]) == [("camera", 3), ("eye", 6), ("tcp", 3)]
    robot = load_robot_text(URDF, "urdf", **ARM, frames=["tcp", "camera"], contacts=["camera:6", "eye"])
    assert [(frame.name, frame.rows) for frame in robot.mechanism.frames] == [
        ("tcp", 0),
        ("camera", 6),
        ("eye", 3),
    ]
    again = load_robot_text(URDF, "urdf", **robot.options.as_json())
    assert again.options == robot.options
    assert again.mechanism.rows_of_contacts == (6, 3)


def test_a_frame_that_an_option_places_can_be_a_contact() -> None:
    assert contacts_of(contacts=["eye", "tool:6"], tool=TOOL) == [("eye", 3), ("tool", 6)]
    with pytest.raises(InputError, match=r"order 'tool', 'eye', the same frames in the order 'eye', 'tool'"):
        contacts_of(contacts=["tool", "eye"], tool=TOOL)
    with pytest.raises(InputError, match=r"frame 'tool' is no link"):
        contacts_of(contacts=["tool"])


def test_model_files_keep_contacts_and_say_nothing_of_points_that_are_not_declared(tmp_path: Path) -> None:
    model = psdmc.derive(robot_path("scara"), contacts=["link2", "link4:6"])
    model.save(tmp_path / "scara.npz")
    again = psdmc.load(tmp_path / "scara.npz")
    assert again.contacts == model.contacts == {"link2": 3, "link4": 6}
    assert again.content_hash == model.content_hash
    plain = chain_to_json(psdmc.derive(robot_path("scara"), frames=["link2", "link4"]).mechanism)
    assert all("rows" not in frame for frame in plain["frames"])
    for rows in (2, [], 9):
        plain["frames"][0]["rows"] = rows
        with pytest.raises(ValueError, match="rows"):
            chain_from_json(plain)


@pytest.mark.parametrize(
    ("contacts", "message"),
    [
        (["knee"], r"frame 'knee' is no link of the file"),
        (["knee:6"], r"frame 'knee' is no link of the file"),
        (["tcp:x"], r"frame 'tcp:x' is no link of the file"),
        (["wall"], r"'wall' is fixed to the root: no joint moves it"),
        (["tcp", "tcp:6"], r"contact 'tcp' is named twice"),
        (["tcp:4"], r"contact 'tcp:4' has '4' rows, expected 3 or 6"),
        (["tcp:12"], r"contact 'tcp:12' has '12' rows, expected 3 or 6"),
        ("tcp", r"contacts are 'tcp', expected links' names"),
        ({"tcp": 6}, r"contacts are {'tcp': 6}, expected links' names"),
        ([3], r"contacts are \[3\], expected links' names"),
    ],
)
def test_what_cannot_be_a_contact_is_said(contacts: object, message: str) -> None:
    with pytest.raises(InputError, match=message):
        contacts_of(contacts=contacts)


def test_contacts_in_another_order_than_frames_are_refused() -> None:
    with pytest.raises(InputError, match=r"contacts are in the order 'eye', 'tcp', the same frames in the"):
        contacts_of(frames=["tcp", "eye"], contacts=["eye", "tcp"])


def test_the_command_line_takes_and_shows_contacts(tmp_path: Path) -> None:
    done = typed("derive", robot_path("scara"), "--contacts", "link3,link4:6", "-o", "arm.npz", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    shown = typed("show", "arm.npz", cwd=tmp_path).stdout
    assert "contacts: link3 (point), link4 (surface)\n" in shown
    done = typed("derive", robot_path("scara"), "--contacts", "link4:5", "-o", "no.npz", cwd=tmp_path)
    assert done.returncode == 2
    assert done.stderr.startswith("error: contact 'link4:5' has '5' rows, expected 3 or 6\nhint: ")
