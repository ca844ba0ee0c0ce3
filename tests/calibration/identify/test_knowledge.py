"""What is known before the fit: the file's bodies with a stated confidence, and bounds of masses and centres of mass."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bundled import bundled_model, robot_path
from command_line import status

from psdmc.calibration.calibrate import CalibrateOptions, calibrate_logs
from psdmc.calibration.identify.estimate import FitOptions, Prior
from psdmc.calibration.identify.knowledge import Confidence, knowledge_of, theta_covariance, with_prior
from psdmc.calibration.identify.least_squares import estimate
from psdmc.calibration.identify.linear_problem import LinearOptions
from psdmc.calibration.identify.predictor import ChainRegressor
from psdmc.calibration.logs.log import Log
from psdmc.calibration.logs.log_files import write_log
from psdmc.calibration.verdict.record import Calibration
from psdmc.derivation.derive import derive_model
from psdmc.errors import InputError
from psdmc.robot.inertia import standard_parameters
from psdmc.robot.load import load_robot
from psdmc.robot.mechanism import DRIVE


def test_the_joined_estimate_is_the_normal_law_s() -> None:
    """Of three unknowns, one of them with a prior, against its formula."""
    rng = np.random.default_rng(2)
    columns, truth = rng.normal(size=(300, 1, 3)), np.array([1.0, -2.0, 0.5])
    target = columns @ truth + rng.normal(size=(300, 1))
    whole = estimate(columns, target, FitOptions(method="ols"), prior=Prior(np.zeros(3), np.full(3, 1e3)))
    start, covariance = np.array([1.2, -2.1]), np.array([[4e-3, 1e-3], [1e-3, 2e-3]])
    joined = with_prior(whole, start, covariance)

    precision = np.linalg.inv(whole.total_covariance + whole.prior_covariance)
    own = np.zeros((3, 3))
    own[:2, :2] = np.linalg.inv(covariance)
    expected = np.linalg.solve(precision + own, precision @ whole.values + own[:, :2] @ start)
    assert joined.values == pytest.approx(expected, rel=1e-6)
    assert joined.total_covariance == pytest.approx(np.linalg.inv(precision + own), rel=1e-5, abs=1e-12)


def test_theta_s_prior_is_what_samples_of_bodies_scatter_by() -> None:
    """Masses, centres and inertias drawn at random, by way of their standard parameters."""
    model = bundled_model("two_link_full")
    stated = {0: Confidence(0.01, 0.002, 0.02), 1: Confidence(0.02, 0.001, 0.01)}
    rng, links = np.random.default_rng(0), model.mechanism.parameters
    drawn = []
    for _ in range(20_000):
        x = np.array(links)
        for k, own in stated.items():
            mass = links[k, 0]
            com = links[k, 1:4] / mass
            about = com @ com * np.eye(3) - np.outer(com, com)
            xx, xy, yy, xz, yz, zz = links[k, 4:10]
            inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) - mass * about
            root = np.sqrt(np.abs(np.diag(inertia)))
            size = np.outer(root, root)[[0, 0, 1, 0, 1, 2], [0, 1, 1, 2, 2, 2]]
            six = inertia[[0, 0, 1, 0, 1, 2], [0, 1, 1, 2, 2, 2]]
            x[k, :10] = standard_parameters(
                mass * (1 + own.mass * rng.normal()),
                com + own.com * rng.normal(size=3),
                six + own.inertia * size * rng.normal(size=6),
            )
            x[k, 10] *= 1 + own.inertia * rng.normal()
        drawn.append(model.B @ x.reshape(-1))
    scatter, covariance = np.cov(np.array(drawn).T), theta_covariance(model, stated, np.ones(model.l))
    size = np.sqrt(np.diag(covariance))
    assert np.abs((scatter - covariance) / np.outer(size, size)).max() < 0.05


def test_a_drive_inertia_that_the_file_leaves_at_zero_is_unknown() -> None:
    """A base parameter that contains it can be anything; the others keep what is stated."""
    robot = load_robot(robot_path("two_link_full"), drive_inertia=True).mechanism
    links = np.array(robot.parameters)
    links[:, DRIVE] = 0.0, 0.1
    model = derive_model(replace(robot, parameters=links), expand=False)
    stated = {k: Confidence(0.01, 0.001, 0.01) for k in range(2)}
    wide = np.sqrt(np.diag(theta_covariance(model, stated, np.ones(model.l))))
    contains = model.B[:, DRIVE] != 0.0
    assert contains.any()
    assert not contains.all()
    assert (wide[contains] > 5.0).all()
    assert (wide[~contains] < 1.0).all()


def calibrated(arm, log: Log, physical: bool = True, known: bool = True, **options: Any) -> Calibration:
    tables = options.pop("tables", {})
    model = arm.model if known else arm.unknown
    whole = CalibrateOptions(linear=LinearOptions(tables=tables), physical=physical, **options)
    return calibrate_logs(model, [log], whole, ChainRegressor(model), None, lambda step: None)


@pytest.fixture
def still_elbow(arm, log: Log) -> Log:
    """Its inertia shows with the shoulder's only."""
    rng = np.random.default_rng(7)
    time = log.time
    q = np.stack([0.8 * np.sin(1.3 * time), np.full(len(time), 0.4)], axis=1)
    qd = np.stack([1.04 * np.cos(1.3 * time), np.zeros(len(time))], axis=1)
    qdd = np.stack([-1.352 * np.sin(1.3 * time), np.zeros(len(time))], axis=1)
    tau = arm.model.inverse_dynamics(q, qd, qdd) + 0.05 * rng.standard_normal(q.shape)
    return replace(log, position=q, velocity=None, effort=tau)


def test_a_stated_prior_fills_what_the_data_leave_open(arm, still_elbow: Log) -> None:
    bare = calibrated(arm, still_elbow)
    found = calibrated(arm, still_elbow, prior_confidence=0.05)
    assert not all(np.isfinite(row.std) for row in bare.parameters)
    assert all(np.isfinite(row.std) for row in found.parameters)
    theta = np.array([row.value for row in found.parameters])
    std = np.array([row.std for row in found.parameters])
    assert np.all(np.abs(theta - arm.model.theta_b) < 3.0 * std)
    assert "by the stated prior more than by the data" in {row.visibility for row in found.parameters}
    assert any("by the stated prior" in warning for warning in found.warnings)
    assert found.facts["physical_distance_std"] < 1.0  # the file's bodies count once


def test_confidence_decides_how_far_the_data_may_move(arm, log: Log) -> None:
    """The file is wrong by a quarter: a sure prior keeps it, a doubtful one follows the data."""
    wrong = replace(arm, model=replace(arm.model, theta_b=1.25 * arm.model.theta_b))
    noisy = replace(log, effort=log.effort + 2.0 * np.random.default_rng(1).standard_normal(log.effort.shape))
    sure = calibrated(wrong, noisy, prior_confidence=1e-3, physical=False)
    doubtful = calibrated(wrong, noisy, prior_confidence=10.0, physical=False)
    none = calibrated(wrong, noisy, physical=False)
    theta = [np.array([row.value for row in found.parameters]) for found in (sure, doubtful, none)]
    kept = wrong.model.theta_b
    assert np.abs(theta[0] - kept).max() < 0.02 * np.abs(kept).max()
    assert np.abs(theta[1] - theta[2]).max() < 0.02 * np.abs(kept).max()
    assert all(s.std < d.std for s, d in zip(sure.parameters, doubtful.parameters, strict=True))


def test_a_link_s_own_confidence_stands_before_the_common_one(arm) -> None:
    link = arm.model.mechanism.joints[1].link_name
    own = {"link": link, "confidence": {"mass": 0.3, "com": 0.01, "inertia": 0.4}}
    known = knowledge_of(arm.model, {"prior": {"confidence": 0.1}, "bodies": [own]}, "log.toml")
    assert known.confidence[1] == Confidence(0.3, 0.01, 0.4)
    assert known.confidence[0].mass == 0.1


def test_bounds_of_masses_and_centres_hold_in_the_links_that_are_written(
    arm, log: Log, tmp_path: Path
) -> None:
    """The elbow's link is bounded away from what the log says: theta_b then is that of a body within, and it is said."""
    pytest.importorskip("cvxpy")
    from psdmc.links.physical_links import physical_links

    link = arm.model.mechanism.joints[1].link_name
    body = {"link": link, "mass": [0.5, 1.2], "com": {"x": [-0.3, -0.12]}}
    free, found = calibrated(arm, log), calibrated(arm, log, tables={"bodies": [body]})
    assert abs(free.model.theta_b - arm.model.theta_b).max() < 0.05
    assert found.facts["physical_distance_std"] > 3.0 * free.facts["physical_distance_std"]
    (note,) = [note for note in found.notes if note.startswith("bounds of [[bodies]]")]
    assert f"mass of {link}: most 1.2" in note or f"centre of mass of {link}, x: most -0.12" in note
    assert found.verdict is not None
    written = physical_links(found.model).parameters
    assert np.all(written[:, 0] > 0.0)


def test_bounds_that_no_body_fulfils_are_not_usable(arm, log: Log) -> None:
    """mx + the drive: the moment that the log shows asks for more mass than the bounds leave."""
    pytest.importorskip("cvxpy")
    link = arm.model.mechanism.joints[1].link_name
    body = {"link": link, "mass": [50.0, 60.0], "com": {"x": [5.0, 6.0], "y": [5.0, 6.0]}}
    found = calibrated(arm, log, tables={"bodies": [body]})
    assert found.verdict is not None
    assert not found.verdict.usable


@pytest.mark.parametrize(
    ("tables", "said"),
    [
        ({"prior": 0.1}, "prior: found 0.1, expected a table"),
        ({"prior": {"confidence": 0}}, "prior: confidence: found 0, expected a number from 0.0001 to 100"),
        ({"prior": {}}, "prior: confidence: missing"),
        ({"essential": True}, "essential: found true, expected a table"),
        ({"essential": {"significance": 0.9}}, "essential: significance: found 0.9"),
        ({"essential": {"sigma": 3}}, "unknown key(s) 'sigma'"),
        ({"bodies": {}}, "bodies: found a table, expected [[bodies]]"),
        ({"bodies": [{}]}, "body 1: link: missing"),
        ({"bodies": [{"link": "knee\x1b"}]}, "link: found 'knee\\x1b'"),
        ({"bodies": [{"link": "knee"}]}, "link 'knee' does not move"),
        ({"bodies": [{"link": "elbow"}, {"link": "elbow"}]}, "link 'elbow' a second time"),
        ({"bodies": [{"link": "elbow", "mass": 3}]}, "mass: found 3, expected [low, high] from 0 to 100000"),
        ({"bodies": [{"link": "elbow", "mass": [3, 2]}]}, "mass: found [3, 2], expected [low, high]"),
        ({"bodies": [{"link": "elbow", "mass": [-1, 2]}]}, "mass: found [-1, 2]"),
        ({"bodies": [{"link": "elbow", "com": {"w": [0, 1]}}]}, "unknown key(s) 'w'"),
        ({"bodies": [{"link": "elbow", "com": {"x": [0, "1"]}}]}, "x: found a list of 2"),
        ({"bodies": [{"link": "elbow", "confidence": {"mass": 0.1}}]}, "confidence: com: missing"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_named(arm, tables: dict[str, Any], said: str) -> None:
    joints = tuple(replace(joint, link_name=joint.name) for joint in arm.model.mechanism.joints)
    model = replace(arm.model, mechanism=replace(arm.model.mechanism, joints=joints))
    with pytest.raises(InputError) as refused:
        knowledge_of(model, tables, "log.toml")
    assert refused.value.message.startswith("log.toml: ")
    assert said in refused.value.message
    assert "\x1b" not in refused.value.message


def test_confidence_in_values_that_are_not_there_is_refused(arm, log: Log) -> None:
    with pytest.raises(InputError, match="but it lacks all inertias"):
        calibrated(arm, log, known=False, prior_confidence=0.1)


def test_bounds_without_the_physical_fit_are_refused(arm, log: Log) -> None:
    link = arm.model.mechanism.joints[1].link_name
    with pytest.raises(InputError, match="the unconstrained fit knows none"):
        calibrated(arm, log, physical=False, tables={"bodies": [{"link": link, "mass": [0.1, 9.0]}]})


def test_the_command_takes_both(arm, log: Log, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arm.model.save(tmp_path / "arm.npz")
    write_log(log, tmp_path / "log.csv")
    words = [
        "calibrate",
        str(tmp_path / "arm.npz"),
        str(tmp_path / "log.csv"),
        "-o",
        str(tmp_path / "out.npz"),
    ]
    code = status(*words, "--essential", "--prior-confidence", "0.2")
    said = capsys.readouterr()
    assert not code, said
    assert "note: essential parameters: " in said.out
    assert status(*words, "--prior-confidence", "0") == 2
    said = capsys.readouterr().err
    assert said.startswith("error: prior confidence (--prior-confidence) is 0, expected 0.0001 to 100\n")
    assert "right to 10 %" in said
