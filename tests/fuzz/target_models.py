"""Model files: read, shown and evaluated; now and then checked and emitted."""

from __future__ import annotations

import contextlib
import io
from pathlib import Path

import numpy as np

from psdmc import emission
from psdmc.backends.c.back_end import package_files
from psdmc.backends.info import EmitOptions
from psdmc.cli.show import print_model
from psdmc.model.load import load
from psdmc.model.store import file_bytes
from psdmc.progress import silent
from psdmc.verification.check import check_model


def model(data: bytes, folder: Path, deep: bool) -> None:
    file = folder / "model.npz"
    file.write_bytes(data)
    found = load(file)
    with contextlib.redirect_stdout(io.StringIO()):
        print_model(found)
    if found.theta_b is not None:
        found.inverse_dynamics(*(np.full((1, size), 0.5) for size in (found.nq, found.nv, found.nv)))
    if deep:
        file_bytes(found)
        check_model(found)
        package_files(
            emission.package_of(found, emission.EmitRequest("auto", ["gravity"], EmitOptions()), silent)
        )
