"""`psdmc compare`: two models of one robot, against closed forms and known changes."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from command_line import typed
from worn_arm import VISCOUS, Worn, recorded

import psdmc
from psdmc.calibration.compared import Comparison
from psdmc.calibration.comparison import STATES, _states, compare
from psdmc.errors import InputError
from psdmc.robot.load import load_robot
from psdmc.robot.reference import reference


@pytest.fixture(scope="module")
def table(arm) -> Path:
    return arm.folder / "two_link.toml"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("compared")


def calibrated(arm, folder: Path, name: str, how: Worn, table: Path) -> Path:
    model = psdmc.calibrate(arm.model, recorded(folder, name, how, table)).model
    psdmc.save(model, folder / f"{name}.npz")
    return folder / f"{name}.npz"


@pytest.fixture(scope="module")
def files(arm, folder: Path, table: Path) -> tuple[Path, Path, Path]:
    """Two calibrations of the same arm, and one of the arm with more friction."""
    worn = (VISCOUS[0], 1.5 * VISCOUS[1])
    return (
        calibrated(arm, folder, "a", Worn(seed=21), table),
        calibrated(arm, folder, "b", Worn(seed=22), table),
        calibrated(arm, folder, "worn", Worn(seed=23, viscous=worn), table),
    )


def test_two_calibrations_of_one_arm_agree(files):
    found = compare(files[0], files[1])

    assert found.doubts == found.noticed == ()
    assert found.freedom == len(found.parameters) == 7
    assert 1e-4 < found.chance <= 1.0
    assert not [row for row in found.parameters if abs(row.sigmas) > 4.0]


def test_a_change_of_friction_is_seen_in_value_torque_curve_and_log(files, folder: Path):
    found = compare(files[0], files[2], folder / "worn.csv")

    assert found.surely[0].name == "viscous of elbow"
    assert found.surely[0].b - found.surely[0].a == pytest.approx(0.5 * VISCOUS[1], rel=0.02)
    assert [joint.joint for joint in found.noticed] == ["elbow"]
    elbow = found.joints[1]
    assert elbow.friction == pytest.approx(
        0.5 * VISCOUS[1] * 5.0 / np.sqrt(3.0), rel=0.05
    )  # speeds to +- 5 rad/s
    curve = found.curves[1]
    difference = np.array(curve.b) - np.array(curve.a)
    assert difference == pytest.approx(0.5 * VISCOUS[1] * np.array(curve.speed), abs=0.05)
    assert found.on_log[1].r2[0] < found.on_log[1].r2[1]
    assert found.on_log[1].rms[0] > 5.0 * found.on_log[1].rms[1]
    assert found.on_log[0].rms[0] == pytest.approx(found.on_log[0].rms[1], rel=0.1)


def test_torques_differ_by_what_a_load_weighs_in_pinocchio(arm, table: Path):
    """The arm with a load against the arm without: Pinocchio's torques with an appended body in the same states."""
    loaded = arm.model.with_payload(0.4, [0.03, 0.01, 0.0], np.diag([0.001, 0.001, 0.001]))

    found = compare(arm.model, loaded)

    robot = reference(load_robot(table, drive_inertia=True))
    q, qd, qdd = _states(arm.model.mechanism)
    without = robot.inverse_dynamics(q, qd, qdd)
    body = pin.Inertia(0.4, np.array([0.03, 0.01, 0.0]), np.diag([0.001, 0.001, 0.001]))
    tip = robot.model.frames[robot.model.getFrameId(robot.tip_name)]
    robot.model.appendBodyToJoint(tip.parentJoint, body, tip.placement)
    added = robot.inverse_dynamics(q, qd, qdd) - without
    assert len(q) == STATES
    assert [joint.rms for joint in found.joints] == pytest.approx(
        np.sqrt(np.mean(added**2, axis=0)), rel=1e-9
    )
    assert [joint.largest for joint in found.joints] == pytest.approx(np.abs(added).max(axis=0), rel=1e-9)
    assert np.isnan(found.chi2)
    assert any("not calibrated" in text for text in found.doubts)


def test_chi_square_is_that_of_the_joint_covariance(arm, files):
    """Two models with made-up covariances that correlate all parameters."""
    rng = np.random.default_rng(5)
    models = []
    for path in files[:2]:
        model = psdmc.load(path)
        root = rng.normal(size=(model.l, model.l))
        assert model.calibrated is not None
        models.append(replace(model, calibrated=replace(model.calibrated, covariance=root @ root.T)))

    found = compare(*models)

    difference = models[1].theta_b - models[0].theta_b
    together = models[0].calibrated.covariance + models[1].calibrated.covariance
    assert found.chi2 == pytest.approx(difference @ np.linalg.solve(together, difference), rel=1e-6)
    for row, value, own in zip(found.parameters, difference, np.diag(together), strict=True):
        assert row.sigmas == pytest.approx(value / np.sqrt(own))


def test_a_file_without_covariance_is_compared_by_its_standard_deviations_and_says_so_first(
    arm, files, folder: Path
):
    model = psdmc.load(files[0])
    assert model.calibrated is not None
    old = replace(model, calibrated=replace(model.calibrated, covariance=None))
    psdmc.save(old, folder / "old.npz")

    done = typed("compare", folder / "old.npz", files[1])
    found = compare(folder / "old.npz", files[1])

    assert done.returncode == 0
    assert done.stdout.startswith(
        "doubt: old.npz: no covariance in the file, so its parameters count as independent"
    )
    stds = [
        np.hypot(a, b) for a, b in zip(old.calibrated.std, psdmc.load(files[1]).calibrated.std, strict=True)
    ]
    shown = [row.std for row, std in zip(found.parameters, stds, strict=True) if np.isfinite(std)]
    assert shown == pytest.approx([std for std in stds if np.isfinite(std)])


def test_a_robot_file_is_compared_as_exact_and_without_friction(files, table: Path, folder: Path):
    """The file has the true values; one with a heavier link differs there."""
    right = compare(files[0], table)
    text = table.read_text(encoding="utf-8").replace("mass = 1.5", "mass = 2.0")
    (folder / "heavy.toml").write_text(text, encoding="utf-8")
    wrong = compare(files[0], folder / "heavy.toml", folder / "a.csv")

    assert right.chance > 1e-3
    assert right.noticed == right.friction == right.curves == ()
    assert wrong.chance < 1e-6
    assert {joint.joint for joint in wrong.noticed} == {"shoulder", "elbow"}
    assert wrong.on_log[0].r2[1] < wrong.on_log[0].r2[0]


FINGER = """<link name="{name}"><inertial><mass value="1"/><inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0"
iyz="0"/></inertial></link><joint name="{name}_joint" type="continuous"><parent link="palm"/><child link="{name}"/>
<axis xyz="0 0 1"/>{mimic}</joint>"""
GRIPPER = "".join(
    [
        '<robot name="gripper"><link name="palm"/>',
        FINGER.format(name="left", mimic=""),
        FINGER.format(name="right", mimic='<mimic joint="left_joint"/>'),
        "</robot>",
    ]
)


def refused(a: object, b: object) -> str:
    with pytest.raises(InputError) as caught:
        compare(a, b)  # type: ignore[arg-type]
    return caught.value.message


def test_models_of_different_robots_are_refused_with_what_differs(arm, files, table: Path, folder: Path):
    text = table.read_text(encoding="utf-8")
    variants = {
        "name": text.replace('name = "elbow"', 'name = "wrist"'),
        "axis": text.replace("a = 0.4", "a = 0.5"),
        "type": text.replace('type = "revolute"\na = 0.3', 'type = "prismatic"\na = 0.3').replace(
            '"-140 deg", "140 deg"', "-1.0, 1.0"
        ),
        "gravity": text.replace("-9.81", "-9.7"),
    }
    said = {}
    for name, content in variants.items():
        (folder / f"{name}.toml").write_text(content, encoding="utf-8")
        said[name] = refused(files[0], folder / f"{name}.toml")

    assert said["name"] == "different robots: joints only in the first: elbow; only in the second: wrist"
    assert said["axis"] == "different robots: joint(s) shoulder, elbow have other axes or link frames"
    assert said["type"] == "different robots: joint(s) elbow of another type or on another link"
    assert said["gravity"].startswith("different gravity: ")
    plain = psdmc.derive(table, assume_zero=["link2:my"])
    assert "the models have other base parameters: 7 and" in refused(files[0], plain)
    assert "base parameters are unknown" in refused(files[0], arm.unknown)
    (folder / "gripper.urdf").write_text(GRIPPER, encoding="utf-8")
    assert "without joints that follow others" in refused(psdmc.derive(folder / "gripper.urdf"), table)


def test_the_page_and_its_numbers_are_the_result_s(files, folder: Path):
    done = typed("compare", files[0], files[2], folder / "worn.csv", "--report", folder / "compared.html")
    found: Comparison = compare(files[0], files[2], folder / "worn.csv")
    page = (folder / "compared.html").read_text(encoding="utf-8")
    said = json.loads((folder / "compared.json").read_text(encoding="utf-8"))

    assert done.returncode == 0
    assert "noticed: elbow: feed-forward torque differs by" in done.stdout
    assert said == {"schema": 1, "kind": "comparison", **found.as_json()}
    assert page.count("<svg") == 2
    line = (
        f"base parameters: chi-square {found.chi2:.4g}, 7 degrees of freedom, probability {found.chance:.2g}"
    )
    assert f"\n{line} if the models are equal\n" in done.stdout
    assert f"<p>{line} if the models are equal</p>" in page
    (folder / "taken.json").write_text("{}", encoding="utf-8")
    taken = typed("compare", files[0], files[2], "--report", folder / "taken.html")
    assert taken.returncode == 2
    assert (folder / "taken.json").read_text(encoding="utf-8") == "{}"
