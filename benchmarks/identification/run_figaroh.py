"""Identifies the robot of a log with FIGAROH, as installed by `pip install figaroh==1.0.2`. Runs in FIGAROH's own
environment: it imports neither psdmc nor the other files of this folder.

python run_figaroh.py URDF LOG.npz OUT.json [--wls] [--every-row] [--stage physical_fit]

LOG.npz holds time (s), position (rad) and torque (N m). OUT.json gets Pinocchio's ten parameters of each link, drive
inertia, Coulomb and viscous friction and offset: the base parameters that FIGAROH identified, and zero for the rest.
"""

from __future__ import annotations

import argparse
import json
import logging
import tempfile
from pathlib import Path

import numpy as np
import pinocchio as pin
from figaroh.identification.base_identification import BaseIdentification

CUT_OFF = 8.0
"""Hz, of FIGAROH's Butterworth filter: that of the other programs."""
EDGE = 0.5
"""s at both ends of a log that the fit leaves out, because the filters have transients there (FIGAROH's sample mask)."""
BLOCKS = ("viscous", "coulomb", "drive_inertia", "offset")
"""Per joint, behind the links' parameters, in the order of FIGAROH's columns."""


class SharedRobot(BaseIdentification):
    """FIGAROH's identification with the log of this comparison."""

    log: Path

    def load_trajectory_data(self, data_source: str | None = None) -> dict[str, np.ndarray | None]:
        with np.load(self.log) as found:
            return {
                "timestamps": found["time"],
                "positions": found["position"],
                "velocities": None,
                "accelerations": None,
                "torques": found["torque"],
            }


def settings(model: pin.Model, rate: float, stage: str) -> dict[str, object]:
    """FIGAROH's configuration: all model components, and its filter at CUT_OFF."""
    zeros = [0.0] * model.nv
    problem = {
        "use_joint_torques": True,
        "model_components": {"friction": True, "actuator_inertia": True, "joint_offset": True},
    }
    mechanics = {
        "friction_coefficients": {"viscous": zeros, "static": zeros},
        "actuator_inertias": zeros,
        "joint_offsets": zeros,
    }
    joints = {"active_joints": list(model.names)[1:]}
    task = {
        "enabled": True,
        "problem": problem,
        "signal_processing": {"sampling_frequency": rate, "cutoff_frequency": CUT_OFF, "filter_order": 4},
        "select_stage": stage,
    }
    return {
        "robot": {"name": "shared", "properties": {"joints": joints, "mechanics": mechanics}},
        "tasks": {"identification": task},
    }


def identified(found: SharedRobot, stage: str) -> np.ndarray:
    """All parameters in the order of FIGAROH's columns; zero where FIGAROH folded one into others."""
    if stage != "fit":
        if not found.selected.accepted:
            raise SystemExit(f"FIGAROH refused its stage {stage}: {found.selected.reason}")
        return np.asarray(found.selected.values, dtype=float)
    values = np.zeros(found.dynamic_regressor.shape[1])
    kept = np.delete(np.arange(len(values)), found._idx_eliminated)
    values[kept[list(found._base_indices)]] = found.phi_base
    return values


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("urdf", type=Path)
    parser.add_argument("log", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("--wls", action="store_true")
    parser.add_argument("--every-row", action="store_true")
    parser.add_argument("--stage", default="fit")
    options = parser.parse_args()
    logging.disable(logging.WARNING)
    model = pin.buildModelFromUrdf(str(options.urdf))
    with np.load(options.log) as log:
        rate = 1.0 / float(np.median(np.diff(log["time"])))
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "shared.yaml"
        file.write_text(json.dumps(settings(model, rate, options.stage)), encoding="utf-8")
        SharedRobot.log = options.log
        found = SharedRobot(pin.RobotWrapper(model), str(file))
        found.identif_config |= {"act_idxq": list(range(model.nq)), "act_idxv": list(range(model.nv))}
        found.initialize()
        rows, edge = np.arange(found.num_samples), round(EDGE * rate)
        found._sample_mask = (rows >= edge) & (rows < len(rows) - edge)
        found.solve(decimate=not options.every_row, plotting=False, wls=options.wls)
    values = identified(found, options.stage)
    n = model.nv
    told = {"standard": values[: 10 * n].tolist()}
    for k, name in enumerate(BLOCKS):
        told[name] = values[(10 + k) * n : (11 + k) * n].tolist()
    options.out.write_text(json.dumps(told), encoding="utf-8")


if __name__ == "__main__":
    main()
