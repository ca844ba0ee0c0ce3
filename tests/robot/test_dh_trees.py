"""DH tables that branch: `parent`, against the textbook's matrices in Pinocchio."""

from __future__ import annotations

import numpy as np
import pytest
from small_robots import dh, largest_difference

from psdmc.errors import InputError
from psdmc.robot.load import LoadedRobot, load_robot_text

LINK = (
    "link = { mass = 1.5, com = [0.1, -0.05, 0.2], "
    "inertia_com = { xx = 0.02, xy = 0.001, yy = 0.03, xz = -0.002, yz = 0.0015, zz = 0.025 } }"
)


def row(name: str, parent: str | None = None, **numbers: object) -> str:
    said = [f'name = "{name}"', *([f'parent = "{parent}"'] if parent else []), LINK]
    return "\n".join([*said, *(f"{key} = {value}" for key, value in numbers.items())])


TORSO = (
    row("waist", d=0.3),
    row("left", a=0.2, alpha=1.1, theta=0.3),
    row("left_wrist", a=0.4, alpha='"90 deg"', type='"prismatic"'),
    row("right", "waist", a=0.1, alpha=-0.7, d=-0.2),
    row("right_wrist", a=0.4, alpha=0.2),
    row("wheel", "base", a=-0.5, alpha='"90 deg"'),
)


def loaded(rows: tuple[str, ...] = TORSO, convention: str = "standard", **options: object) -> LoadedRobot:
    return load_robot_text(dh(*rows, convention=convention), "dh", source_name="arm.toml", **options)  # type: ignore[arg-type]


@pytest.mark.parametrize("convention", ["standard", "modified"])
def test_torques_of_a_table_that_branches_are_the_textbooks(convention: str) -> None:
    robot = loaded(convention=convention, drive_inertia=[0.1, 0.2, 0.3, 0.4, 0.5, 0.6])
    assert robot.chain.parents == (-1, 0, 1, 0, 3, -1)
    assert largest_difference(robot, snapped=True) < 1e-12
    assert largest_difference(robot.unsnapped(), snapped=False) < 1e-12


def test_its_frames_are_its_ends_and_the_first_that_is_named_is_its_tip() -> None:
    chain = loaded().chain
    assert [frame.name for frame in chain.frames] == ["link3", "link5", "link6"]
    assert (chain.tip_name, chain.tip_body) == ("link3", 2)
    chain = loaded(frames=("link5", "link1")).chain
    assert [frame.name for frame in chain.frames] == ["link5", "link1"]
    assert (chain.tip_name, chain.tip_body) == ("link5", 4)


def test_naming_the_row_before_changes_nothing() -> None:
    plain, said = (
        loaded(TORSO[:3]).chain,
        loaded((TORSO[0], row("left", "waist", a=0.2, alpha=1.1, theta=0.3), TORSO[2])).chain,
    )
    assert said.is_serial
    assert (said.tip_name, said.frames[0].name) == ("link3", "link3")
    for one, other in zip(plain.joints, said.joints, strict=True):
        np.testing.assert_array_equal(one.placement.rotation, other.placement.rotation)
        np.testing.assert_array_equal(one.placement.translation, other.placement.translation)


@pytest.mark.parametrize(
    ("rows", "message"),
    [
        ((row("a"), row("b", "c"), row("c")), "joint 'b': parent: 'c' is not open here: a branch's joints follow one "
         "another; expected one of 'base', 'a'"),
        ((row("a"), row("b", "nobody")), "joint 'b': parent: found 'nobody', expected 'base' or the name of a joint"),
        ((row("a"), row("b"), row("c", "a"), row("d", "b")), "joint 'd': parent: 'b' is not open here: a branch's joints "
         "follow one another; expected one of 'base', 'a', 'c'"),
        ((row("a"), row("b", "b")), "joint 'b': parent: 'b' is not open here"),
        ((row("base"), row("b", "base")), "a joint is called 'base', and a parent: rename the joint"),
        ((row("a"), 'name = "b"\nparent = 3'), "joint 'b': parent: found 3, expected"),
    ],
)  # fmt: skip
def test_parents_that_are_none(rows: tuple[str, ...], message: str) -> None:
    with pytest.raises(InputError) as refused:
        loaded(rows)
    assert str(refused.value).startswith(f"arm.toml: {message}")
