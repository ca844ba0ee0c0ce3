"""A computed-torque controller in C, closed over MuJoCo: `python run.py MODEL PACKAGE [--plot FILE]`.

MODEL is psdmc's (its URDF is inside), PACKAGE what `psdmc emit-c MODEL -o PACKAGE --name robot` wrote.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from controller import ControllerLibrary
from plant import Payload, Plant, Run
from reference import Trajectory, trajectory

import psdmc

PERIOD = 1e-3
"""s between two calls of the controller."""
BANDWIDTH = 20.0
"""rad/s of the error dynamics."""
LOAD = Payload(mass=2.0, com=(0.02, 0.0, 0.05), inertia=0.004)


@dataclass(frozen=True)
class ClosedLoop:
    """One robot in MuJoCo, unloaded and loaded, and its controller in C."""

    model: psdmc.DynamicsModel
    library: ControllerLibrary
    unloaded: Plant
    loaded: Plant
    wanted: Trajectory

    @staticmethod
    def of(model: psdmc.DynamicsModel, package: Path) -> ClosedLoop:
        if model.provenance["source_format"] != "urdf":
            raise SystemExit("MuJoCo reads URDF: derive the model from one")
        urdf, names, tip = model.provenance["source_text"], model.joint_names, model.chain.tip_name
        limits = [joint.limits for joint in model.chain.joints]
        lower, upper, speed = (
            np.array([getattr(limit, key) for limit in limits]) for key in ("lower", "upper", "speed")
        )
        plants = (Plant(urdf, names, tip), Plant(urdf, names, tip, LOAD))
        return ClosedLoop(
            model, ControllerLibrary(package, BANDWIDTH), *plants, trajectory(lower, upper, speed)
        )

    def without_model(self) -> Run:
        inertia = self.library.joint_inertias(self.wanted(0.0).q)
        return self.unloaded.run(self.library.independent_joints(inertia), self.wanted, PERIOD)

    def with_model(self, period: float = PERIOD) -> Run:
        return self.unloaded.run(self.library.computed_torque(), self.wanted, period)

    def with_wrong_payload(self) -> Run:
        return self.loaded.run(self.library.computed_torque(), self.wanted, PERIOD)

    def with_right_payload(self) -> Run:
        """The load's mass, centre and inertia become base parameters, which the same compiled code takes."""
        heavier = self.model.with_payload(LOAD.mass, LOAD.com, LOAD.inertia * np.eye(3))
        return self.loaded.run(self.library.computed_torque(heavier.theta_b), self.wanted, PERIOD)

    def all_runs(self) -> dict[str, Run]:
        return {
            "independent joints": self.without_model(),
            "computed torque": self.with_model(),
            f"load of {LOAD.mass:g} kg, not in the model": self.with_wrong_payload(),
            f"load of {LOAD.mass:g} kg, in theta_b": self.with_right_payload(),
        }


def plot(runs: dict[str, Run], joints: tuple[str, ...], file: Path) -> None:
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(len(runs), sharex=True, sharey=True, figsize=(8, 8), layout="constrained")
    for axis, (title, run) in zip(axes, runs.items(), strict=True):
        axis.semilogy(run.time, np.abs(run.error) + 1e-12, linewidth=0.8)
        axis.set(title=title, ylabel="|error| (rad, m)", ylim=(1e-7, 3))
        axis.grid(alpha=0.3)
    axes[0].legend(joints, ncols=3, fontsize="small", loc="lower right")
    axes[-1].set_xlabel("time (s)")
    figure.savefig(file, dpi=75)


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("model", type=Path)
    parser.add_argument("package", type=Path)
    parser.add_argument("--plot", type=Path)
    given = parser.parse_args()
    model = psdmc.load(given.model)
    runs = ClosedLoop.of(model, given.package).all_runs()
    print(f"{'tracking error (rad, m)':42} {'largest':>9} {'RMS':>9} {'at rest':>9}")
    for title, run in runs.items():
        largest, rms = np.abs(run.error).max(), np.sqrt(np.mean(run.error**2))
        print(f"{title:42} {largest:9.2e} {rms:9.2e} {np.abs(run.error[-1]).max():9.2e}")
    if given.plot:
        plot(runs, model.joint_names, given.plot)
        print(f"{given.plot} written")


if __name__ == "__main__":
    main()
