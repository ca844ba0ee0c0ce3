"""One state's sines: in vectors of 32 bytes where wider ones slow the scalar code around them, any number of angles."""

from __future__ import annotations

import ctypes
import platform
import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from direct import write_sources
from slow_cases import slow_but_for
from traced import arm_package

from psdmc.backends.info import EmitOptions
from psdmc.target.presets import preset

ON_ZEN = "-D__znver3__"
FUNCTION = "test_arm_inverse_dynamics"
MOST = 40
SINES = """
#include "internal.h"
void sines(const double *angle, double *sine, double *cosine);
void sines(const double *angle, double *sine, double *cosine)
{
%s
}
"""


def made(folder: Path, target: str) -> Path:
    package = arm_package(options=EmitOptions(target=preset(target)), names=["inverse_dynamics"])
    write_sources(package, folder)
    return folder


def one_state_has_wide_vectors(folder: Path, *flags: str) -> bool:
    """Whether inverse dynamics of one state uses AVX-512's registers; its batches, in the same file, do."""
    if platform.machine() != "x86_64" or shutil.which("gcc") is None:
        pytest.skip("needs gcc for x86-64")
    words = ["gcc", "-std=c99", "-O3", "-march=x86-64-v4", *flags, f"-I{folder}/include", "-S", "-o", "-"]
    source = str(folder / "src" / "inverse_dynamics.c")
    assembly = subprocess.run([*words, source], check=True, capture_output=True, text=True).stdout
    one = re.search(rf"^{FUNCTION}:\n(.*?)^\s*\.size\s+{FUNCTION},", assembly, re.MULTILINE | re.DOTALL)
    assert one is not None
    assert "%zmm" in assembly.replace(one[1], "")
    return "%zmm" in one[1]


@pytest.mark.parametrize("target", slow_but_for(["native"], ["native", "x86-64-v4"]))
def test_one_state_has_vectors_of_64_bytes_only_where_they_cost_nothing(target: str, tmp_path: Path) -> None:
    folder = made(tmp_path, target)
    assert not one_state_has_wide_vectors(folder)
    assert one_state_has_wide_vectors(folder, ON_ZEN)


WIDTHS = [["-march=native"], ["-march=native", ON_ZEN], ["-g0"]]


@pytest.mark.parametrize("flags", slow_but_for(WIDTHS[:1], WIDTHS), ids=" ".join)
def test_any_number_of_angles_near_and_far(flags: list[str], tmp_path: Path) -> None:
    folder = made(tmp_path, "native")
    calls = [f"    sincos_reals({n}, angle, sine + {n * MOST}, cosine + {n * MOST});" for n in range(1, MOST)]
    (folder / "src" / "sines.c").write_text(SINES % "\n".join(calls))
    library = folder / "sines.so"
    optimised = "-O2" if flags == ["-march=native"] else "-O0"
    words = [
        "gcc",
        "-std=c99",
        optimised,
        *flags,
        "-fPIC",
        "-shared",
        f"-I{folder}/include",
        f"-I{folder}/src",
    ]
    subprocess.run([*words, str(folder / "src" / "sines.c"), "-lm", "-o", str(library)], check=True)

    angles = np.random.default_rng(0).uniform(-3.0, 3.0, MOST)
    angles[[3, 17, 18, 38]] = 1e7, -1e300, np.inf, np.nan
    found = np.zeros((2, MOST, MOST))
    at = [array.ctypes.data_as(ctypes.c_void_p) for array in (angles, *found)]
    ctypes.CDLL(str(library)).sines(*at)
    with np.errstate(invalid="ignore"):
        expected = np.stack([np.sin(angles), np.cos(angles)])
    for n in range(1, MOST):
        np.testing.assert_allclose(found[:, n, :n], expected[:, :n], atol=3e-16, err_msg=f"{n} angles")
        assert not found[:, n, n:].any()
