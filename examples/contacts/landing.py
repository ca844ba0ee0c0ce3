"""HyQ lands on its four feet while it moves sideways: contact impulses in friction cones, by a quadratic programme.

    python examples/contacts/landing.py HYQ.urdf --plot landing.png

The URDF is hyq_no_sensors.urdf of the Python package example-robot-data. In each step, psdmc computes the matrix
`delassus` and the feet's velocities without contact. The solver Clarabel finds the impulses. Install it with
`pip install clarabel`.
"""

from __future__ import annotations

import argparse

import clarabel
import numpy as np
from scipy import sparse

import psdmc

FEET = ["lf_foot", "lh_foot", "rf_foot", "rh_foot"]
FRICTION = 0.5
STEP = 0.003
"""s."""

ROUNDS, SETTLED = 50, 1e-9
"""Most programmes per step, and the change of sliding speeds (m/s) that ends them. The first programme lets sliding feet
rise; the others correct this."""

STIFFNESS, DAMPING = 400.0, 14.0
"""N m/rad and N m s/rad of the joints' controller."""

FRONT, HIND = [0.0, 0.8, -1.6], [0.0, -0.8, 1.6]
CROUCHED = np.array([*FRONT, *HIND, *FRONT, *HIND])


def cone_programme(matrix: np.ndarray, free: np.ndarray, friction: float) -> np.ndarray:
    """Return the impulses p (3 for each contact) with the smallest p.D p / 2 + p.v for which friction times the normal
    impulse is at least the size of the tangential one.

    matrix  D, the change of the contacts' velocities per impulse
    free    v, the contacts' velocities (x, y, z; z is normal) without impulses
    """
    count = len(free) // 3
    rows = sparse.csc_matrix(np.kron(np.eye(count), -np.array([[0, 0, friction], [1, 0, 0], [0, 1, 0]])))
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = 1e-12
    solver = clarabel.DefaultSolver(
        sparse.csc_matrix(np.triu(matrix)),
        free,
        rows,
        np.zeros(3 * count),
        [clarabel.SecondOrderConeT(3)] * count,
        settings,
    )
    return np.array(solver.solve().x)


def coulomb_impulses(matrix: np.ndarray, free: np.ndarray, friction: float) -> np.ndarray:
    """Return impulses in friction cones. After the first programme, each further one adds friction times the sliding
    speed to the normal velocity (De Saxce's term), so that sliding feet stay on the ground."""
    sliding = np.zeros(len(free) // 3)
    for _ in range(ROUNDS):
        impulses = cone_programme(matrix, free + np.kron(friction * sliding, [0.0, 0.0, 1.0]), friction)
        before, sliding = sliding, np.linalg.norm((matrix @ impulses + free).reshape(-1, 3)[:, :2], axis=1)
        if np.abs(sliding - before).max() < SETTLED:
            break
    return impulses


class World:
    """HyQ above a plane at height zero, on which its feet are points."""

    def __init__(self, urdf: str) -> None:
        self.model = psdmc.derive(urdf, floating=True, contacts=FEET)
        self.q = np.array([0.0, 0.0, 0.65, 0.0, 0.0, 0.0, 1.0, *CROUCHED])
        self.qd = np.array([0.5, 0.25, -1.0, 0.0, 0.0, 0.0, *np.zeros(12)])

        still = np.zeros(len(self.qd))
        tau, _ = self.model.contact_inverse_dynamics(self.q, still, still, np.ones(len(FEET)))
        self.standing = tau[6:]

    def heights(self, q: np.ndarray) -> np.ndarray:
        return self.model.forward_kinematics(q)[0][:, 2]

    def free_velocity(self) -> np.ndarray:
        """The joint rates after a step without contact."""
        motors = self.standing + STIFFNESS * (CROUCHED - self.q[7:]) - DAMPING * self.qd[6:]
        tau = np.concatenate([np.zeros(6), motors])
        return self.qd + STEP * self.model.forward_dynamics(self.q, self.qd, tau)

    def problem(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Return D, the velocities v of the feet in x and y and those to the ground in z, the Jacobian, and the joint
        rates without contact. A foot above the ground may fall by its height in a step."""
        q, rates = self.q, self.free_velocity()
        jacobian = self.model.contact_jacobian(q)
        free = (jacobian @ rates).reshape(-1, 3)
        free[:, 2] += self.heights(q) / STEP
        return self.model.delassus(q), free.reshape(-1), jacobian, rates

    def step(self) -> dict[str, np.ndarray]:
        """Move by one step. Return forces (N) and velocities (m/s) of the feet."""
        matrix, free, jacobian, rates = self.problem()
        impulses = coulomb_impulses(matrix, free, FRICTION)
        bias = self.model.forward_dynamics(self.q, self.qd, np.zeros(len(self.qd)))
        push = self.model.forward_dynamics(self.q, self.qd, jacobian.T @ impulses)
        self.qd = rates + push - bias
        self.q = self.model.integrate(self.q, STEP * self.qd)
        forces = impulses.reshape(-1, 3) / STEP
        gaps = (matrix @ impulses + free).reshape(-1, 3)
        return {"force": forces, "velocity": gaps, "height": self.heights(self.q)}


def largest_ratio(force: np.ndarray) -> float:
    """The largest tangential force divided by its normal force, among feet that carry at least 1 N."""
    carries = force[:, 2] > 1.0
    return float(np.max(np.linalg.norm(force[:, :2], axis=1)[carries] / force[carries, 2], initial=0.0))


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("urdf")
    parser.add_argument("--seconds", type=float, default=0.8)
    parser.add_argument("--plot", metavar="FILE")
    given = parser.parse_args()
    world = World(given.urdf)
    weight = float(world.model.gravity(world.q)[2])
    rows = [world.step() for _ in range(round(given.seconds / STEP))]
    print("  time   normal force   friction ratio   sliding speed   lowest velocity   lowest foot")
    print("     s              N      at most 0.50             m/s    to ground, m/s             m")
    for k in range(0, len(rows), max(1, len(rows) // 10)):
        part = rows[k : k + max(1, len(rows) // 10)]
        normal = np.mean([row["force"][:, 2].sum() for row in part])
        ratio = max(largest_ratio(row["force"]) for row in part)
        carried = [row["force"][:, 2] > 1.0 for row in part]
        speed = max(
            np.linalg.norm(row["velocity"][:, :2], axis=1)[on].max(initial=0.0)
            for row, on in zip(part, carried, strict=True)
        )
        lowest = min(row["velocity"][:, 2].min() for row in part)
        foot = min(row["height"].min() for row in part)
        end = f"{lowest:18.1e}{foot:14.1e}" if normal > 0.1 else f"{'in the air':>18}{foot:14.1e}"
        print(f"{k * STEP:6.2f}{normal:15.1f}{ratio:17.4f}{speed:16.1e}{end}")
    print(f"weight: {weight:.1f} N, normal force in the last step: {rows[-1]['force'][:, 2].sum():.1f} N")
    if given.plot:
        plot(rows, weight, given.plot)


def plot(rows: list[dict[str, np.ndarray]], weight: float, path: str) -> None:
    import matplotlib.pyplot as plt

    time = STEP * np.arange(len(rows))
    force = np.array([row["force"] for row in rows])
    figure, (above, below) = plt.subplots(2, 1, sharex=True, figsize=(8, 5), layout="constrained")
    for k, name in enumerate(FEET):
        above.plot(time, force[:, k, 2], label=name)
        ratio = np.linalg.norm(force[:, k, :2], axis=1) / np.maximum(force[:, k, 2], 1.0)
        below.plot(time, np.where(force[:, k, 2] > 1.0, ratio, np.nan), label=name)
    above.set(ylabel="normal force (N)", ylim=(0.0, weight))
    below.set(ylabel="tangential / normal force", xlabel="time (s)", ylim=(0.0, 0.6))
    below.axhline(FRICTION, color="black", linestyle=":", linewidth=1.0)
    above.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))
    above.set_title("HyQ lands with a sideways motion; friction coefficient 0.5 (dotted)", fontsize=10)
    for each in (above, below):
        each.grid(alpha=0.3)
    figure.savefig(path, dpi=130)


if __name__ == "__main__":
    main()
