"""Pictures of runs: where the base is, what the feet carry, how long a call takes, and the robots from the side."""

from __future__ import annotations

from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.animation import FuncAnimation, PillowWriter
from trot import FEET, PUSHED, Array, Run, anymal

import psdmc

WINDOW = 1.0
"""s of forces that are shown, before the end."""
SHOWN, EVERY, SLOWER = (1.75, 3.75), 0.025, 2.0
"""s of the animation, s between its pictures, and how much slower it is than the robot."""


def plot(runs: dict[str, Run], file: Path) -> None:
    """A column for each run."""
    figure, axes = plt.subplots(
        3, len(runs), figsize=(11, 8), layout="constrained", sharey="row", sharex="row"
    )
    for (base, forces, times), (name, run) in zip(axes.T, runs.items(), strict=True):
        base.plot(run.time, 100.0 * (run.q[:, :3] - run.q[0, :3]), linewidth=0.8, label=["x", "y", "z"])
        base.set(xlabel="time (s)", title=name)
        late = run.time >= run.time[-1] - WINDOW
        for k, foot in enumerate(FEET):
            (line,) = forces.plot(run.time[late], run.floor[late, k, 2], linewidth=0.8, label=foot)
            forces.plot(run.time[late], run.force[late, k, 2], ":", linewidth=0.8, color=line.get_color())
        forces.set(xlabel="time (s)", title="MuJoCo's (lines) and the controller's (dots)")
        most = 1e6 * max(np.percentile(each.whole, 99.5) for each in runs.values())
        times.hist(1e6 * run.whole, bins=np.linspace(0.0, most, 80))
        times.axvline(
            1e6 * np.percentile(run.whole, 99), color="black", linewidth=0.8, label="99th percentile"
        )
        times.set(xlabel="CPU time of a call (us)", yscale="log")
        forces.set_ylim(-5.0, 1.35 * run.floor[late, :, 2].max())
        for axis, across in ((base, 3), (forces, 4), (times, 1)):
            axis.grid(alpha=0.3)
            axis.legend(fontsize="small", loc="upper right", ncols=across)
    for axis, label in zip(
        axes[:, 0], ("base from its start (cm)", "vertical force (N)", "calls"), strict=True
    ):
        axis.set_ylabel(label)
    figure.savefig(file, dpi=70)
    plt.close(figure)


def animate(runs: dict[str, Run], file: Path) -> None:
    """The robots from behind and from the side, with the forces of MuJoCo's floor."""
    figure, axes = plt.subplots(2, len(runs), figsize=(8, 5), layout="constrained")
    first = next(iter(runs.values()))
    end = min(SHOWN[1], first.time[-1])
    moments = np.searchsorted(first.time, np.arange(min(SHOWN[0], 0.5 * end), end, EVERY))
    drawn = {name: legs_of(run.q[moments]) for name, run in runs.items()}

    def shown(k: int) -> list:
        time = first.time[moments[k]]
        pushed = ", pushed" if PUSHED[0] <= time < PUSHED[1] else ""
        for column, (name, run) in zip(axes.T, runs.items(), strict=True):
            for axis, across in zip(column, (0, 1), strict=True):
                axis.clear()
                draw(axis, drawn[name][k], run.floor[moments[k]], across)
            column[0].set_title(f"{name}, {time:.2f} s{pushed}", fontsize="medium")
        return []

    frames = FuncAnimation(figure, shown, frames=len(moments))
    frames.save(file, writer=PillowWriter(fps=round(1.0 / (EVERY * SLOWER))), dpi=70)
    plt.close(figure)


def legs_of(q: Array) -> Array:
    """(k, 4, 4, 3) m: hip, thigh, shank and foot of each leg."""
    links = [foot.replace("FOOT", link) for foot in FEET for link in ("HIP", "THIGH", "SHANK", "FOOT")]
    model = psdmc.derive(anymal(), floating=True, frames=links, expand=False)
    return model.forward_kinematics(q)[0].reshape(len(q), 4, 4, 3)


def draw(axis: plt.Axes, legs: Array, floor: Array, across: int) -> None:
    """Seen along the other horizontal axis; a force of 300 N is 0.3 m long."""
    trunk = legs[[0, 1, 3, 2, 0], 0]
    axis.plot(trunk[:, across], trunk[:, 2], color="black", linewidth=5.0, solid_capstyle="round")
    for leg, force in zip(legs, floor, strict=True):
        axis.plot(leg[:, across], leg[:, 2], color="black", linewidth=2.0, marker="o", markersize=3.0)
        tip = leg[-1] + 1e-3 * force
        axis.plot([leg[-1, across], tip[across]], [leg[-1, 2], tip[2]], color="tab:red", linewidth=1.2)
    axis.axhline(0.0, color="tab:brown", linewidth=1.5)
    axis.set(
        xlim=(-0.6, 0.6), ylim=(-0.05, 0.65), xlabel=f"{'xy'[across]} (m)", ylabel="z (m)", aspect="equal"
    )
