"""An arm in MuJoCo picks up 1 kg, and its controller in C finds it: `python pick_up.py MODEL PACKAGE [--plot FILE]`.

MODEL is psdmc's (its URDF is inside), PACKAGE what `psdmc emit-c MODEL -o PACKAGE --name robot --payload --estimator mass`
wrote. Torques, positions and rates have noise.
"""

from __future__ import annotations

import argparse
import subprocess
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cffi
import mujoco
import numpy as np
from plant import PHYSICS_STEP, Payload, Plant
from reference import Array, trajectory

import psdmc

HERE = Path(__file__).parent
PERIOD = 1e-3
"""s between two calls of the controller."""
BANDWIDTH = 20.0
"""rad/s of the error dynamics, critically damped."""
LOAD = Payload(mass=1.0, com=(0.02, 0.0, 0.05), inertia=0.001)
PICKED_UP, END = 2.0, 7.0
"""s."""
TAU_SHARE, Q_NOISE, QD_NOISE = 0.005, 1e-5, 1e-3
"""Standard deviations of noise: actual torques, in shares of the effort limit; measured positions (rad); rates."""
LARGEST_MASS, REACH = 5.0, 0.2

DECLARATIONS = """
void start(double, double, const double *);
int control(double, double, const double *, const double *, const double *, double, double *, double *);
"""


@dataclass(frozen=True)
class PickUp:
    """Times (k,), tracking errors (k, n), estimated mass and its standard deviation (k,)."""

    time: Array
    error: Array
    mass: Array
    mass_sd: Array

    def noticed(self) -> float:
        """s after the load is picked up, until its mass is more than three standard deviations from zero for good."""
        behind = (self.time >= PICKED_UP) & (self.mass <= 3 * self.mass_sd)
        return float(self.time[behind][-1] + PERIOD - PICKED_UP) if behind.any() else 0.0


def library_of(package: Path) -> tuple[cffi.FFI, Any]:
    """The controller of pick_up.c, linked with a package."""
    make = ["make", "--silent", "-f", str(HERE / "Makefile"), f"PACKAGE={package}", "CONTROLLER=pick_up"]
    subprocess.run(make, check=True)
    ffi = cffi.FFI()
    ffi.cdef(DECLARATIONS)
    return ffi, ffi.dlopen(str((package / "controller" / "libpick_up.so").resolve()))


def simulated(model: psdmc.DynamicsModel, package: Path, end: float = END, seed: int = 0) -> PickUp:
    """Track a motion from rest to rest; after PICKED_UP seconds, the load hangs on the tip."""
    ffi, library = library_of(package)
    urdf, names, tip = model.provenance["source_text"], model.joint_names, model.chain.tip_name
    empty, full = Plant(urdf, names, tip), Plant(urdf, names, tip, LOAD)
    limits = [joint.limits for joint in model.chain.joints]
    lower, upper, speed, effort = (
        np.array([getattr(limit, key) for limit in limits]) for key in ("lower", "upper", "speed", "effort")
    )
    wanted, tau_sd, draw = trajectory(lower, upper, speed), TAU_SHARE * effort, np.random.default_rng(seed)

    def pointer(values: Array) -> Any:
        return ffi.from_buffer("double *", values)

    library.start(LARGEST_MASS, REACH, pointer(tau_sd))
    plant, tau, seen, rows = empty, np.empty(model.n), np.empty(2), []
    plant.data.qpos[plant.at] = wanted(0.0).q
    mujoco.mj_forward(plant.model, plant.data)
    for time in np.arange(round(end / PERIOD)) * PERIOD:
        if time >= PICKED_UP and plant is empty:
            full.data.qpos[:], full.data.qvel[:] = plant.data.qpos, plant.data.qvel
            plant = full
        now = wanted(time)
        true_q = plant.data.qpos[plant.at]
        q = true_q + Q_NOISE * draw.normal(size=model.n)
        qd = plant.data.qvel[plant.at] + QD_NOISE * draw.normal(size=model.n)
        given = np.concatenate([now.q, now.qd, now.qdd])
        status = library.control(
            BANDWIDTH**2, 2 * BANDWIDTH, *map(pointer, (given, q, qd)), PERIOD, pointer(tau), pointer(seen)
        )
        if status:
            raise SystemExit(f"the estimator returned {status} at {time:g} s")
        plant.data.qfrc_applied[plant.at] = tau + tau_sd * draw.normal(size=model.n)
        mujoco.mj_step(plant.model, plant.data, nstep=round(PERIOD / PHYSICS_STEP))
        rows.append((time, now.q - true_q, *seen))
    return PickUp(*(np.array(column) for column in zip(*rows, strict=True)))


def plot(run: PickUp, file: Path) -> None:
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, (above, below) = plt.subplots(2, sharex=True, figsize=(8, 6), layout="constrained")
    true = np.where(run.time >= PICKED_UP, LOAD.mass, 0.0)
    above.plot(run.time, true, "k--", linewidth=1, label="true load")
    above.plot(run.time, run.mass, color="C0", label="estimate")
    low, high = run.mass - 2 * run.mass_sd, run.mass + 2 * run.mass_sd
    above.fill_between(
        run.time, low, high, color="C0", alpha=0.25, linewidth=0, label="two standard deviations"
    )
    above.axvline(
        PICKED_UP + run.noticed(), color="C3", linewidth=1, label=f"noticed after {run.noticed():.2f} s"
    )
    above.set(ylabel="mass at the tip (kg)", ylim=(-0.5, 2.0))
    above.legend(loc="upper left", fontsize="small")
    below.semilogy(run.time, np.abs(run.error).max(axis=1) + 1e-6, linewidth=0.8)
    below.set(xlabel="time (s)", ylabel="largest tracking error (rad)")
    for axes in (above, below):
        axes.grid(alpha=0.3)
    figure.savefig(file, dpi=100)


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("model", type=Path)
    parser.add_argument("package", type=Path)
    parser.add_argument("--plot", type=Path)
    given = parser.parse_args()
    run = simulated(psdmc.load(given.model), given.package)
    print(f"noticed {run.noticed():.2f} s after it was picked up")
    for second in (1.9, 2.1, 2.5, 3.0, 4.0, 6.9):
        k = round(second / PERIOD)
        print(f"at {second:g} s: {run.mass[k]:6.3f} kg, standard deviation {run.mass_sd[k]:.3f} kg")
    if given.plot:
        plot(run, given.plot)
        print(f"{given.plot} written")


if __name__ == "__main__":
    main()
