"""Plants and their robots: what cannot be simulated is refused by table and key."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from psdmc.calibration.motions.sweeps import SweepOptions, gravity_sweep
from psdmc.calibration.plant.virtual_robot import Payload, load_virtual_robot, simulate
from psdmc.errors import InputError
from psdmc.export.export_urdf import export_urdf
from psdmc.friction.law import Term
from psdmc.friction.laws import LAWS
from psdmc.friction.terms import named
from psdmc.model.store import save


def refused(arm, folder: Path, plant: str, robot: str | None = None) -> str:
    text = (arm.folder / "two_link.toml").read_text(encoding="utf-8")
    (folder / "two_link.toml").write_text(text if robot is None else robot, encoding="utf-8")
    (folder / "plant.toml").write_text(plant, encoding="utf-8")
    with pytest.raises(InputError) as raised:
        load_virtual_robot(folder / "plant.toml", harness=True)
    assert "\n" not in raised.value.message
    return raised.value.message


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("stiffness = 9e3", "stiffness = 0.0", "joint 'shoulder': stiffness: found 0.0, expected a number from 1 to"),
        ("stribeck_velocity = 0.05", "stribeck_velocity = 0", "joint 'elbow': stribeck_velocity: found 0"),
        ("coulomb = 3.0", "coulomb = 0.0", "joint 'shoulder': coulomb: found 0.0"),
        ("torque_constant = 12.0", "torque_constant = 0.0", "torque_constant: found 0.0"),
        ("torque_constant = 12.0", "torque_constant = nan", "torque_constant: found nan"),
        ("torque_constant = 12.0", "torque_constant = -12", "torque_constant: found -12"),
        ("torque_constant = 12.0", "torque_constant = '12'", "torque_constant: found '12'"),
        ("torque_constant = 12.0", "torque_constant = true", "torque_constant: found true"),
        ("torque_constant = 12.0", f"torque_constant = 1{'0' * 400}", "found a number that no double holds"),
        ("torque_constant = 12.0\n", "", "joint 'shoulder': torque_constant: missing"),
        ("viscous = 4.0", "viscos = 4.0", "unknown key(s) 'viscos'"),
        ("damping = 12.0", "damping = inf", "damping: found inf"),
        ("[sensors]", "sensors = 3\n[other]", "plant: unknown key(s) 'other'"),
        ("position_step = 5e-7", "position_step = 1e-300", "sensors: position_step: found 1e-300"),
        ("effort_delay = 1e-3", "effort_delay = 1e9", "sensors: effort_delay: found 1000000000.0"),
        ('joints = ["elbow"]', 'joints = ["knee"]', "harness: joints: found 'knee', expected some of shoulder, elbow"),
        ("angle = 1.0", "angle = 0.0", "harness: angle: found 0.0"),
        ('name = "elbow"', 'name = "wrist"', "expected some of shoulder, wrist"),
        ("[[joint]]", "[[oint]]", "plant: unknown key(s) 'oint'"),
        ('robot = "two_link.toml"', "", "robot: missing"),
        ('robot = "two_link.toml"', "robot = 3", "robot: found 3"),
        ('robot = "two_link.toml"', 'robot = "none.toml"', "none.toml: no such file"),
        ('robot = "two_link.toml"', 'robot = "a\\u0000b"', "robot: found"),
        ('robot = "two_link.toml"', 'robot = "plant.toml"', "plant.toml: "),
    ],
)  # fmt: skip
def test_each_wrong_entry_is_named(arm, tmp_path: Path, old: str, new: str, message: str):
    text = arm.plant.read_text(encoding="utf-8")
    assert old in text

    assert message in refused(arm, tmp_path, text.replace(old, new, 1))


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("mass = 2.0", "", "joint 'shoulder': link: mass: missing"),
        ("mass = 2.0", "mass = 1e300", "1e+300"),
        ("drive_inertia = 0.3", 'drive_inertia = "unknown"', "drive_inertia: found 'unknown'"),
        ("xx = 0.01, ", "", "inertia_com: xx: missing"),
        ("xx = 0.01, ", "xx = -0.01, ", "joint 'shoulder': inertia_com: no body has it"),
        ("xy = 0.0, ", "xy = 0.5, ", "joint 'shoulder': inertia_com: no body has it"),
        ("mass = 2.0", "mass = 1" + "0" * 400, "two_link.toml: "),
        ('"standard"', '"modified"', "a virtual robot needs standard DH"),
        ("a = 0.4", "a = 1e300", "1e+300"),
        ("theta = 0.0", "theta = '30'", "is no angle"),
        ("gravity = [0.0, -9.81, 0.0]", "gravity = [0.0, -1e200, 0.0]", "gravity: "),
    ],
)
def test_a_robot_that_is_not_known_in_full_is_refused(arm, tmp_path: Path, old: str, new: str, message: str):
    robot = (arm.folder / "two_link.toml").read_text(encoding="utf-8")
    assert old in robot

    plant = arm.plant.read_text(encoding="utf-8")

    assert message in refused(arm, tmp_path, plant, robot.replace(old, new, 1))


def test_many_faults_are_cut_short(arm, tmp_path: Path):
    text = arm.plant.read_text(encoding="utf-8").replace(" = 1", " = -1")

    assert refused(arm, tmp_path, text).endswith("more")


def test_what_is_no_plant_is_told_what_a_plant_is(arm, tmp_path: Path):
    save(arm.model, tmp_path / "model.npz")
    (tmp_path / "latin.toml").write_bytes(b'name = "\xe9"')
    (tmp_path / "deep.toml").write_text("a = " + "[\n" * 100_000, encoding="utf-8")
    (tmp_path / "dotted.toml").write_text("a" + ".a" * 100_000 + " = 1", encoding="utf-8")
    (tmp_path / "huge.toml").write_text("#" * 300_000, encoding="utf-8")
    for name, message in (
        ("model.npz", "is a zip or npz file, such as a model: expected a plant"),
        ("latin.toml", "is no text in UTF-8: expected a plant"),
        ("deep.toml", "not TOML, or damaged"),
        ("dotted.toml", "a line of 200,005 characters, expected at most 500"),
        ("huge.toml", "has 300,000 bytes, expected at most 262,144"),
        ("missing.toml", "no such file"),
        (".", "is not a file"),
    ):
        with pytest.raises(InputError) as raised:
            load_virtual_robot(tmp_path / name)
        assert message in raised.value.message


def test_angles_may_be_written_as_the_robot_files_do(arm, tmp_path: Path):
    robot = (arm.folder / "two_link.toml").read_text(encoding="utf-8")
    (tmp_path / "two_link.toml").write_text(robot.replace("theta = 0.0", 'theta = "0 rad"'), encoding="utf-8")
    (tmp_path / "plant.toml").write_text(arm.plant.read_text(encoding="utf-8"), encoding="utf-8")

    assert load_virtual_robot(tmp_path / "plant.toml").joint_names == ("shoulder", "elbow")


def urdf_plant(arm, folder: Path, change: tuple[str, str] = ("", "")) -> Path:
    """The arm's plant with a URDF that was exported from its model, and the drives' inertias with the joints."""
    export_urdf(arm.model, folder / "two_link.urdf", mjcf=False)
    text = arm.plant.read_text(encoding="utf-8").replace("two_link.toml", "two_link.urdf")
    for name, drive in (("shoulder", 0.3), ("elbow", 0.1)):
        text = text.replace(f'name = "{name}"', f'name = "{name}"\ndrive_inertia = {drive}')
    (folder / "plant.toml").write_text(text.replace(*change) if change[0] else text, encoding="utf-8")
    return folder / "plant.toml"


def test_a_plant_of_a_urdf_logs_what_the_same_robots_table_does(arm, tmp_path: Path):
    """Two readings: rows of a DH table here, the URDF's by Pinocchio; with a load on the tip and without."""
    motion = gravity_sweep(arm.model.chain, 1, SweepOptions(speed=0.5, seconds=3.0, period=0.01))
    robots = [load_virtual_robot(path, ideal_sensors=True) for path in (arm.plant, urdf_plant(arm, tmp_path))]

    for load in (None, Payload(2.0, (0.1, 0.05, 0.02))):
        table, urdf = (simulate(robot, motion, payload=load) for robot in robots)
        assert urdf.joint_names == table.joint_names
        assert np.abs(urdf.effort - table.effort).max() < 1e-7 * np.abs(table.effort).max()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (('name = "shoulder"', 'name = "hip"'), "no joint(s) 'hip' that turn or slide on their own"),
        (("[sensors]", 'tip = "hand"\n[sensors]'), "no link 'hand'"),
        (("two_link.urdf", "none.urdf"), "none.urdf: no such file"),
        (("drive_inertia = 0.3", "drive_inertia = -1"), "joint 'shoulder': drive_inertia: found -1"),
    ],
)
def test_what_a_urdfs_plant_lacks_is_named(arm, tmp_path: Path, change: tuple[str, str], message: str):
    with pytest.raises(InputError) as raised:
        load_virtual_robot(
            urdf_plant(arm, tmp_path, (change[0], change[1])), harness=message[:8] == "no joint"
        )

    assert message in raised.value.message


def test_a_tables_plant_states_no_drive_inertia_and_no_tip(arm, tmp_path: Path):
    plant = arm.plant.read_text(encoding="utf-8")

    twice = plant.replace('name = "elbow"', 'name = "elbow"\ndrive_inertia = 0.1')
    assert "drive_inertia: found with a DH table" in refused(arm, tmp_path, twice)
    assert "tip: found with a DH table" in refused(
        arm, tmp_path, plant.replace("[sensors]", 'tip = "x"\n[sensors]')
    )


PAGE = Path(__file__).parents[3] / "docs" / "calibration.md"
NUMBERED = {"viscous": "viscous^2", "stribeck": "stribeck_0.15"}
"""How a plant names laws with a number, for example."""


def named_or_plain(word: str) -> list[Term]:
    found = named(word, LAWS)
    return [Term(LAWS[word])] if found is None else [found[0]]


def test_the_page_lists_the_keys_that_the_reader_knows(arm, tmp_path: Path):
    """The reader itself says them, where it finds another key. The page also names no key that the reader refuses."""
    words = [word for word in LAWS if word != "stribeck"] + list(NUMBERED.values())
    text = f"friction = {words}\n" + arm.plant.read_text(encoding="utf-8")
    names = {name for word in words for term in named_or_plain(word) for name in term.names}
    more = [f'"{name}" = 1.0' for name in sorted(names) if f"\n{name} = " not in text]
    text = text.replace("[[joint]]", "\n".join(["[[joint]]", *more]))
    wanted: set[str] = set()
    for head in ("friction", "[sensors]", "[harness]", "[[joint]]"):
        odd = f"odd = 1\n{head}" if head == "friction" else f"{head}\nodd = 1"
        said = refused(arm, tmp_path, text.replace(head, odd, 1))
        wanted |= set(re.search(r"unknown key\(s\) 'odd', known are ([^;]+)", said)[1].split(", "))
    section = PAGE.read_text(encoding="utf-8").split("## Virtual robots")[1].split("\n## ")[0]
    rows = [line.split(" | ") for line in section.splitlines() if line.startswith("| ")]
    laws = [row for row in rows if len(row) == 2]
    cells = [cell for row in rows for cell in ([row[1]] if row in laws else [row[0]])]
    documented = {re.sub(r'[]["]', "", name) for cell in cells for name in re.findall(r"`([^`]+)`", cell)}
    assert wanted - documented == set()
    assert documented - wanted == set()
    assert {row[0].strip("`| ") for row in laws} >= set(words)
