"""Parts of a log on the workers of a Dask cluster: the same digits as in this process, whatever ends."""

from __future__ import annotations

import os
import signal
from concurrent.futures import CancelledError, Future
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from calibration.conftest import smooth_log

from psdmc.calibration.calibrate import CalibrateOptions, calibrate_logs
from psdmc.calibration.identify.linear_problem import LinearOptions
from psdmc.calibration.logs import parts
from psdmc.calibration.logs.log_files import write_log
from psdmc.calibration.logs.parts import LOST, Workers, each_part, on_cluster
from psdmc.errors import ToolchainError
from psdmc.report.calibrate_commands import CompiledWhenAsked, calibrate_command


class Cluster:
    """Stands for a client of a cluster that computes in this process, and is lost with its n-th part."""

    def __init__(self, lost_at: int) -> None:
        self.left = lost_at

    def submit(self, function: Any, *given: Any, pure: bool) -> Future[Any]:
        assert not pure
        future: Future[Any] = Future()
        self.left -= 1
        if self.left < -3:
            raise OSError("closed")
        if self.left < 0:
            future.set_exception(CancelledError())
        else:
            future.set_result(
                function(*(each.result() if isinstance(each, Future) else each for each in given))
            )
        return future


@pytest.mark.parametrize(("lost_at", "said"), [(100, []), (1, [LOST]), (4, [LOST]), (-9, [LOST])])
def test_results_come_in_order_and_nothing_is_lost(lost_at: int, said: list[str]):
    pytest.importorskip("distributed")
    told: list[str] = []
    token = parts._workers.set(Workers(Cluster(lost_at), 4, told.append))
    try:
        found = list(each_part(range(9), lambda k: k**2))
        again = list(each_part(range(3), lambda k: -k))
    finally:
        parts._workers.reset(token)

    assert found == [(k, k**2) for k in range(9)]
    assert again == [(0, 0), (1, -1), (2, -2)]
    assert told == said


def test_parts_in_this_process_are_not_all_in_memory():
    begun: list[int] = []

    def many():
        for k in range(50):
            begun.append(k)
            yield k

    for part, result in each_part(many(), lambda k: 2 * k):
        assert result == 2 * part
        assert len(begun) <= part + parts.AT_ONCE + 1


def test_a_scheduler_that_does_not_answer_is_named(arm, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    pytest.importorskip("distributed")
    monkeypatch.setattr("psdmc.workers.CONNECT", "0.1s")
    write_log(smooth_log(arm), tmp_path / "run.npz")
    with pytest.raises(ToolchainError, match=r"--scheduler tcp://127\.0\.0\.1:9: does not answer: "):
        calibrate_command(
            arm.unknown, [tmp_path / "run.npz"], tmp_path / "o.npz", scheduler="tcp://127.0.0.1:9"
        )
    assert not (tmp_path / "o.npz").exists()


@pytest.mark.slow
def test_a_worker_that_ends_changes_no_digit(arm, tmp_path: Path):
    distributed = pytest.importorskip("distributed")
    log = smooth_log(arm, seconds=30.0)
    options = CalibrateOptions(physical=False, linear=LinearOptions(stretch=500))
    told: list[str] = []

    def found(said: Any) -> np.ndarray:
        regressor = CompiledWhenAsked(arm.unknown, lambda step: None)
        record = calibrate_logs(arm.unknown, [log], options, regressor, None, said)
        return record.model.theta_b

    here = found(lambda step: None)
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, dashboard_address=None, local_directory=tmp_path / "dask"
    ) as cluster:
        with distributed.Client(cluster.scheduler_address) as client:
            process = next(iter(client.run(os.getpid).values()))

        def kill(step: str) -> None:
            told.append(str(step))
            if len([each for each in told if each.endswith("%")]) == 3:
                os.kill(process, signal.SIGKILL)

        with on_cluster(cluster.scheduler_address, told.append) as workers:
            there = found(kill)

    assert workers is not None
    assert not workers.lost
    assert len([each for each in told if each.endswith("%")]) > 10
    assert np.array_equal(here, there)
