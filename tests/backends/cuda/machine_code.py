"""Machine code of CUDA packages, by NVRTC and ptxas, which need no GPU. `python tests/backends/cuda/machine_code.py` writes
what registers.json states for the installed compiler."""

from __future__ import annotations

import ctypes
import json
import re
import subprocess
import sys
import tempfile
import time
from importlib import metadata
from pathlib import Path

import psdmc
from psdmc.compiler import emit

FILE = Path(__file__).parent / "registers.json"
DERIVATIVES = ("inverse_dynamics_derivatives", "forward_dynamics_derivatives", "forward_dynamics_vjp")
NVRTC, NVCC = "nvidia-cuda-nvrtc-cu12", "nvidia-cuda-nvcc-cu12"
FAILED = "compute_{arch}: {log}"

Counts = dict[str, list[int]]
"""Of each kernel: registers, and bytes that are stored to and read from memory for want of registers."""


def wheel_file(wheel: str, name: str) -> Path | None:
    """A file of an installed wheel; None without the wheel."""
    try:
        files = metadata.files(wheel) or []
    except metadata.PackageNotFoundError:
        return None
    return next((Path(str(each.locate())) for each in files if each.name == name), None)


def are_installed() -> bool:
    return None not in (wheel_file(NVRTC, "libnvrtc.so.12"), wheel_file(NVCC, "ptxas"))


def version() -> str:
    """Key of the counts."""
    return f"NVRTC {metadata.version(NVRTC)}, ptxas {metadata.version(NVCC)}"


def ptx(source: str, robot: str, arch: int) -> bytes:
    """Virtual machine code of a header alone; warnings are errors."""
    nvrtc = ctypes.CDLL(str(wheel_file(NVRTC, "libnvrtc.so.12")))
    program, size = ctypes.c_void_p(), ctypes.c_size_t()
    nvrtc.nvrtcCreateProgram(ctypes.byref(program), source.encode(), b"robot.cuh", 0, None, None)
    words = (f"--gpu-architecture=compute_{arch}", f"-D{robot}_KERNELS")
    failed = nvrtc.nvrtcCompileProgram(
        program, len(words), (ctypes.c_char_p * len(words))(*(word.encode() for word in words))
    )

    def read(what: str) -> bytes:
        nvrtc[f"nvrtcGet{what}Size"](program, ctypes.byref(size))
        text = ctypes.create_string_buffer(size.value)
        nvrtc[f"nvrtcGet{what}"](program, text)
        return text.value

    log = read("ProgramLog").decode()
    assert not failed and not log.strip(), FAILED.format(arch=arch, log=log[:2000])
    code = read("PTX")
    nvrtc.nvrtcDestroyProgram(ctypes.byref(program))
    return code


KERNEL = re.compile(
    r"Compiling entry function '(\w+)'.*\n(?:.*\n)*?"
    r".* (\d+) bytes spill stores, (\d+) bytes spill loads\n.*Used (\d+) registers"
)


def assembled(code: bytes, arch: int) -> Counts:
    """Counts of each kernel in machine code for one generation of GPUs."""
    with tempfile.TemporaryDirectory() as folder:
        source = Path(folder) / "robot.ptx"
        source.write_bytes(code)
        command = [
            str(wheel_file(NVCC, "ptxas")),
            "-v",
            f"-arch=sm_{arch}",
            str(source),
            "-o",
            f"{folder}/robot.cubin",
        ]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr[:2000]
        assert (Path(folder) / "robot.cubin").stat().st_size > 0
    return {name: [int(used), int(out), int(back)] for name, out, back, used in KERNEL.findall(done.stderr)}


def counts(
    model: psdmc.DynamicsModel, folder: Path, real: str, arch: int, functions: tuple[str, ...]
) -> Counts:
    """Counts of each kernel of a package, by its name without the robot's."""
    emit(model, folder, "cuda", functions=functions, real=real, name="robot")  # type: ignore[arg-type]
    source = (folder / "include" / "robot" / "robot.cuh").read_text(encoding="utf-8")
    start = time.perf_counter()
    code = ptx(source, "robot", arch)
    middle = time.perf_counter()
    found = assembled(code, arch)
    times = f"NVRTC {middle - start:.1f} s, ptxas {time.perf_counter() - middle:.1f} s"
    print(f"{model.mechanism.name} {real} sm_{arch} {functions}: {times}", file=sys.stderr)
    return {name.removeprefix("robot_"): each for name, each in found.items()}


def kernels_in(folder: Path) -> set[str]:
    """Names of the kernels that a package has, without the robot's."""
    functions = json.loads((folder / "manifest.json").read_text())["functions"]
    names = [kernel["name"] for each in functions for kernel in each["kernels"]]
    return {f"{name}_{layout}" for name in names for layout in ("states", "rows")}
