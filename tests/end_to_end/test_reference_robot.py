"""The committed package of the reference robot is what psdmc emits today, byte for byte; PSDMC_REWRITE_GOLDEN=1 rewrites it.

It starts from a saved model, because which parameters are pivots may depend on a BLAS's rounding, emission may not.
"""

from __future__ import annotations

import os
from pathlib import Path

from command_line import files_in

import psdmc
from psdmc.model.load import load

ROOT = Path(__file__).parents[2]
PACKAGE = ROOT / "generated" / "two_link"
MODEL = ROOT / "tests" / "golden" / "two_link" / "two_link.npz"


def test_the_reference_robot_is_reproduced(tmp_path: Path):
    psdmc.emit_c(load(MODEL), tmp_path)
    if os.environ.get("PSDMC_REWRITE_GOLDEN"):
        psdmc.emit_c(load(MODEL), PACKAGE)

    made = files_in(tmp_path)
    kept = {path: text for path, text in files_in(PACKAGE).items() if not path.startswith("build/")}

    assert sorted(made) == sorted(kept)
    assert [path for path in made if made[path] != kept[path]] == [], "make golden, and review the difference"
