"""Pictures of a jump: its course over time, and the robot from the side."""

from __future__ import annotations

from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from jump import FEET, TORQUE, Array, Jump, solo12
from matplotlib.animation import FuncAnimation, PillowWriter

COLOURS = ("tab:blue", "tab:orange", "tab:green", "tab:red")


def plot(found: Jump, file: Path) -> None:
    """Heights of base and feet, contact forces, torques, and four moments of the motion."""
    legs = legs_of(found)
    nodes = found.tau.shape[1]
    time, dt = np.linspace(0.0, found.duration, nodes + 1), found.duration / nodes
    figure, axes = plt.subplots(2, 2, figsize=(11, 7), layout="constrained")
    (height, forces), (torques, side) = axes
    height.plot(time, 100.0 * found.q[2], color="black", label="base")
    for k, foot in enumerate(FEET):
        height.plot(time, 100.0 * legs[:, k, -1, 2], color=COLOURS[k], linewidth=0.9, label=foot)
        forces.step(
            time[:-1], found.force[3 * k + 2], where="post", color=COLOURS[k], linewidth=0.9, label=foot
        )
    height.set(xlabel="time (s)", ylabel="height (cm)")
    forces.set(xlabel="time (s)", ylabel="vertical force (N)")
    torques.step(time[:-1], found.tau.T, where="post", linewidth=0.7)
    for limit in (-TORQUE, TORQUE):
        torques.axhline(limit, color="black", linewidth=0.8, linestyle=":")
    torques.set(xlabel="time (s)", ylabel="joint torques (N m), limits dotted")
    moments = [0, nodes * 2 // 5, nodes * 11 // 20, nodes]
    for shade, k, above in zip((0.75, 0.5, 0.25, 0.0), moments, (-0.045, 0.03, 0.03, -0.045), strict=True):
        draw(side, legs[k], str(shade))
        place = legs[k][:, 0].mean(axis=0)[[0, 2]] + [-0.05, above]
        side.annotate(f"{k * dt:.2f} s", place, fontsize="small")
    dress(side, legs)
    for axis in (height, forces):
        axis.legend(fontsize="small")
    for axis in (height, forces, torques):
        axis.grid(alpha=0.3)
    figure.savefig(file, dpi=90)
    plt.close(figure)


def animate(found: Jump, file: Path) -> None:
    """From the side, at a fifth of the speed."""
    legs = legs_of(found)
    figure, axis = plt.subplots(figsize=(6.4, 3.6), layout="constrained")

    def shown(k: int) -> list:
        axis.clear()
        draw(axis, legs[k], "black")
        axis.set_title(f"{k * found.duration / (len(legs) - 1):.2f} s", fontsize="medium")
        dress(axis, legs)
        return []

    frames = [0] * 5 + list(range(len(legs))) + [len(legs) - 1] * 10
    FuncAnimation(figure, shown, frames=frames).save(file, writer=PillowWriter(fps=16), dpi=80)
    plt.close(figure)


def legs_of(found: Jump) -> Array:
    """(nodes + 1, 4, 4, 3) m: shoulder, hip, knee and foot of each leg."""
    links = [
        [f"{foot[:2]}_{link}" for link in ("SHOULDER", "UPPER_LEG", "LOWER_LEG", "FOOT")] for foot in FEET
    ]
    model = solo12([name for leg in links for name in leg])
    q = found.q.T.copy()
    q[:, 3:7] /= np.linalg.norm(q[:, 3:7], axis=1, keepdims=True)
    return model.forward_kinematics(q)[0].reshape(len(q), 4, 4, 3)


def draw(axis: plt.Axes, legs: Array, colour: str) -> None:
    trunk = legs[[0, 1, 3, 2, 0], 0]
    axis.plot(trunk[:, 0], trunk[:, 2], color=colour, linewidth=5.0, solid_capstyle="round")
    for leg in legs:
        axis.plot(leg[:, 0], leg[:, 2], color=colour, linewidth=2.0, marker="o", markersize=3.0)


def dress(axis: plt.Axes, legs: Array) -> None:
    axis.axhline(0.0, color="tab:brown", linewidth=1.5)
    reach = (legs[..., 0].min() - 0.08, legs[..., 0].max() + 0.08)
    axis.set(
        xlim=reach, ylim=(-0.03, legs[..., 2].max() + 0.08), xlabel="x (m)", ylabel="z (m)", aspect="equal"
    )
