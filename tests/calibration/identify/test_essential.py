"""Essential parameters: the F statistic against sums of squares by NumPy, and what a calibrated file then holds."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy import stats

import psdmc
from psdmc.calibration.calibrate import CalibrateOptions, calibrate_logs
from psdmc.calibration.identify.estimate import Estimate, FitOptions, Prior
from psdmc.calibration.identify.least_squares import estimate
from psdmc.calibration.identify.physical import nearest_physical
from psdmc.calibration.identify.predictor import ChainRegressor
from psdmc.calibration.identify.visibility import EssentialOptions, essential
from psdmc.calibration.logs.log import Log
from psdmc.calibration.verdict.delivered import delivered_quality
from psdmc.calibration.verdict.record import Calibration
from psdmc.errors import InputError

TRUTH = np.array([3.0, 0.02, -1.0, 0.0, 0.05])
COUNT = 400


def problem(seed: int, noise: float = 1.0) -> tuple[np.ndarray, np.ndarray, Estimate]:
    """Columns (COUNT, 1, 5) of which the last two are nearly one, targets, and the whole estimate."""
    rng = np.random.default_rng(seed)
    columns = rng.normal(size=(COUNT, 1, 5))
    columns[:, :, 4] = columns[:, :, 3] + 0.2 * columns[:, :, 4]
    target = columns @ TRUTH + noise * rng.normal(size=(COUNT, 1))
    prior = Prior(np.zeros(5), np.full(5, 100.0))
    return columns, target, estimate(columns, target, FitOptions(method="ols"), prior=prior)


def squares(columns: np.ndarray, target: np.ndarray, kept: np.ndarray) -> float:
    """Residual sum of squares with the other columns left out."""
    own = columns[:, 0, kept]
    return float(np.sum((target[:, 0] - own @ np.linalg.lstsq(own, target[:, 0], rcond=None)[0]) ** 2))


@pytest.mark.parametrize("seed", range(4))
def test_the_statistic_is_that_of_the_sums_of_squares(seed: int) -> None:
    columns, target, whole = problem(seed)
    found = essential(whole, np.zeros(5), COUNT, EssentialOptions())
    kept, count = ~found.dropped, int(found.dropped.sum())
    assert 1 <= count <= 3
    assert not found.dropped[[0, 2]].any()
    full, fewer = squares(columns, target, np.full(5, True)), squares(columns, target, kept)
    by_squares = (fewer - full) / count / (full / (COUNT - 5))
    assert found.f == pytest.approx(
        by_squares, rel=0.3, abs=0.05
    )  # whose covariance allows for dependent residuals
    assert found.f <= found.limit == pytest.approx(stats.f.ppf(0.95, count, COUNT - 5))
    own = columns[:, 0, kept]
    assert found.estimate.values[kept] == pytest.approx(
        np.linalg.lstsq(own, target[:, 0], rcond=None)[0], abs=1e-4
    )
    assert not found.estimate.values[found.dropped].any()


def test_what_the_data_need_stays_however_uncertain_it_looks() -> None:
    """Two columns of which only the sum is known well: one goes, and the other then must stay."""
    rng = np.random.default_rng(1)
    columns = rng.normal(size=(COUNT, 1, 2))
    columns[:, :, 1] = columns[:, :, 0] + 1e-2 * columns[:, :, 1]
    target = columns @ np.array([1.0, 1.0]) + rng.normal(size=(COUNT, 1))
    whole = estimate(columns, target, FitOptions(method="ols"), prior=Prior(np.zeros(2), np.full(2, 100.0)))
    assert np.all(whole.std > 0.5 * np.abs(whole.values))
    found = essential(whole, np.zeros(2), COUNT, EssentialOptions())
    assert found.dropped.sum() == 1
    assert found.estimate.values.sum() == pytest.approx(2.0, abs=0.2)
    assert found.estimate.std[~found.dropped] > 0.3  # of itself: it stands for the other, too


def test_together_they_are_needed_though_none_is_by_itself() -> None:
    """Twenty values of 1.7 standard deviations: each looks uncertain, two may go, a third has F = 2.9 over 2.6."""
    rng = np.random.default_rng(3)
    columns = np.linalg.qr(rng.normal(size=(COUNT, 20)))[0][:, None, :]
    noise = rng.normal(size=COUNT)
    noise -= columns[:, 0] @ (columns[:, 0].T @ noise)
    noise /= np.sqrt(np.sum(noise**2) / (COUNT - 20))
    target = columns @ np.full(20, 1.7) + noise[:, None]
    whole = estimate(columns, target, FitOptions(method="ols"), prior=Prior(np.zeros(20), np.full(20, 100.0)))
    assert np.all(whole.std > 0.5 * np.abs(whole.values))
    found = essential(whole, np.zeros(20), COUNT, EssentialOptions())
    assert (
        2 <= found.dropped.sum() <= 5
    )  # more than two where standard deviations allow for dependent residuals
    assert found.f <= found.limit


def test_what_is_dropped_stays_where_it_is_in_a_physical_robot(arm) -> None:
    """The other parameters follow, so that bodies exist with exactly these."""
    pytest.importorskip("cvxpy")
    theta = np.array(arm.model.theta_b)
    impossible, fixed = theta - 3.0 * np.abs(theta), np.arange(len(theta)) == 1
    impossible[1] = theta[1]
    near = nearest_physical(arm.model, impossible, 10.0 * np.eye(len(theta)), fixed=fixed)
    assert near.values[1] == theta[1]
    assert arm.model.B @ near.x == pytest.approx(near.values, abs=1e-5)


def test_nothing_is_dropped_that_is_known() -> None:
    _, _, whole = problem(0, noise=1e-4)
    found = essential(whole, np.zeros(5), COUNT, EssentialOptions())
    assert found.dropped.tolist() == [False, False, False, True, False]


@pytest.mark.parametrize("unseen_share", [1e-2, 1e-3])
def test_what_is_identifiable_is_decided_by_the_options_of_the_fit(unseen_share: float) -> None:
    """A direction (1, 0.05, 0) does not show: 0.0025 of the second value is in it, which the first limit admits."""
    rng = np.random.default_rng(5)
    columns = rng.normal(size=(COUNT, 1, 3))
    columns[:, :, 0] = -0.05 * columns[:, :, 1]
    target = columns @ np.array([5.0, 1.0, 1.0]) + 1e-3 * rng.normal(size=(COUNT, 1))
    fit = FitOptions(method="ols", unseen_share=unseen_share)
    prior = Prior(np.array([5.0, 1.0, 1.0]), np.full(3, 100.0))
    whole = estimate(columns, target, fit, prior=prior)
    found = essential(whole, prior.values, COUNT, EssentialOptions(relative=1e9), fit)
    assert not found.dropped.any()
    assert whole.identifiable.tolist() == [False, unseen_share > 0.0025, True]
    assert found.estimate.identifiable.tolist() == whole.identifiable.tolist()


@pytest.fixture
def weak(arm) -> Log:
    """The arm hardly turns: weights show, inertias and offsets hardly."""
    time = np.arange(3000) / 100.0
    q = np.stack([0.3 * np.sin(1.1 * time), 0.25 * np.sin(1.7 * time + 0.4)], axis=1)
    qd = np.stack([0.33 * np.cos(1.1 * time), 0.425 * np.cos(1.7 * time + 0.4)], axis=1)
    qdd = np.stack([-0.363 * np.sin(1.1 * time), -0.7225 * np.sin(1.7 * time + 0.4)], axis=1)
    tau = arm.model.inverse_dynamics(q, qd, qdd) + np.tanh(qd / 0.03) * [1.0, 0.6]
    tau = tau + 0.2 * np.random.default_rng(3).standard_normal(tau.shape)
    return Log("weak", arm.model.joint_names, time, q, None, tau, "motor_torque")


def calibrated(arm, log: Log, options: CalibrateOptions, known: bool = True) -> Calibration:
    model = arm.model if known else arm.unknown
    return calibrate_logs(model, [log], options, ChainRegressor(model), None, lambda step: None)


@pytest.mark.parametrize("known", [True, False])
def test_a_file_of_essential_parameters(arm, weak: Log, tmp_path: Path, known: bool) -> None:
    pytest.importorskip("cvxpy")
    whole = calibrated(arm, weak, CalibrateOptions(), known)
    found = calibrated(arm, weak, CalibrateOptions(essential=EssentialOptions()), known)

    gone = found.facts["dropped"]
    assert {"viscous of shoulder", "viscous of elbow"} <= set(gone)  # there is none
    found.model.save(tmp_path / "fewer.npz")
    model = psdmc.load(tmp_path / "fewer.npz")
    start = arm.model.theta_b if known else np.zeros(model.l)
    for k, row in enumerate(found.parameters):
        if row.name in gone:
            assert model.theta_b[k] == start[k]
            assert (
                row.visibility
                == f"not essential: kept at {'the file' + chr(39) + 's value' if known else 'zero'}"
            )
            assert np.isinf(row.std)
    assert all(row.value == 0.0 for row in found.friction if f"{row.name} of {row.joint}" in gone)
    values = np.array([row.value for row in found.parameters])
    std = np.array([row.std for row in found.parameters])
    fixed = np.isfinite(std)
    assert np.all(np.abs(values - arm.model.theta_b)[fixed] < 3.0 * std[fixed])
    (again,) = delivered_quality(model, [weak])
    for joint, cost in found.facts["essential_cost_r2"].items():
        before = whole.steps[0].joints[joint].held_out.r2
        assert cost == pytest.approx(before - again.joints[joint].held_out.r2, abs=1e-9)
        assert cost < 5e-3
    (note,) = [note for note in found.notes if note.startswith("essential parameters")]
    assert (
        f"{len(gone)} keep their prior values, from which the log does not differ significantly (F = " in note
    )
    assert found.facts["f_of_dropped"] <= found.facts["f_limit"]


def test_essential_is_not_for_campaigns(arm, campaign: Path) -> None:
    with pytest.raises(InputError, match="--prior-confidence, --essential are for plain logs"):
        psdmc.calibrate(
            arm.model, campaign, CalibrateOptions(prior_confidence=0.1, essential=EssentialOptions())
        )


def test_options_and_tables_mean_the_same(arm, weak: Log) -> None:
    by_option = calibrated(arm, weak, CalibrateOptions(essential=EssentialOptions(relative=1.0)))
    linear = replace(CalibrateOptions().linear, tables={"essential": {"relative": 1.0}})
    by_table = calibrated(arm, weak, CalibrateOptions(linear=linear))
    assert by_option.facts["dropped"] == by_table.facts["dropped"]
    usual = calibrated(arm, weak, CalibrateOptions(essential=EssentialOptions()))
    assert len(usual.facts["dropped"]) > len(by_option.facts["dropped"])
