"""Calibration of robots whose file lacks some inertias: massless links are named first, known ones are a prior."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from command_line import status
from urdf_text import inertial, joint, link, urdf

from psdmc.calibration.calibrate import CalibrateOptions, calibrate_logs
from psdmc.calibration.identify.linear_problem import LinearOptions
from psdmc.calibration.identify.predictor import ChainRegressor
from psdmc.calibration.logs.log import Log
from psdmc.calibration.logs.log_files import write_log
from psdmc.calibration.verdict.record import Calibration
from psdmc.derivation.derive import derive_model
from psdmc.errors import InputError
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.robot.load import load_robot_text

INERTIAL = inertial(2, "0.1 0 0.02", "0 0 0", "0.02 0.03 0.025")
LIMIT = '<limit lower="-2" upper="2" velocity="5" effort="90"/>'


def model_of(fore: str, upper: str = INERTIAL, **options: object) -> DynamicsModel:
    """Two links that turn about one horizontal axis."""
    text = urdf(
        *(link(name, inside) for name, inside in (("base", ""), ("upper", upper), ("fore", fore))),
        joint("j1", "base", "upper", xyz="0 0 0", axis="0 1 0", extra=LIMIT),
        joint("j2", "upper", "fore", xyz="0.3 0 0", axis="0 1 0", extra=LIMIT),
    )
    return derive_model(load_robot_text(text, "urdf", source_name="arm.urdf", **options).mechanism)  # type: ignore[arg-type]


@pytest.fixture(scope="module")
def true() -> DynamicsModel:
    return model_of(INERTIAL)


def log_of(model: DynamicsModel, *, shoulder: float = 0.8, seconds: float = 8.0) -> Log:
    """Torques of a model along sines, with noise."""
    time = np.arange(int(seconds * 250)) / 250.0
    w, size = np.array([1.3, 2.9]), np.array([shoulder, 0.7])
    q = size * np.sin(w * time[:, None] + np.array([0.0, 0.4]))
    qd = size * w * np.cos(w * time[:, None] + np.array([0.0, 0.4]))
    tau = model.inverse_dynamics(q, qd, -(w**2) * q)
    tau = tau + 0.02 * np.random.default_rng(4).standard_normal(q.shape)
    return Log("sines", model.joint_names, time, q, None, tau, "motor_torque")


def calibrated(model: DynamicsModel, log: Log, **options: object) -> Calibration:
    whole = CalibrateOptions(linear=LinearOptions(), physical=False, **options)  # type: ignore[arg-type]
    return calibrate_logs(model, [log], whole, ChainRegressor(model), None, lambda step: None)


DROPPED = (
    "link 'fore' has no <inertial>, so the model has no parameters to calibrate there; "
    "derive it again with --unknown fore"
)


def test_the_command_names_dropped_links_before_the_verdict(
    true: DynamicsModel, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    model_of("").save(tmp_path / "arm.npz")
    write_log(log_of(true, seconds=4.0), tmp_path / "log.csv")
    status(
        "calibrate", tmp_path / "arm.npz", tmp_path / "log.csv", "-o", tmp_path / "out.npz", "--no-physical"
    )
    said = capsys.readouterr().out.splitlines()

    assert said[0] == f"warning: {DROPPED}"
    assert said.count(said[0]) == 1


@pytest.mark.filterwarnings("error::RuntimeWarning")
def test_the_record_s_first_warning_names_dropped_links(true: DynamicsModel) -> None:
    log = log_of(true)
    assert calibrated(model_of(""), log).warnings[0] == DROPPED
    assert not any("no <inertial>" in warning for warning in calibrated(true, log).warnings)


def test_a_log_finds_the_unknown_link(true: DynamicsModel) -> None:
    """theta_b is that of the robot whose link is known, as far as the log shows it."""
    model = model_of("", unknown=("fore",))
    found = calibrated(model, log_of(true))
    theta = np.array([row.value for row in found.parameters])
    std = np.array([row.std for row in found.parameters])
    seen = np.array([row.identifiable for row in found.parameters])

    assert model.l == true.l
    assert seen.any()
    assert np.all(np.abs(theta - true.theta_b)[seen] < 5.0 * std[seen])


@pytest.mark.parametrize(("bare", "said"), [("upper", "the known links' part"), ("fore", "the file's value")])
def test_unseen_directions_keep_what_is_known(true: DynamicsModel, bare: str, said: str) -> None:
    """The shoulder rests: its own inertia is not seen."""
    model = model_of(unknown=(bare,), **{"fore": INERTIAL, "upper": INERTIAL, bare: ""})
    found = calibrated(model, log_of(true, shoulder=0.0))
    unknown = set(model.unknown_base_parameters)

    assert 0 < len(unknown) < model.l
    for k, (row, value) in enumerate(zip(found.parameters, true.known_theta_b(), strict=True)):
        assert row.file == (None if k in unknown else pytest.approx(value, rel=1e-14))
    unseen = {k: row for k, row in enumerate(found.parameters) if "not visible" in row.visibility}
    assert f"not visible: kept at {said}" in {row.visibility for row in unseen.values()}
    assert model.file_theta_b is not None
    for k, row in unseen.items():
        assert row.value == pytest.approx(model.file_theta_b[k], rel=1e-6)


def test_a_stated_confidence_is_of_the_known_links_alone(true: DynamicsModel) -> None:
    """With the first link stated to 1 %, both together are told apart: the second one is what is left of the torque."""
    model = model_of("", unknown=("fore",), drive_inertia=[0.3, 0.1])
    truth = model_of(INERTIAL, drive_inertia=[0.3, 0.1])
    log = log_of(truth)
    found = calibrated(model, log, prior_confidence=0.01)
    unknown = model.unknown_base_parameters

    theta, std = (np.array([getattr(row, name) for row in found.parameters]) for name in ("value", "std"))
    known = [k for k in range(model.l) if k not in unknown]
    assert np.isfinite(std[known]).all()
    assert all(
        row.visibility != "by the stated prior more than by the data"
        for k, row in enumerate(found.parameters)
        if k in unknown
    )
    seen = [k for k in unknown if found.parameters[k].identifiable]
    assert seen
    assert np.all(np.abs(theta - truth.known_theta_b())[seen] < 5.0 * std[seen])


def test_a_confidence_in_an_unknown_link_is_refused(true: DynamicsModel) -> None:
    model = model_of("", unknown=("fore",))
    body = {"link": "fore", "confidence": {"mass": 0.1, "com": 0.01, "inertia": 0.1}}
    linear = LinearOptions(tables={"bodies": [body]})
    with pytest.raises(InputError, match="but it lacks the inertia of fore"):
        calibrate_logs(
            model,
            [log_of(true)],
            CalibrateOptions(linear=linear),
            ChainRegressor(model),
            None,
            lambda step: None,
        )


def test_base_parameters_are_numbered_from_0_and_named(true: DynamicsModel) -> None:
    found = calibrated(replace(true, theta_b=None), log_of(true, shoulder=0.0))
    labels = true.base_parameters.labels

    assert [row.name for row in found.parameters] == [f"theta_b[{k}]" for k in range(true.l)]
    assert labels[0] == f"theta_b[0] {true.base_parameters[0].equation}"
    assert any(label in warning for label in labels for warning in found.warnings)
    assert not any("theta_1" in text for text in (*found.warnings, *found.notes))


def test_a_load_on_a_massless_link_is_refused_with_the_option() -> None:
    with pytest.raises(InputError) as refused:
        model_of("").with_payload(1.0, (0.0, 0.0, 0.1))
    assert (
        refused.value.message
        == "cannot add this load to link 'fore': the model treats it as massless, as it has no <inertial>"
    )
    assert refused.value.hint == (
        "add <inertial> and derive again; or derive again with --unknown fore, then calibrate"
    )


def test_a_calibrated_model_of_an_unknown_link_takes_a_load(true: DynamicsModel) -> None:
    model = model_of("", unknown=("fore",))
    with pytest.raises(InputError, match="unknown"):
        model.with_payload(1.0, (0.0, 0.0, 0.1))
    found = replace(model, theta_b=true.known_theta_b())
    loaded = found.with_payload(1.0, (0.0, 0.0, 0.1))

    assert loaded.theta_b == pytest.approx(true.with_payload(1.0, (0.0, 0.0, 0.1)).theta_b, rel=1e-12)
