"""A quadruped that trots in place in MuJoCo under a whole-body controller in C at 1 kHz.

`python trot.py [--seconds S] [--folder F] [--plot FILE]` derives ANYmal B of example-robot-data, emits its package,
generates the QP solver, builds the controller and runs it; the last lines say how it went.
"""

from __future__ import annotations

import argparse
import importlib.metadata
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from library import Controller
from solver import write_solver
from world import World

import psdmc

PERIOD = 1e-3
"""s between two calls of the controller."""
FEET = ("LF_FOOT", "RF_FOOT", "LH_FOOT", "RH_FOOT")
BASE = "base"
STANDING = {"HAA": 0.0, "HFE": 0.7, "KFE": -1.2}
"""rad, of the fore legs; the hind legs' knees bend the other way."""
PUSHED = (2.0, 2.1)
"""s from when to when a push acts."""
FUNCTIONS = ("mass_matrix", "nonlinear_effects", "forward_kinematics", "frame_jacobian", "jacobian_dot_qd")

Array = np.ndarray


@dataclass(frozen=True)
class Run:
    """Rows are calls of the controller. time (k,) s; q (k, 19), v (k, 18); tau (k, 12); acceleration (k, 18) and force
    (k, 4, 3) of the QP; floor (k, 4, 3) N as MuJoCo has them; stance (k, 4); qp, whole (k,) s; iterations, solved (k,)."""

    time: Array
    q: Array
    v: Array
    tau: Array
    acceleration: Array
    force: Array
    floor: Array
    stance: Array
    qp: Array
    whole: Array
    iterations: Array
    solved: Array

    @property
    def way(self) -> Array:
        """(k,) m of the base from where it began."""
        return np.asarray(np.linalg.norm(self.q[:, :3] - self.q[0, :3], axis=1))

    @property
    def tilt(self) -> Array:
        """(k,) rad that the base is turned by."""
        return np.asarray(2.0 * np.arcsin(np.linalg.norm(self.q[:, 3:6], axis=1)))


def anymal() -> Path:
    wheel = importlib.metadata.distribution("example-robot-data")
    wanted = "anymal_b_simple_description/robots/anymal.urdf"
    return Path(
        str(wheel.locate_file(next(file for file in wheel.files or () if str(file).endswith(wanted))))
    )


def prepared(folder: Path, urdf: Path) -> tuple[psdmc.DynamicsModel, Path]:
    """The model, and the folder of its C package with OSQP's code in it."""
    model = psdmc.derive(urdf, floating=True, frames=FEET)
    package = folder / "anymal"
    if not (package / "manifest.json").exists():
        psdmc.emit_c(model, package, functions=FUNCTIONS, name="robot")
    write_solver(model, package / "qp")
    return model, package


def standing(model: psdmc.DynamicsModel) -> Array:
    """(12,) joint positions, by the joints' names."""
    found = []
    for name in model.joint_names[1:]:
        leg, joint = name.split("_")
        found.append(STANDING[joint] * (-1.0 if leg.endswith("H") else 1.0))
    return np.array(found)


def trot(world: World, controller: Controller, start: Array, seconds: float, push: float = 0.0) -> Run:
    """From rest on four feet, with the joints at `start`; `push` (N) is a force on the base to the left for PUSHED."""
    world.place(start)
    controller.begin(world.state().q)
    rows = []
    for time in np.arange(round(seconds / PERIOD)) * PERIOD:
        state = world.state()
        command = controller.step(time, state.q, state.v)
        tau = controller.array(command.tau)
        world.push(push if PUSHED[0] <= time < PUSHED[1] else 0.0)
        world.advance(tau, PERIOD)
        rows.append(
            (
                time,
                state.q,
                state.v,
                tau,
                controller.array(command.acceleration),
                controller.array(command.force).reshape(-1, 3),
                world.forces(),
                controller.array(command.stance),
                command.qp_seconds,
                command.whole_seconds,
                command.iterations,
                command.solved,
            )
        )
    return Run(*map(np.array, zip(*rows, strict=True)))


def report(run: Run, limit: Array) -> str:
    share = float(np.max(np.abs(run.tau) / limit))
    steps = int(np.sum(np.diff(run.stance, axis=0) < 0))
    cm, degrees = 100.0 * run.way.max(), np.degrees(run.tilt.max())
    qp, whole = (1e6 * np.percentile(times, (50, 99)) for times in (run.qp, run.whole))
    return "\n".join(
        [
            f"{len(run.time)} calls, {PERIOD * len(run.time):g} s, {steps} steps",
            f"base: at most {cm:.1f} cm from where it began, {degrees:.1f} degrees turned",
            f"torques: at most {100 * share:.0f} % of the limits",
            f"QP: {int(np.sum(run.solved == 0))} not solved, {int(np.median(run.iterations))} iterations (median),"
            f" {run.iterations.max()} at most",
            f"QP: {qp[0]:.0f} us (median), {qp[1]:.0f} us (99th percentile)",
            f"whole call: {whole[0]:.0f} us (median), {whole[1]:.0f} us (99th percentile)",
        ]
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--seconds", type=float, default=10.0)
    parser.add_argument("--folder", type=Path, default=Path("generated/trotting"))
    parser.add_argument("--push", type=float, default=0.0, help="N, sideways on the base for 0.1 s")
    parser.add_argument("--plot", type=Path, help="a picture of the run")
    given = parser.parse_args()
    urdf = anymal()
    model, package = prepared(given.folder, urdf)
    world = World(urdf.read_text(), BASE, model.joint_names[1:], FEET)
    run = trot(world, Controller(package), standing(model), given.seconds, given.push)
    limit = np.array([joint.limits.effort for joint in model.chain.joints[1:]])
    print(report(run, limit))
    if given.plot:
        from plots import plot

        plot(run, given.plot)
        print(f"{given.plot} written")


if __name__ == "__main__":
    main()
