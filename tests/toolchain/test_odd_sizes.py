"""Matrices whose size four does not divide, into rows: a last group that overlaps, zeros, and a value stored twice."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from direct import Direct, expected, shared_library, states

from psdmc.backends.c.package import package_view
from psdmc.backends.info import EmitOptions, JointInfo, PackageInfo
from psdmc.functions import SIGNATURES
from psdmc.model.equations import BaseParameter
from psdmc.program.kernel import Kernel
from psdmc.program.text import parse

TIP_OF_A_PENDULUM = parse("""
    q = load q[0]
    s = sin q
    c = cos q
    r = const 0.7
    x = mul r s
    y = mul r c
    one = const 1.0
    out J[0] = x
    out J[1] = y
    out J[4] = y
    out J[5] = one
""")
INFO = PackageInfo(
    name="pendulum",
    joints=(JointInfo("hinge", "revolute"),),
    gravity=(0.0, 0.0, -9.81),
    base="wall",
    tip="bob",
    parameters=(BaseParameter("Izz1", "kg m^2", 1.0),),
    model_hash="",
    psdmc_version="0.1.0",
)


@pytest.mark.parametrize("flags", [["-march=native"], ["-g0"], ["-Dpendulum_NO_VECTORS"]], ids=" ".join)
@pytest.mark.parametrize("real", ["float64", "float32"])
def test_six_outputs_per_state(real: str, flags: list[str], tmp_path: Path) -> None:
    kernel = Kernel(SIGNATURES["jacobian"], False, TIP_OF_A_PENDULUM, TIP_OF_A_PENDULUM, "factored")
    package = package_view(INFO, {"jacobian": kernel}, EmitOptions(real=real))  # type: ignore[arg-type]
    library = Direct(package, shared_library(package, tmp_path, ["-O1", *flags]))
    for count in (1, 7, 16, 21):
        given = states(kernel, count, 1, 1)
        found = np.full((count + 1, 6), 99.0, real)
        library("jacobian_batch", count, np.ascontiguousarray(given["q"], real), found)
        np.testing.assert_allclose(found[:-1], expected(kernel, given, 1, 1), atol=1e-6)
        assert np.all(found[-1] == 99.0)
