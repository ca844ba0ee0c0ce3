"""Springs and further friction of a robot of Pinocchio's, found in one log of it, and what its file says and delivers."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bundled import bundled_model
from command_line import status
from sprung_plant import (
    ARM_POINT,
    ASYMMETRY,
    BASE_POINT,
    CABLE,
    COULOMB,
    GAS,
    LOADED,
    NAMES,
    OFFSET,
    STRIBECK,
    STRIBECK_SPEED,
    TORSION,
    VISCOUS,
    Run,
    asymmetric,
    cable,
    gas_spring,
    loaded,
    recorded,
    stribeck,
    torsional_spring,
)

import psdmc
from psdmc.calibration.calibrate import CalibrateOptions, calibrate_logs
from psdmc.calibration.identify.linear_problem import LinearOptions
from psdmc.calibration.identify.predictor import ChainRegressor
from psdmc.calibration.logs.log import Log
from psdmc.calibration.logs.log_files import write_log
from psdmc.calibration.verdict.delivered import delivered_quality
from psdmc.calibration.verdict.record import Calibration
from psdmc.model.parameter_checks import check_mass_matrix

BALANCER = {
    "kind": "gas",
    "name": "balancer",
    "from": {"link": "base", "point": BASE_POINT.tolist()},
    "to": {"link": "link2", "point": ARM_POINT.tolist()},
    "length": GAS["length"],
    "friction": True,
}
COIL = {"kind": "torsional", "name": "coil", "joint": "joint_3", "rest": TORSION["rest"]}
ROPE = {"kind": "linear", "name": "rope", "joints": {"joint_4": 0.5, "joint_5": -0.8}}
UNEVEN = {
    "asymmetric": list(ASYMMETRY),
    "stribeck": {"speeds": [STRIBECK_SPEED], "joints": list(STRIBECK)},
    "offset": False,
}


def truth() -> dict[tuple[str, str], float]:
    """Of springs and friction, by owner and name."""
    plain = {
        (joint, name): float(values[k])
        for name, values in (
            ("coulomb", COULOMB),
            ("viscous", VISCOUS),
            ("offset", OFFSET),
            ("load_friction", LOADED),
        )
        for k, joint in enumerate(NAMES)
    }
    gas = {("balancer", name): GAS[name] for name in ("force", "rate", "friction")}
    springs = {("coil", "stiffness"): TORSION["stiffness"], ("rope", "stiffness"): CABLE["stiffness"]}
    uneven = {(joint, "coulomb_asymmetry"): value for joint, value in ASYMMETRY.items()}
    peaks = {(joint, f"stribeck_{STRIBECK_SPEED}"): value for joint, value in STRIBECK.items()}
    return plain | gas | springs | uneven | peaks  # type: ignore[return-value]


def calibrated(log: Log, tables: dict[str, Any], known: bool = True, physical: bool = True) -> Calibration:
    model = bundled_model("kr6") if known else replace(bundled_model("kr6"), theta_b=None)
    options = CalibrateOptions(linear=LinearOptions(tables=tables), physical=physical)
    return calibrate_logs(model, [log], options, ChainRegressor(model), None, lambda step: None)


def in_sigmas(found: Calibration) -> dict[str, float]:
    """How far everything with a standard deviation is from the truth."""
    right = truth()
    theta = bundled_model("kr6").theta_b
    assert theta is not None
    own = {row.name: (row.value - t) / row.std for row, t in zip(found.parameters, theta, strict=True)}
    rows = (*found.springs, *found.friction)
    return own | {
        f"{row.name} of {row.joint}": (row.value - right[row.joint, row.name]) / row.std for row in rows
    }


@pytest.fixture(scope="module")
def sprung(tmp_path_factory: pytest.TempPathFactory) -> tuple[Log, Calibration]:
    """A gas spring, a coil, a rope, asymmetric and Stribeck friction at once."""
    effects = (gas_spring, torsional_spring, cable, asymmetric, stribeck)
    log = recorded(tmp_path_factory.mktemp("logs") / "sprung.csv", effects, Run(seed=2, offset=False))
    return log, calibrated(log, {"springs": [BALANCER, COIL, ROPE], "friction": UNEVEN})


def test_springs_friction_and_parameters_come_out(sprung: tuple[Log, Calibration]) -> None:
    _, found = sprung
    off = in_sigmas(found)
    assert len(off) == bundled_model("kr6").l + 12 + 5 + 2 + 3
    assert max(map(abs, off.values())) < 3.0, off
    assert found.verdict is not None
    assert found.verdict.word == "usable", found.verdict.lines()
    balancer = {row.name: row for row in found.springs if row.joint == "balancer"}
    assert balancer["force"].std < 1.0  # N, of 900
    assert all(row.seen for row in found.springs)


def test_without_the_columns_the_same_log_is_not_followed(sprung: tuple[Log, Calibration]) -> None:
    log, found = sprung
    bare = calibrated(log, {})
    names = ("joint_2", "joint_3")
    with_them, without = ({n: r.steps[0].joints[n].held_out.rmse for n in names} for r in (found, bare))
    assert all(without[name] > 5.0 * with_them[name] for name in names)
    assert bare.verdict is not None
    assert bare.verdict.word != "usable"


def test_what_the_file_delivers_is_what_is_said(sprung: tuple[Log, Calibration], tmp_path: Path) -> None:
    log, found = sprung
    found.model.save(tmp_path / "sprung.npz")
    model = psdmc.load(tmp_path / "sprung.npz")
    (again,) = delivered_quality(model, [log])
    told = json.loads(json.dumps(found.as_json()))["quality"]["All"]
    for joint in NAMES:
        assert abs(again.joints[joint].held_out.r2 - told[joint]["held_out"]["r2"]) < 1e-9
        assert again.joints[joint].held_out.r2 > 0.999
    mass = check_mass_matrix(model)
    assert mass is not None
    assert mass.passed


def test_show_and_emission_say_what_was_found(
    sprung: tuple[Log, Calibration], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    sprung[1].model.save(tmp_path / "sprung.npz")
    assert status("show", tmp_path / "sprung.npz") == 0
    said = capsys.readouterr().out
    for word in (
        "balancer",
        "force",
        "coil",
        "stiffness",
        "Nm/rad",
        "coulomb asymmetry [Nm]",
        "stribeck 0.15 [Nm]",
    ):
        assert word in said, word
    words = [
        "emit-c",
        str(tmp_path / "sprung.npz"),
        "-o",
        str(tmp_path / "c"),
        "--functions",
        "gravity",
        "--friction",
    ]
    assert status(*words) == 0
    assert "not in the package, though calibrated: 3 spring(s)" in capsys.readouterr().out
    header = (tmp_path / "c" / "include" / "kr6" / "kr6.h").read_text(encoding="utf-8")
    assert "what this function does not have: 3 spring(s)" in header


def test_friction_that_grows_with_the_load(tmp_path: Path) -> None:
    """Of a robot whose file states no inertias: the load, too, is what the fit finds."""
    log = recorded(tmp_path / "loaded.csv", (loaded,), Run(seed=2, seconds=40.0))
    found = calibrated(log, {"friction": {"load": ["joint_2", "joint_3"]}}, known=False)
    off = in_sigmas(found)
    assert max(abs(size) for name, size in off.items() if " of " in name) < 3.0, off
    rows = {row.joint: row for row in found.friction if row.name == "load_friction"}
    assert {joint: row.seen for joint, row in rows.items()} == {"joint_2": True, "joint_3": True}
    assert all(row.std < 0.05 * row.value for row in rows.values())


def test_an_asymmetry_and_an_offset_of_one_joint_are_said_to_be_one_thing(tmp_path: Path) -> None:
    """They differ near rest only: neither may be claimed by itself."""
    log = recorded(tmp_path / "both.csv", (asymmetric,), Run(seconds=20.0))
    found = calibrated(log, {"friction": {"asymmetric": ["joint_6"], "offset": True}})
    rows = {row.name: row for row in found.friction if row.joint == "joint_6"}
    both = rows["offset"].value + rows["coulomb_asymmetry"].value
    assert both == pytest.approx(OFFSET[5], abs=0.02)
    assert rows["coulomb_asymmetry"].std > 3.0 * rows["coulomb"].std or not rows["coulomb_asymmetry"].seen


def test_asymmetric_joints_have_no_offset_and_the_others_have(tmp_path: Path) -> None:
    log = recorded(tmp_path / "some.csv", (asymmetric,), Run(seconds=20.0))
    found = calibrated(log, {"friction": {"asymmetric": ["joint_1"]}})
    assert [row.joint for row in found.friction if row.name == "offset"] == list(NAMES[1:])


def test_asymmetry_never_makes_friction_give_power(tmp_path: Path) -> None:
    """Forward friction is coulomb + asymmetry, backward coulomb - asymmetry: neither may be negative."""
    log = recorded(tmp_path / "odd.csv", (), Run(seconds=20.0, offset=False))
    assert log.velocity is None
    speed = np.gradient(log.position[:, 5], log.time)
    effort = np.array(log.effort)
    effort[:, 5] += np.abs(np.tanh(speed / 0.03)) * 0.9
    log = replace(log, effort=effort)
    tables = {"friction": {"asymmetric": ["joint_6"], "offset": False}}
    bare = {
        row.name: row.value
        for row in calibrated(log, tables, physical=False).friction
        if row.joint == "joint_6"
    }
    held = {row.name: row.value for row in calibrated(log, tables).friction if row.joint == "joint_6"}
    assert bare["coulomb"] - bare["coulomb_asymmetry"] < -0.3
    assert held["coulomb"] - abs(held["coulomb_asymmetry"]) > -1e-4


def test_a_load_is_found_by_a_model_with_springs(sprung: tuple[Log, Calibration], tmp_path: Path) -> None:
    """The springs of the model are there with the load, too: without one, none is found."""
    effects = (gas_spring, torsional_spring, cable, asymmetric, stribeck)
    again = recorded(tmp_path / "again.csv", effects, Run(seed=5, offset=False, seconds=30.0))
    write_log(again, tmp_path / "again.csv")
    found = psdmc.identify_payload(sprung[1].model, tmp_path / "again.csv")
    assert abs(found.mass) < 3.0 * found.mass_std + 0.02
    assert found.verdict.word == "usable, with doubts"
