"""Errors that a fit hides are found with their size: scales, a reduction ratio, a tilted base, a load; none in good logs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from psdmc.calibration.calibrate import CalibrateOptions, calibrate_logs
from psdmc.calibration.identify.motor_model import Motors
from psdmc.calibration.logs.filter import filtered
from psdmc.calibration.logs.log import Log
from psdmc.calibration.logs.log_checks import checked
from psdmc.calibration.logs.low_pass import FilterOptions
from psdmc.calibration.plant.spoiled import bridged, geared, scaled, stuck
from psdmc.calibration.verdict.evidence import Evidence, Motion, evidence_of
from psdmc.calibration.verdict.log_errors import log_errors, solution, unstated_load
from psdmc.errors import InputError

ELBOW = 1
MASS = 0.6
"""kg, point mass at the tip of the arm."""
A1, A2 = 0.4, 0.3
"""m, lengths of the arm's links."""


def evidence(arm, log: Log) -> Evidence:
    return evidence_of(arm.model, arm.regressor, [Motion(log)], Motors.torques(2), FilterOptions(cutoff=8.0))


def found(arm, log: Log):
    return log_errors(evidence(arm, log), arm.model)


def carrying(log: Log) -> Log:
    """The log with the torques J^T m (a - g) of a point mass at the tip, in closed form."""
    states = filtered(log, FilterOptions(cutoff=8.0))
    q, qd, qdd = states.q, states.qd, states.qdd
    angles = np.stack([q[:, 0], q.sum(axis=1)])
    rates = np.stack([qd[:, 0], qd.sum(axis=1)])
    bends = np.stack([qdd[:, 0], qdd.sum(axis=1)])
    reach = np.array([A1, A2])[:, None]
    out, across = (
        np.stack([np.cos(angles), np.sin(angles)]),
        np.stack([-np.sin(angles), np.cos(angles)]),
    )
    force = MASS * (np.sum(reach * (bends * across - rates**2 * out), axis=1) + np.array([[0.0], [9.81]]))
    columns = np.stack([(reach * across).sum(axis=1), (reach * across)[:, 1]])
    torque = np.einsum("kxt,xt->tk", columns, force)
    more = [np.interp(log.time - log.time[0], states.time, column) for column in torque.T]
    return replace(log, effort=log.effort + np.stack(more, axis=1))


def test_a_good_log_has_no_error_and_no_load(arm, plant_log):
    assert found(arm, plant_log) == ()
    assert unstated_load(evidence(arm, plant_log)) is None


def test_an_effort_that_is_too_large_is_named_with_its_size(arm, plant_log):
    errors = found(arm, scaled(plant_log, [1.0, 1.3]))

    elbow = next(error for error in errors if (error.kind, error.joint) == ("torque", "elbow"))
    assert abs(elbow.value - 0.3) < min(3.0 * elbow.std, 0.05)


def test_a_wrong_reduction_ratio_is_named_with_its_size(arm, plant_log):
    errors = found(arm, geared(plant_log, ELBOW, 1.1))

    elbow = next(error for error in errors if (error.kind, error.joint) == ("ratio", "elbow"))
    assert abs(elbow.value - 0.1) < min(3.0 * elbow.std, 0.03)


def test_a_load_that_the_file_does_not_state_is_named_with_its_mass(arm, plant_log):
    load = unstated_load(evidence(arm, carrying(plant_log)))

    assert load is not None
    assert abs(load.mass - MASS) < 0.05 * MASS
    assert found(arm, carrying(plant_log)) == ()


def test_the_verdict_names_the_error_and_the_key_that_corrects_it(arm, plant_log):
    log = geared(plant_log, ELBOW, 1.1)
    record = calibrate_logs(arm.model, [log], CalibrateOptions(), arm.regressor, None, lambda _: None)

    verdict = record.verdict
    assert verdict is not None
    said = [ground for ground in (*verdict.against, *verdict.doubted) if ground.code == "log_error"]
    assert len(said) == 1
    assert "the reduction ratio of elbow is wrong" in said[0].words
    assert "`gear_ratio`" in said[0].words


def test_an_encoder_that_stood_still_jumps(arm, plant_log):
    with pytest.raises(InputError, match=r"joint elbow: position jumps by .* rad after 6\.\d* s"):
        checked(stuck(plant_log, ELBOW, 5.0, 2.0), arm.model.mechanism, 8.0)


def test_rows_that_were_interpolated_are_counted(arm, plant_log):
    notes = checked(bridged(plant_log, 10, 0.3), arm.model.mechanism, 8.0).notes

    share = 10 * 0.3 / plant_log.duration
    said = next(note for note in notes if "look interpolated" in note)
    assert f"{share:.0%}" in said or f"{share - 0.01:.0%}" in said
    assert not checked(plant_log, arm.model.mechanism, 8.0).notes


@pytest.mark.parametrize("apart", [1.0, 3e-2, 1e-5])
def test_systems_are_solved_without_directions_that_the_samples_do_not_show(apart: float) -> None:
    """Columns of which two differ little or hardly: the truncated sum over NumPy's eigenvectors."""
    rng = np.random.default_rng(4)
    columns = rng.normal(size=(300, 12))
    columns[:, -1] = columns[:, 0] + apart * columns[:, -1]
    columns /= np.linalg.norm(columns, axis=0)
    gram, right = columns.T @ columns, rng.normal(size=12)
    sizes, vectors = np.linalg.eigh(gram)
    shown = sizes > 1e-6 * sizes[-1]
    expected = vectors[:, shown] @ ((vectors[:, shown].T @ right) / sizes[shown])
    assert shown.all() == (apart > 1e-3)
    np.testing.assert_allclose(solution(gram, right), expected, rtol=0, atol=1e-11 * np.abs(expected).max())
