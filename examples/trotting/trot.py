"""A quadruped that trots in place in MuJoCo under a whole-body controller in C at 1 kHz, by two methods.

`python trot.py [--seconds S] [--folder F] [--push N] [--plot FILE] [--animation FILE]` derives ANYmal B of
example-robot-data, emits its package, generates the QP solver, builds the controller and runs it twice: with a quadratic
programme, and with contact-consistent inverse dynamics. A table compares the runs.
"""

from __future__ import annotations

import argparse
import importlib.metadata
from collections.abc import Callable
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
FUNCTIONS = (
    "mass_matrix",
    "nonlinear_effects",
    "forward_kinematics",
    "frame_jacobian",
    "jacobian_dot_qd",
    "contact_inverse_dynamics",
)
METHODS = {"quadratic programme": "BY_PROGRAMME", "inverse dynamics": "BY_CONTACTS"}
CARRIES = 20.0
"""N: the ratio of forces is of feet that carry at least so much."""

Array = np.ndarray


@dataclass(frozen=True)
class Run:
    """Rows are calls of the controller. time (k,) s; q (k, 19), v (k, 18); tau (k, 12); acceleration (k, 18) and force
    (k, 4, 3) that the controller counts on; floor (k, 4, 3) N as MuJoCo has them; stance (k, 4); qp, whole (k,) s;
    iterations, solved (k,)."""

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

    def friction(self, forces: Array) -> float:
        """The largest tangential force per normal force, of `force` or `floor`."""
        loaded = forces[forces[..., 2] > CARRIES]
        return float(np.max(np.linalg.norm(loaded[:, :2], axis=1) / loaded[:, 2]))


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


def trot(
    world: World,
    controller: Controller,
    start: Array,
    seconds: float,
    push: float = 0.0,
    method: str = "quadratic programme",
) -> Run:
    """From rest on four feet, with the joints at `start`; `push` (N) is a force on the base to the left for PUSHED."""
    world.place(start)
    controller.begin(world.state().q, METHODS[method])
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


def report(runs: dict[str, Run], limit: Array) -> str:
    """A table with one column per run."""
    first = next(iter(runs.values()))
    steps = int(np.sum(np.diff(first.stance, axis=0) < 0))
    rows: dict[str, list[str]] = {"": list(runs)}

    def row(name: str, form: str, of: Callable[[Run], float]) -> None:
        rows[name] = [form.format(of(run)) for run in runs.values()]

    row("base from its start, at most (cm)", "{:.1f}", lambda run: 100.0 * run.way.max())
    row("base turned, at most (degrees)", "{:.1f}", lambda run: np.degrees(run.tilt.max()))
    row("torques, at most (% of limits)", "{:.0f}", lambda run: 100.0 * np.max(np.abs(run.tau) / limit))
    row("friction ratio, planned, at most", "{:.2f}", lambda run: run.friction(run.force))
    row("friction ratio, MuJoCo, at most", "{:.2f}", lambda run: run.friction(run.floor))
    row("calls without a solution", "{:.0f}", lambda run: np.sum(run.solved == 0))
    row("QP iterations, median", "{:.0f}", lambda run: np.median(run.iterations))
    row("QP iterations, at most", "{:.0f}", lambda run: run.iterations.max())
    row("QP, median (us)", "{:.0f}", lambda run: 1e6 * np.median(run.qp))
    row("call, median (us)", "{:.0f}", lambda run: 1e6 * np.median(run.whole))
    row("call, 99th percentile (us)", "{:.0f}", lambda run: 1e6 * np.percentile(run.whole, 99))
    table = [f"{name:34}" + "".join(f"{entry:>22}" for entry in entries) for name, entries in rows.items()]
    return "\n".join([f"{len(first.time)} calls, {PERIOD * len(first.time):g} s, {steps} steps", *table])


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--seconds", type=float, default=10.0)
    parser.add_argument("--folder", type=Path, default=Path("generated/trotting"))
    parser.add_argument("--push", type=float, default=0.0, help="N, sideways on the base for 0.1 s")
    parser.add_argument("--plot", type=Path, help="a picture of both runs")
    parser.add_argument("--animation", type=Path, help="a GIF of both robots from the side")
    given = parser.parse_args()
    urdf = anymal()
    model, package = prepared(given.folder, urdf)
    world = World(urdf.read_text(), BASE, model.joint_names[1:], FEET)
    controller, start = Controller(package), standing(model)
    runs = {name: trot(world, controller, start, given.seconds, given.push, name) for name in METHODS}
    limit = np.array([joint.limits.effort for joint in model.chain.joints[1:]])
    print(report(runs, limit))
    if given.plot or given.animation:
        from plots import animate, plot

        for file, draw in ((given.plot, plot), (given.animation, animate)):
            if file:
                draw(runs, file)
                print(f"{file} written")


if __name__ == "__main__":
    main()
