"""A picture of a run: where the base is, what the feet carry, how long the QP takes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from trot import FEET, Run

WINDOW = 1.0
"""s of forces that are shown, before the end."""


def plot(run: Run, file: Path) -> None:
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, (base, forces, times) = plt.subplots(3, figsize=(8, 8), layout="constrained")
    base.plot(run.time, 100.0 * (run.q[:, :3] - run.q[0, :3]), linewidth=0.8, label=["x", "y", "z"])
    base.set(xlabel="time (s)", ylabel="base from its start (cm)")
    late = run.time >= run.time[-1] - WINDOW
    for k, foot in enumerate(FEET):
        (line,) = forces.plot(run.time[late], run.floor[late, k, 2], linewidth=0.8, label=foot)
        forces.plot(
            run.time[late], run.force[late, k, 2], linewidth=0.8, linestyle=":", color=line.get_color()
        )
    forces.set(xlabel="time (s)", ylabel="vertical force (N)", title="MuJoCo's (lines) and the QP's (dots)")
    times.hist(1e6 * run.qp, bins=np.linspace(0.0, 1e6 * np.percentile(run.qp, 99.9), 80))
    times.axvline(1e6 * np.percentile(run.qp, 99), color="black", linewidth=0.8, label="99th percentile")
    times.set(xlabel="CPU time of a QP (us)", ylabel="calls", yscale="log")
    for axis in (base, forces, times):
        axis.grid(alpha=0.3)
        axis.legend(fontsize="small", loc="upper right")
    figure.savefig(file, dpi=70)
