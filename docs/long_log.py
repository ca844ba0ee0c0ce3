"""Time and memory of `psdmc calibrate` on a long log: the figures of docs/campaigns.md.

python docs/long_log.py ROWS [csv|parquet|npz] [--rate HZ] [--kill SECONDS]

Seven joints at 1 kHz: time, CPU time and peak resident memory of the whole command. With --kill, a second command uses a
Dask cluster with two workers on this machine, one of which is killed after so many seconds.
"""

from __future__ import annotations

import argparse
import os
import resource
import signal
import subprocess
import sys
import tempfile
import time
from contextlib import ExitStack
from multiprocessing import get_context
from pathlib import Path
from threading import Timer

import numpy as np
import pyarrow
from distributed import Client, LocalCluster
from pyarrow import parquet

from psdmc.calibration.logs.log import Log
from psdmc.calibration.logs.log_files import columns_of, write_columns
from psdmc.compiler import derive
from psdmc.model import evaluate
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.model.store import save
from psdmc.reproducible import in_any_order

ROBOT = Path(__file__).resolve().parents[1] / "examples" / "robots" / "lbr7.toml"
AT_ONCE = 500_000
"""Rows that are computed and written at once."""


def rows_of_log(model: DynamicsModel, first: int, last: int, rate: float) -> Log:
    """Three sines a joint, torques by Newton-Euler, friction and noise; positions rounded to 1e-6 rad."""
    times = np.arange(first, last) / rate
    n = model.n
    q, qd, qdd = (np.zeros((len(times), n)) for _ in range(3))
    for size, low in ((0.5, 0.11), (0.25, 0.31), (0.1, 0.73)):
        w = 2 * np.pi * low * (1 + 0.13 * np.arange(n))
        angle = w * times[:, None] + np.arange(n)
        q += size * np.sin(angle)
        qd += size * w * np.cos(angle)
        qdd -= size * w**2 * np.sin(angle)
    with in_any_order():
        tau = evaluate.torques(model.mechanism, model.equivalent_parameters(), [q, qd, qdd])
    tau += 2.0 * np.tanh(qd / 0.03) + 3.0 * qd
    tau += 0.3 * np.random.default_rng([1, first]).standard_normal(tau.shape)
    return Log("long", model.joint_names, times, np.round(q / 1e-6) * 1e-6, None, tau, "motor_torque")


def _written(model: DynamicsModel, rows: int, rate: float, log: Path) -> None:
    """Parquet in pieces, as a day of rows is larger than memory; other tables at once."""
    pieces = (
        columns_of(rows_of_log(model, first, min(first + AT_ONCE, rows), rate))
        for first in range(0, rows, AT_ONCE)
    )
    if log.suffix != ".parquet":
        all_pieces = list(pieces)
        write_columns(
            {name: np.concatenate([one[name] for one in all_pieces]) for name in all_pieces[0]}, log
        )
        return
    with ExitStack() as stack:
        writer = None
        for piece in pieces:
            table = pyarrow.table(piece)
            writer = writer or stack.enter_context(parquet.ParquetWriter(log, table.schema))
            writer.write_table(table)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("rows", type=int)
    parser.add_argument("table", nargs="?", default="csv", choices=("csv", "parquet", "npz"))
    parser.add_argument("--rate", type=float, default=1000.0, help="Hz")
    parser.add_argument("--kill", type=float, metavar="SECONDS")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        model, log = Path(folder) / "m.npz", Path(folder) / f"log.{options.table}"
        known = derive(ROBOT, drive_inertia=True)
        save(known, model)
        # In a process of its own: a child's largest memory includes that of the process that starts it.
        writer = get_context("spawn").Process(target=_written, args=(known, options.rows, options.rate, log))
        writer.start()
        writer.join()
        print(f"{options.rows:,} rows, {log.stat().st_size / 2**20:.0f} MiB {options.table}")
        alone = _calibrated(model, log, Path(folder) / "alone.npz")
        if options.kill is None:
            return
        with (
            LocalCluster(n_workers=2, threads_per_worker=1, local_directory=folder) as cluster,  # type: ignore[no-untyped-call]
            Client(cluster) as client,  # type: ignore[no-untyped-call]
        ):
            victim = min(client.run(os.getpid).values())
            timer = Timer(options.kill, os.kill, (victim, signal.SIGKILL))
            timer.start()
            at = ("--scheduler", cluster.scheduler_address)
            together = _calibrated(model, log, Path(folder) / "together.npz", *at)
            if timer.is_alive():
                timer.cancel()
                sys.exit(f"the command ended within {options.kill:g} s, before a worker was killed")
            largest = max(client.run(_largest_memory).values())
        same = "the same file" if together == alone else "ANOTHER FILE"
        print(f"with a worker killed after {options.kill:g} s: {same}; workers: {largest:.0f} MiB at most")


def _calibrated(model: Path, log: Path, out: Path, *more: str) -> bytes:
    """Print the figures of the command, and return the file that it writes."""
    words = [sys.executable, "-m", "psdmc", "calibrate", str(model), str(log), "-o", str(out), *more]
    begin = time.perf_counter()
    with (out.parent / "said").open("w+b") as said:
        started = subprocess.Popen(words, stdout=said, stderr=subprocess.STDOUT)
        _, status, used = os.wait4(started.pid, 0)
        lasted = time.perf_counter() - begin
        said.seek(0)
        lines = said.read().decode().splitlines()
        print("\n".join(line for line in lines if status or line.startswith("verdict:")))
    print(
        f"exit {os.waitstatus_to_exitcode(status)}: {lasted:.0f} s, of CPU {used.ru_utime:.0f} s and of the system "
        f"{used.ru_stime:.0f} s, {used.ru_maxrss / 1024:.0f} MiB at most"
    )
    if status:
        sys.exit("the command failed")
    return out.read_bytes()


def _largest_memory() -> float:
    """MiB of this process so far."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


if __name__ == "__main__":
    main()
