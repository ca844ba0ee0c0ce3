"""Linear estimation: honest standard deviations, outliers, and what the data cannot see."""

from __future__ import annotations

import numpy as np
import pytest

from psdmc.calibration.identify.estimate import Consider, FitOptions
from psdmc.calibration.identify.least_squares import estimate
from psdmc.calibration.identify.residuals import noise_warnings

RNG_SEED = 7
TRUE = np.array([2.0, -1.0, 0.5])


def problem(rng: np.random.Generator, noise: float = 0.1, count: int = 400):
    columns = rng.standard_normal((count, 2, 3))
    sigma = noise * np.array([1.0, 20.0])
    return columns, columns @ TRUE + sigma * rng.standard_normal((count, 2))


def test_standard_deviations_cover_the_truth_as_often_as_they_should():
    rng = np.random.default_rng(RNG_SEED)
    inside = []
    for _ in range(200):
        found = estimate(*problem(rng))
        inside.append(np.abs(found.values - TRUE) < 2 * found.std)

    assert np.mean(inside) == pytest.approx(0.954, abs=0.03)


def test_weights_use_the_quiet_joint():
    rng = np.random.default_rng(RNG_SEED)
    columns, target = problem(rng)

    plain = estimate(columns, target, FitOptions(method="ols"))
    weighted = estimate(columns, target, FitOptions(method="wls"))

    assert np.abs(weighted.values - TRUE).max() < 0.3 * np.abs(plain.values - TRUE).max()
    assert weighted.sigma == pytest.approx([0.1, 2.0], rel=0.15)


def test_outliers_move_least_squares_but_not_the_robust_estimate():
    rng = np.random.default_rng(RNG_SEED)
    columns, target = problem(rng)
    target[::20] += 30.0 * columns[::20, :, 0]

    plain = estimate(columns, target, FitOptions(method="wls"))
    robust = estimate(columns, target, FitOptions(method="irls"))

    assert abs(plain.values[0] - TRUE[0]) > 0.5
    assert np.abs(robust.values - TRUE).max() < 0.1


def test_a_column_that_is_never_excited_is_unidentifiable():
    rng = np.random.default_rng(RNG_SEED)
    columns, target = problem(rng)
    columns[:, :, 1] = 0.0

    found = estimate(columns, target)

    assert found.identifiable.tolist() == [True, False, True]
    assert found.rank == 2
    assert found.values[1] == 0.0
    assert np.isinf(found.std[1])


def test_parameters_that_only_show_together_are_both_unidentifiable():
    rng = np.random.default_rng(RNG_SEED)
    columns, target = problem(rng)
    columns[:, :, 2] = 3.0 * columns[:, :, 0]

    found = estimate(columns, target)

    assert found.identifiable.tolist() == [False, True, False]
    assert len(found.singular_values) == 3


def test_rows_that_do_not_count_change_nothing():
    rng = np.random.default_rng(RNG_SEED)
    columns, target = problem(rng)
    use = np.ones(target.shape, dtype=bool)
    use[100:] = False
    spoilt = np.where(use, target, 1e6)

    found = estimate(columns, spoilt, use=use)
    alone = estimate(columns[:100], target[:100])

    assert found.values == pytest.approx(alone.values, rel=1e-9)
    assert found.std == pytest.approx(alone.std, rel=1e-9)


def test_what_was_considered_widens_the_standard_deviation():
    rng = np.random.default_rng(RNG_SEED)
    columns, target = problem(rng)
    scale = Consider(-(columns @ TRUE)[:, :, None], np.array([[0.05**2]]))

    plain, wide = estimate(columns, target), estimate(columns, target, consider=scale)

    # a torque scale known to 5 % leaves every parameter known to 5 %
    assert np.sqrt(wide.std**2 - plain.std**2) == pytest.approx(0.05 * np.abs(TRUE), rel=0.1)


def test_correlated_residuals_are_said_to_be_no_noise():
    rng = np.random.default_rng(RNG_SEED)
    columns, target = problem(rng)
    drift = np.sin(np.arange(len(target)) / 20.0)
    drifted = target + drift[:, None] * [3.0, 0.0]

    quiet, loud = estimate(columns, target), estimate(columns, drifted)

    assert noise_warnings("fit", ("a", "b"), quiet) == ()
    (warning,) = noise_warnings("fit", ("a", "b"), loud)
    assert "joint(s) a (0.9" in warning
    assert "standard deviations are widened" in warning
