"""Logs larger than memory: read in pieces, fitted stretch by stretch, and the same answer as of a log held whole."""

from __future__ import annotations

import pickle
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from calibration.conftest import smooth_log

from psdmc.calibration.calibrate import CalibrateOptions, calibrate, calibrate_logs
from psdmc.calibration.identify.linear_problem import LinearOptions
from psdmc.calibration.logs.filter import even_grid, filtered, independent_rows, noticed, stretches
from psdmc.calibration.logs.formats import WRITTEN, npz, parquet, text
from psdmc.calibration.logs.log import Log, RowStore, StoredLog, without_start
from psdmc.calibration.logs.log_checks import checked
from psdmc.calibration.logs.log_files import open_log, read_log, write_log
from psdmc.calibration.logs.log_survey import surveyed
from psdmc.calibration.logs.low_pass import FilterOptions, LowPass
from psdmc.calibration.verdict.record import Calibration
from psdmc.errors import InputError

HELD = 20_000
"""Bytes: a seventh of the log's."""
STRETCH = 1500


@pytest.fixture
def long_log(arm) -> Log:
    return replace(smooth_log(arm, seconds=30.0), velocity=None)


def in_pieces(log: Log, folder: Path, suffix: str, monkeypatch: pytest.MonkeyPatch) -> StoredLog:
    monkeypatch.setattr(text, "PIECE_BYTES", 5000)
    monkeypatch.setattr(npz, "PIECE_ROWS", 700)
    monkeypatch.setattr(parquet, "PIECE_ROWS", 700)
    path = folder / f"long{suffix}"
    write_log(log, path)
    found = open_log(path, held=HELD)
    assert isinstance(found, StoredLog)
    return found


@pytest.mark.parametrize("suffix", WRITTEN)
def test_a_table_in_pieces_holds_what_the_table_holds(
    long_log: Log, tmp_path: Path, suffix: str, monkeypatch
):
    stored = in_pieces(long_log, tmp_path, suffix, monkeypatch)
    whole = read_log(tmp_path / f"long{suffix}")

    assert np.array_equal(stored.time, whole.time)
    for start, stop in ((0, len(whole)), (0, 1), (1234, 1500), (len(whole) - 3, len(whole) + 5)):
        part, own = stored.rows(start, stop), whole.rows(start, stop)
        assert np.array_equal(part.position, own.position)
        assert np.array_equal(part.effort, own.effort)
    turned = stored.ordered(("elbow", "shoulder")).rows(0, 100)
    assert np.array_equal(turned.position, whole.position[:100, ::-1])


def numbers(record: Calibration) -> np.ndarray:
    rows = [*record.parameters, *record.friction]
    quality = [both.held_out.r2 for both in record.steps[0].joints.values()]
    return np.array([[row.value for row in rows] + quality, [row.std for row in rows] + quality])


@pytest.mark.parametrize("physical", [False, True])
@pytest.mark.parametrize("jitter", [0.0, 0.3])
def test_in_stretches_the_answer_is_that_of_the_log_held_whole(
    arm, long_log: Log, tmp_path: Path, jitter: float, physical: bool, monkeypatch
):
    if physical:
        pytest.importorskip("cvxpy")
    rng = np.random.default_rng(5)
    time = long_log.time + jitter * long_log.period * rng.uniform(-0.5, 0.5, len(long_log))
    log = replace(long_log, time=time - time[0])
    stored = in_pieces(log, tmp_path, ".npz", monkeypatch)

    def found(source, stretch: int, held: int) -> np.ndarray:
        options = CalibrateOptions(physical=physical, linear=LinearOptions(stretch=stretch, held_bytes=held))
        return numbers(calibrate_logs(arm.model, [source], options, arm.regressor, None, lambda step: None))

    whole, parts = found(log, 10**6, 10**9), found(stored, STRETCH, 1000)
    known = np.isfinite(whole)

    limit = 1e-9 if not physical else 1e-6  # a solver of cones stops there
    assert np.abs(parts[known] - whole[known]).max() <= limit * np.abs(whole[known]).max()
    assert np.all(np.isfinite(parts) == known)


def test_stretches_are_the_states_of_the_whole(arm, long_log: Log):
    options = FilterOptions(cutoff=8.0)
    log = checked(long_log, arm.model.chain, 8.0)
    whole = filtered(log, options)
    rows = []

    for stretch in stretches(log, options, rows=STRETCH):
        at = stretch.at + stretch.states.first
        rows += at.tolist()
        for name in ("q", "qd", "qdd", "effort"):
            ours, theirs = getattr(stretch.states, name)[stretch.at], getattr(whole, name)[at]
            assert np.abs(ours - theirs).max() < 1e-12 * max(np.abs(getattr(whole, name)).max(), 1.0) * 1e3
    assert rows == independent_rows(even_grid(log), options).tolist()


def test_a_fault_in_a_later_piece_has_its_own_line(long_log: Log, tmp_path: Path, monkeypatch):
    in_pieces(long_log, tmp_path, ".csv", monkeypatch)
    lines = (tmp_path / "long.csv").read_text(encoding="utf-8").splitlines()
    cells = lines[6000].split(",")
    lines[6000] = ",".join(["spam", *cells[1:]])
    (tmp_path / "long.csv").write_text("\n".join(lines), encoding="utf-8")

    with pytest.raises(InputError, match=r"line 6001, column 'time_s': 'spam' is no number"):
        open_log(tmp_path / "long.csv", held=HELD)


def test_decimal_commas_after_points_are_refused_in_pieces_too(long_log: Log, tmp_path: Path, monkeypatch):
    in_pieces(long_log, tmp_path, ".csv", monkeypatch)
    text = (tmp_path / "long.csv").read_text(encoding="utf-8").replace(",", ";")
    half = len(text) // 2
    (tmp_path / "long.csv").write_text(text[:half] + text[half:].replace(".", ","), encoding="utf-8")

    with pytest.raises(InputError, match=r"numbers with both ',' and '\.'"):
        open_log(tmp_path / "long.csv", held=HELD)


def test_a_value_that_is_no_number_is_found_in_any_stretch(arm, long_log: Log, tmp_path: Path, monkeypatch):
    effort = np.array(long_log.effort)
    effort[7000:7003, 1] = np.nan
    stored = in_pieces(replace(long_log, effort=effort), tmp_path, ".npz", monkeypatch)
    monkeypatch.setattr("psdmc.calibration.logs.log_survey.STRETCH_ROWS", 512)

    with pytest.raises(
        InputError, match=r"joint elbow is not finite in 3 row\(s\), the first is row 7001 of 7500"
    ):
        checked(stored, arm.model.chain, 8.0)


def test_progress_is_said(arm, long_log: Log, tmp_path: Path, monkeypatch):
    said: list[str] = []
    monkeypatch.setattr("psdmc.calibration.logs.log_files.SMALL_FILE", 1000)
    write_log(long_log, tmp_path / "long.csv")

    calibrate(arm.model, tmp_path / "long.csv", CalibrateOptions(physical=False), progress=said.append)

    assert any(text.startswith("reading long.csv: 7,500 rows") for text in said)
    assert any(text.startswith("linear fit: long.csv: ") and text.endswith("%") for text in said)


def test_rows_go_to_disk_when_they_are_many_and_come_back_as_they_were():
    rng = np.random.default_rng(1)
    pieces = [rng.standard_normal((k, 3)) for k in (5, 1, 40, 7)]
    few, many = RowStore(3, held=10**6), RowStore(3, held=600)
    for piece in pieces:
        few.append(piece)
        many.append(piece)

    assert not few.on_disk
    assert many.on_disk
    whole = np.concatenate(pieces)
    for start, stop in ((0, 53), (4, 8), (44, 60), (53, 60)):
        assert np.array_equal(few.rows(start, stop), whole[start:stop])
        assert np.array_equal(many.rows(start, stop), whole[start:stop])


def test_what_is_kept_of_all_rows_is_of_these_rows(long_log: Log, tmp_path: Path, monkeypatch):
    """Views of one log on disk give what each of them gives in memory."""
    stored = in_pieces(long_log, tmp_path, ".npz", monkeypatch)
    renamed = replace(stored, joint_names=("one", "two"))
    effort = replace(stored, quantity="current")
    views = [stored, stored.ordered(("elbow", "shoulder")), without_start(stored, 3.0), renamed, effort]
    options = FilterOptions(cutoff=8.0)

    for view in (*views, *views):
        held = view.held()
        ours, theirs = surveyed(view, 0.02), surveyed(held, 0.02)
        assert [each.joint for each in ours.saturated] == [each.joint for each in theirs.saturated]
        for name in ("reach", "motion", "speed", "largest_effort", "steps"):
            assert np.array_equal(getattr(ours, name), getattr(theirs, name)), name
        grids = even_grid(view), even_grid(held)
        low_pass = LowPass.design(options, grids[0].period)
        assert np.array_equal(*(noticed(grid, low_pass, options).motion for grid in grids))
    kept = len(stored.store.kept)
    surveyed(stored, 0.02)
    assert kept == len(stored.store.kept) == 2 * len(views)


def test_one_uneven_step_is_found_in_any_block(long_log: Log, monkeypatch):
    monkeypatch.setattr(sys.modules["psdmc.calibration.logs.filter"], "TIMES_AT_ONCE", 1000)
    time = long_log.time.copy()
    assert even_grid(replace(long_log, time=time)).same
    time[2500] += 1e-3 * long_log.period
    assert not even_grid(replace(long_log, time=time)).same


def test_the_period_of_a_long_log_is_that_of_all_its_rows(long_log: Log, monkeypatch):
    """Times in ms of 300 Hz repeat every three rows: 3, 4 and 3 ms."""
    module = sys.modules["psdmc.calibration.logs.log"]
    log = replace(long_log, time=np.round(np.arange(len(long_log)) / 300.0, 3))
    expected = np.median(np.diff(log.time))
    monkeypatch.setattr(module, "MOST_STEPS", 2000)
    monkeypatch.setattr(module, "RUNS", 20)
    for first in range(3):
        assert log.rows(first, len(log)).period == pytest.approx(expected, rel=1e-12)


def test_a_cluster_gets_no_log(arm, long_log: Log, tmp_path: Path, monkeypatch):
    """What workers run can be pickled for a log on disk, and has no rows of a log in memory."""
    cloudpickle = pytest.importorskip("cloudpickle")
    stored = in_pieces(long_log, tmp_path, ".npz", monkeypatch)
    sizes = []

    def each_part(parts, work):
        sizes.append(len(cloudpickle.dumps(work)))
        return ((part, work(part)) for part in parts)

    for name in ("identify.linear_problem", "verdict.delivered", "verdict.evidence"):
        monkeypatch.setattr(sys.modules[f"psdmc.calibration.{name}"], "each_part", each_part)
    options = CalibrateOptions(physical=False, linear=LinearOptions(stretch=STRETCH))
    for log in (stored, long_log):
        calibrate_logs(arm.model, [log], options, arm.regressor, None, lambda step: None)

    assert len(sizes) == 6
    assert sizes[:3] == sizes[3:]


def test_parts_are_the_same_once_they_were_sent(arm, long_log: Log):
    """Pickling makes views contiguous: sums over them must not depend on that."""
    (part,) = stretches(checked(long_log, arm.model.chain, 8.0), FilterOptions(cutoff=8.0))
    sent = pickle.loads(pickle.dumps(part.states))
    for name in ("q", "qd", "qdd", "effort", "raw"):
        assert getattr(part.states, name).strides == getattr(sent, name).strides, name
