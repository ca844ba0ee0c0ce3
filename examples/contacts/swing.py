"""Robots that are held swing for 60 s: how much the energy changes, by method and step.

    python examples/contacts/swing.py HYQ.urdf --plot swing.png
    python examples/contacts/swing.py four_bar.toml --plot swing_loop.png

HyQ hangs by its four feet from a ceiling. The URDF is hyq_no_sensors.urdf of the Python package example-robot-data.
The four-bar linkage of docs/how-to/loops.md falls from rest; gains keep its loop closed.
"""

from __future__ import annotations

import argparse

import numpy as np

import psdmc

FEET = ["lf_foot", "lh_foot", "rf_foot", "rh_foot"]
EVERY = 0.02
"""s between two stored energies."""

GAINS = {"kp": 400.0, "kd": 40.0}
"""Of the loop, 1/s^2 and 1/s. HyQ needs none."""

RUNS = [
    (name, dt)
    for name in ("constrained_semi_implicit_euler", "constrained_rk4_step")
    for dt in (0.004, 0.002)
]


def resting(model: psdmc.DynamicsModel) -> tuple[np.ndarray, np.ndarray]:
    """Return a position below the feet, and the motors' torques at which the robot rests there."""
    front, hind = [0.0, 0.8 + np.pi, -1.6], [0.0, -0.8 + np.pi, 1.6]
    q = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, *front, *hind, *front, *hind])
    jacobian, gravity = model.contact_jacobian(q), model.gravity(q)
    forces = np.linalg.lstsq(jacobian[:, :6].T, gravity[:6], rcond=None)[0]
    return q, np.concatenate([np.zeros(6), (gravity - jacobian.T @ forces)[6:]])


def hanging(file: str) -> tuple[psdmc.DynamicsModel, np.ndarray, np.ndarray, np.ndarray]:
    """Return HyQ below its feet, with q, qd and tau at the start."""
    model = psdmc.derive(file, floating=True, contacts=FEET)
    q, tau = resting(model)
    jacobian, push = model.contact_jacobian(q), np.array([0.3, 0.2, 0.1, 0.2, -0.3, 0.4])
    return model, q, np.concatenate([push, -np.linalg.solve(jacobian[:, 6:], jacobian[:, :6] @ push)]), tau


def linkage(file: str) -> tuple[psdmc.DynamicsModel, np.ndarray, np.ndarray, np.ndarray]:
    """Return the four-bar linkage at rest, with q, qd and tau at the start."""
    model = psdmc.derive(file)
    return model, model.assemble([-0.75, 2.0, 1.9]), np.zeros(3), np.zeros(3)


def energies(robot, step: str, dt: float, seconds: float, q, qd, tau, on) -> np.ndarray:
    """Return the energy T + V - tau q at times EVERY apart. The last term is the potential of constant torques."""
    take, base = getattr(robot, step), 6 * (len(q) > len(tau))
    gains, found = {} if base else GAINS, []
    for k in range(round(seconds / dt) + 1):
        if k % round(EVERY / dt) == 0:
            stored = robot.kinetic_energy(q, qd) + robot.potential_energy(q)
            found.append(float(stored - tau[base:] @ q[len(q) - len(tau) + base :]))
        q, qd, _ = take(q, qd, tau, dt, on, **gains)
    return np.array(found)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("robot", help="HyQ's URDF, or the DH table (.toml) of a linkage")
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--plot", metavar="FILE")
    given = parser.parse_args()
    model, q, qd, tau = (linkage if given.robot.endswith(".toml") else hanging)(given.robot)
    on = np.full(len(model.contacts), float(not given.robot.endswith(".toml")))
    robot = psdmc.compile(
        model, functions=[*{name for name, _ in RUNS}, "kinetic_energy", "potential_energy"]
    )
    changes = {}
    for name, dt in RUNS:
        found = energies(robot, name, dt, given.seconds, q, qd, tau, on)
        changes[name, dt] = np.abs(found - found[0])
        print(f"{name:32} dt {1e3 * dt:.0f} ms: largest change {changes[name, dt].max():.1e} J")
    start = float(robot.kinetic_energy(q, qd) + robot.potential_energy(q))
    print(f"energy at the start: {start:.2f} J")
    if given.plot:
        plot(changes, given.plot)


def plot(changes: dict[tuple[str, float], np.ndarray], file: str) -> None:
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axis = plt.subplots(figsize=(8, 4), layout="constrained")
    for (name, dt), change in changes.items():
        times = EVERY * np.arange(len(change))
        axis.semilogy(times, change + 1e-14, linewidth=0.7, label=f"{name}, {1e3 * dt:.0f} ms")
    axis.set(xlabel="time (s)", ylabel="change of energy (J)", ylim=(1e-12, None))
    axis.grid(alpha=0.3)
    axis.legend(fontsize="small", loc="lower right")
    figure.savefig(file, dpi=90)


if __name__ == "__main__":
    main()
