"""`make calibrate-demo`: plan, simulate and calibrate the virtual Denso, and compare with the truth."""

from __future__ import annotations

import argparse
import json
import os
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from psdmc.calibration.calibrate import CalibrateOptions, calibrate
from psdmc.calibration.campaign import CampaignOptions, excitation_json, plan_campaign, write_campaign
from psdmc.calibration.plant.virtual_robot import load_virtual_robot
from psdmc.calibration.simulate_campaign import SimulateOptions, simulate_campaign
from psdmc.calibration.verdict.record import Calibration, verdict_of
from psdmc.compiler import compile as compile_model
from psdmc.compiler import derive
from psdmc.files import write_whole
from psdmc.model.store import save
from psdmc.report.calibrate_report import write_report
from psdmc.report.truth import Comparison, compare, truth_view

EXAMPLES = Path("examples")
ROBOT = EXAMPLES / "robots" / "denso_wall.toml"
PLANT = EXAMPLES / "plants" / "denso_virtual.toml"

WHOLE = CampaignOptions(table="npz")
"""Options of the whole campaign: half an hour of the robot's time."""

Variant = tuple[str, bool, bool]
VARIANTS: tuple[Variant, ...] = (("ideal", True, False), ("sensors", False, False), ("harness", False, True))
"""Name, whether sensors are ideal, whether there is a cable harness."""


def run_demo(
    folder: Path,
    variants: tuple[str, ...] = ("sensors",),
    workers: int = 2,
    say: Callable[[str], None] = print,
) -> dict[str, Comparison]:
    """Plan, simulate, calibrate and report each variant; return how each compares with the true parameters."""
    begin = time.monotonic()

    def step(text: str) -> None:
        say(f"[{time.monotonic() - begin:6.1f} s] {text}")

    model = derive(ROBOT, drive_inertia=True)
    unknown = replace(model, theta_b=None)
    robot = compile_model(model, functions=["regressor"])
    step("searching an exciting motion")
    planned = plan_campaign(model, robot, WHOLE)
    runs, found = planned.runs, planned.found
    step(f"condition number {found.condition:.2f}; {found.comparison}")
    results: dict[str, Comparison] = {}
    for name, ideal, harness in VARIANTS:
        if name not in variants:
            continue
        campaign = write_campaign(folder / name, runs, found, "npz", force=True)
        options = SimulateOptions(ideal_sensors=ideal, harness=harness, workers=workers)
        count = simulate_campaign(PLANT, campaign, options)
        step(f"{name}: {count} logs simulated, {len(runs) - count} were there")
        record = calibrate(
            unknown,
            campaign,
            _options(workers),
            regressor=robot,
            progress=step,
        )
        save(record.model, folder / f"denso_{name}.npz")
        plant = load_virtual_robot(PLANT, ideal_sensors=ideal, harness=harness)
        truth = truth_view(record, model, plant)
        page, _ = write_report(record, folder / f"calibration_{name}.html", found, truth)
        results[name] = compare(record, model, plant)
        for line in (*_accuracy(record), *results[name].lines()):
            say(line)
        step(f"{name}: report in {page}")
    summary = {name: result.as_json() for name, result in results.items()}
    text = json.dumps({"excitation": excitation_json(found), "truth": summary}, indent=1)
    write_whole(folder / "truth.json", text + "\n")
    return results


def _options(workers: int) -> CalibrateOptions:
    plain = CalibrateOptions()
    return replace(
        plain, campaign=replace(plain.campaign, lugre=replace(plain.campaign.lugre, workers=workers))
    )


def _accuracy(record: Calibration) -> list[str]:
    lines = []
    for step in record.steps:
        values = " ".join(f"{np.round(both.held_out.r2, 4):8.4f}" for both in step.joints.values())
        lines.append(f"  R² held out, {step.step:<9}{values}")
    verdict = [f"  {line}" for line in verdict_of(record).lines()]
    return [*verdict, *lines, *(f"  warning: {warning}" for warning in record.warnings)]


def main() -> None:
    """Arguments: the output folder and the variants."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", nargs="?", type=Path, default=Path("generated") / "calibrate_demo")
    parser.add_argument("--variants", nargs="+", default=["sensors"], choices=[name for name, *_ in VARIANTS])
    parser.add_argument("--workers", type=int, default=min(2, os.cpu_count() or 1))
    given = parser.parse_args()
    run_demo(given.folder, tuple(given.variants), given.workers)


if __name__ == "__main__":
    main()
