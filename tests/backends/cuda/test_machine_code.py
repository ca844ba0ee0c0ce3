"""Every function becomes machine code for GPUs without a warning, with no more registers and spills than recorded."""

from __future__ import annotations

import json
from pathlib import Path

import machine_code
import pytest
from bundled import bundled_model
from machine_code import DERIVATIVES, FILE, counts, kernels_in, version
from pinocchio_robots import path_of

import psdmc
from psdmc.backends.info import EmitOptions
from psdmc.emission import EmitRequest, cuda_source
from psdmc.errors import ToolchainError
from psdmc.functions import DEFAULT, DEFAULT_WHERE_WIDE
from psdmc.progress import silent
from psdmc.toolchain import cuda_libraries

pytestmark = pytest.mark.skipif(
    not machine_code.are_installed(), reason="the extra cuda (NVRTC and ptxas) is not installed"
)

RECORDED = json.loads(FILE.read_text(encoding="utf-8"))


def worse(found: machine_code.Counts, recorded: machine_code.Counts) -> list[str]:
    """Kernels with more registers or spills than recorded, and those that are not recorded."""
    return [
        f"{name}: registers, bytes stored, bytes loaded {each}, recorded {recorded.get(name)}"
        for name, each in found.items()
        if name not in recorded or any(a > b for a, b in zip(each, recorded[name], strict=True))
    ]


def check(
    model: psdmc.DynamicsModel, robot: str, real: str, arch: int, names: tuple[str, ...], folder: Path
) -> None:
    found = counts(model, folder, real, arch, names)

    assert set(found) == kernels_in(folder)
    if version() not in RECORDED:
        pytest.skip(f"registers.json has no counts of {version()}: run machine_code.py")
    assert not worse(found, RECORDED[version()][f"{robot} {real} sm_{arch}"])


@pytest.mark.parametrize("arch", [90, pytest.param(80, marks=pytest.mark.slow)])
@pytest.mark.parametrize("real", ["float32", pytest.param("float64", marks=pytest.mark.slow)])
def test_of_an_arm(real: str, arch: int, tmp_path: Path) -> None:
    check(bundled_model("kr6"), "kr6", real, arch, (*DEFAULT, *DERIVATIVES), tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("real", ["float32", "float64"])
def test_of_a_quadruped(real: str, tmp_path: Path) -> None:
    """For one generation of GPUs: ptxas takes minutes."""
    model = psdmc.derive(path_of("hyq"), floating=True)
    check(model, "hyq", real, 90, (*DEFAULT_WHERE_WIDE, *DERIVATIVES), tmp_path)


def test_more_than_recorded_is_noticed() -> None:
    recorded = {"a": [32, 0, 0], "b": [255, 8, 16]}

    assert not worse({"a": [32, 0, 0], "b": [40, 0, 16]}, recorded)
    assert len(worse({"a": [33, 0, 0], "b": [255, 8, 17], "c": [1, 0, 0]}, recorded)) == 3


@pytest.mark.parametrize(("arch", "begin"), [(90, b"\x7fELF"), (999, b"//")])
def test_compile_at_run_time(arch: int, begin: bytes) -> None:
    """What psdmc.compile(target="cuda") loads: machine code of a GPU that NVRTC knows, and PTX for a newer one."""
    names = ("inverse_dynamics", "forward_dynamics")
    source = cuda_source(
        bundled_model("two_link"), EmitRequest("auto", names, EmitOptions("float32")), silent
    )

    code = cuda_libraries.machine_code(source.text, f"{source.robot}_KERNELS", arch)

    assert code.startswith(begin)
    for name in source.interface.kernels:
        assert f"two_link_{name}_rows".encode() in code
    with pytest.raises(ToolchainError, match=r"no GPU as old as compute capability 2\.0"):
        cuda_libraries.machine_code(source.text, "x", 20)
