"""Several logs of one description: some are fitted, the others are held out as a whole."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from bundled import bundled_model
from test_payload_identification import Run, record

import psdmc
from psdmc.calibration.verdict.record import Calibration

CALLS = """
[[log]]
file = "one.csv"
[[log]]
file = "two.csv"
use = "validate"
[fit]
cutoff = 5
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("logs")
    for seed, name in ((3, "one.csv"), (4, "two.csv")):
        record(folder / name, Run(seed=seed, loaded=False, seconds=15.0))
    (folder / "log.toml").write_text(CALLS, encoding="utf-8")
    return folder


def counts(found: Calibration) -> tuple[int, int]:
    """Independent samples of the first joint that were fitted, and that were held out."""
    out = found.steps[0].samples[0].held_out
    return int((~out).sum()), int(out.sum())


def test_a_log_for_validation_is_held_out_whole_and_the_other_fitted_whole(folder: Path):
    model = bundled_model("kr6")

    described = psdmc.calibrate(model, folder / "log.toml")
    fitted, held = counts(described)
    alone = psdmc.calibrate(model, folder / "one.csv", psdmc_options(5.0))

    assert fitted == held == sum(counts(alone))
    assert [log.use for log in described.logs] == ["fit", "validate"]
    listed = psdmc.calibrate(model, folder / "one.csv", psdmc_options(5.0), validation=folder / "two.csv")
    assert np.array_equal(listed.model.theta_b, described.model.theta_b)


def psdmc_options(cutoff: float):
    from psdmc.calibration.calibrate import CalibrateOptions
    from psdmc.calibration.description.description import FitChoice

    return CalibrateOptions(choice=FitChoice(cutoff=cutoff))
