"""Jobs in other processes: in order, and ended by Ctrl-C without a word."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from psdmc import workers
from psdmc.errors import ToolchainError
from psdmc.workers import in_a_new_process, in_processes


def process_of(job: int) -> tuple[int, int]:
    if job < 0:
        raise ZeroDivisionError(str(job))
    return job, os.getpid()


def test_results_come_in_order_from_other_processes():
    results = list(in_processes(process_of, range(5), 2))
    assert [job for job, _ in results] == list(range(5))
    assert os.getpid() not in {process for _, process in results}


@pytest.mark.parametrize(("jobs", "workers"), [((1, 2), 1), ((1,), 4), ((), 4)])
def test_one_worker_or_one_job_needs_no_process(jobs: tuple[int, ...], workers: int):
    assert list(in_processes(process_of, jobs, workers)) == [(job, os.getpid()) for job in jobs]


def test_an_error_of_a_job_is_the_callers():
    with pytest.raises(ZeroDivisionError, match="-1"):
        list(in_processes(process_of, [1, -1, 2], 2))
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_a_single_job_can_have_a_process_of_its_own():
    job, process = in_a_new_process(process_of, 3)
    assert job == 3
    assert process != os.getpid()


def leave(job: int) -> None:
    os._exit(1)


def test_a_worker_that_ends_is_an_error():
    with pytest.raises(ToolchainError, match="was ended from outside"):
        list(in_processes(leave, [1, 2, 3], 2))


def test_long_jobs_and_long_results():
    jobs = [bytes([number]) * 1_000_000 for number in range(7)]
    assert list(in_processes(bytes, jobs, 3)) == jobs


@pytest.mark.parametrize("threads", [0, 3])
def test_ctrl_c_while_processes_start_is_heard_behind(threads: int):
    """Whichever thread of this process takes it."""
    reached, end = [], threading.Event()
    others = [threading.Thread(target=end.wait) for _ in range(threads)]
    for other in others:
        other.start()

    def starts() -> None:
        with workers._deaf_to_interrupts():
            os.kill(os.getpid(), signal.SIGINT)
            time.sleep(0.2)
            reached.append("the end of the block")

    try:
        with pytest.raises(KeyboardInterrupt):
            starts()
    finally:
        end.set()
        for other in others:
            other.join()
    assert reached
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


HANGING = """
import sys, time
from pathlib import Path
sys.path.insert(0, {here!r})
from psdmc.workers import in_processes
from psdmc.cli.boundary import Interrupted, as_error
from test_processes import hang

if __name__ == "__main__":
    try:
        with as_error():
            list(in_processes(hang, [({marker!r}, bytes({size}))] * 3, 2))
    except Interrupted:
        print("interrupted")
"""


def hang(job: tuple[str, bytes]) -> None:
    Path(job[0]).touch()
    time.sleep(120)


@pytest.mark.parametrize("size", [0, 1_000_000])
def test_ctrl_c_ends_the_workers_without_a_word(size: int, tmp_path: Path):
    """Also while the next job is longer than a pipe holds: a pool of Python 3.11.2 waits for ever then."""
    marker = tmp_path / "started"
    main = HANGING.format(here=str(Path(__file__).parent), marker=str(marker), size=size)
    (tmp_path / "main.py").write_text(main)
    process = subprocess.Popen(
        [sys.executable, str(tmp_path / "main.py")],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    deadline = time.monotonic() + 60
    while not marker.exists() and time.monotonic() < deadline:
        time.sleep(0.05)
    os.killpg(process.pid, signal.SIGINT)

    assert process.communicate(timeout=30) == ("interrupted\n", "")


@pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="children are found in /proc")
def test_ctrl_c_while_the_benchmark_derives_is_one_line(tmp_path: Path):
    """As soon as the process that derives is there: it is importing then."""
    process = subprocess.Popen(
        [sys.executable, "-m", "psdmc.bench", "--quick", "KR6"],
        cwd=tmp_path,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    deadline = time.monotonic() + 60
    while not _is_spawning(process.pid) and time.monotonic() < deadline:
        time.sleep(0.02)
    time.sleep(0.5)
    os.killpg(process.pid, signal.SIGINT)
    said = process.communicate(timeout=60)[1]

    words = [line for line in said.splitlines() if " s  " not in line]
    assert words == ["error: interrupted"]
    assert process.returncode == 130


def _is_spawning(process: int) -> bool:
    children = Path(f"/proc/{process}/task/{process}/children").read_text().split()
    return any(b"spawn_main" in Path(f"/proc/{child}/cmdline").read_bytes() for child in children)
