"""HyQ hangs by its four feet from a ceiling and swings for 60 s: how much the energy changes, by method and step.

    python examples/contacts/swing.py HYQ.urdf --plot swing.png

The URDF is hyq_no_sensors.urdf of the Python package example-robot-data.
"""

from __future__ import annotations

import argparse

import numpy as np

import psdmc

FEET = ["lf_foot", "lh_foot", "rf_foot", "rh_foot"]
EVERY = 0.02
"""s between two stored energies."""

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


def energies(robot, step: str, dt: float, seconds: float, q, qd, tau) -> np.ndarray:
    """Return the energy T + V - tau q at times EVERY apart. The last term is the potential of constant torques."""
    found, take, on = [], getattr(robot, step), np.ones(4)
    for k in range(round(seconds / dt) + 1):
        if k % round(EVERY / dt) == 0:
            found.append(float(robot.kinetic_energy(q, qd) + robot.potential_energy(q) - tau[6:] @ q[7:]))
        q, qd, _ = take(q, qd, tau, dt, on)
    return np.array(found)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("urdf")
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--plot", metavar="FILE")
    given = parser.parse_args()
    model = psdmc.derive(given.urdf, floating=True, contacts=FEET)
    robot = psdmc.compile(
        model, functions=[*{name for name, _ in RUNS}, "kinetic_energy", "potential_energy"]
    )
    q, tau = resting(model)
    jacobian, push = model.contact_jacobian(q), np.array([0.3, 0.2, 0.1, 0.2, -0.3, 0.4])
    qd = np.concatenate([push, -np.linalg.solve(jacobian[:, 6:], jacobian[:, :6] @ push)])
    changes = {}
    for name, dt in RUNS:
        found = energies(robot, name, dt, given.seconds, q, qd, tau)
        changes[name, dt] = np.abs(found - found[0])
        print(f"{name:32} dt {1e3 * dt:.0f} ms: largest change {changes[name, dt].max():.1e} J")
    print(f"kinetic energy at the start: {float(robot.kinetic_energy(q, qd)):.1f} J")
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
