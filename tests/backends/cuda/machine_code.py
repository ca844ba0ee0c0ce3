"""Machine code of CUDA packages, by NVRTC and ptxas, which need no GPU.

`python tests/backends/cuda/machine_code.py` writes the counts of the installed compiler into registers.json, and prints how
long each function takes to compile.
"""

from __future__ import annotations

import ctypes
import json
import re
import subprocess
import sys
import tempfile
import time
from importlib import metadata
from itertools import product
from pathlib import Path

sys.path.append(str(Path(__file__).parents[2]))

from bundled import bundled_model
from pinocchio_robots import path_of

import psdmc
from psdmc.compiler import emit
from psdmc.functions import DEFAULT, DEFAULT_WHERE_WIDE

FILE = Path(__file__).parent / "registers.json"
DERIVATIVES = ("inverse_dynamics_derivatives", "forward_dynamics_derivatives", "forward_dynamics_vjp")
NVRTC, NVCC = "nvidia-cuda-nvrtc-cu12", "nvidia-cuda-nvcc-cu12"
FAILED = "compute_{arch}: {log}"

Counts = dict[str, list[int]]
"""Of each kernel: registers, and bytes that are stored to and read from memory for want of registers."""

Records = dict[str, dict[str, Counts]]
"""By version of the compiler, then by robot, precision and generation of GPUs."""


def robots() -> dict[str, tuple[psdmc.DynamicsModel, tuple[str, ...]]]:
    """The robots of which counts are recorded, and their functions."""
    hyq = psdmc.derive(path_of("hyq"), floating=True)
    return {
        "kr6": (bundled_model("kr6"), (*DEFAULT, *DERIVATIVES)),
        "hyq": (hyq, (*DEFAULT_WHERE_WIDE, *DERIVATIVES)),
    }


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
    assert (failed, log.strip("\0 \n")) == (0, ""), FAILED.format(arch=arch, log=log[:2000])
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


def text_of(records: Records) -> str:
    """JSON with one kernel in a line."""
    lines = json.dumps(records, indent=1)
    return re.sub(r"\[\s+(\d+),\s+(\d+),\s+(\d+)\s+\]", r"[\1, \2, \3]", lines) + "\n"


def main() -> None:
    """Record the counts, robot by robot."""
    records: Records = json.loads(FILE.read_text(encoding="utf-8")) if FILE.exists() else {}
    own = records.setdefault(version(), {})
    for (robot, (model, names)), arch, real in product(robots().items(), (90, 80), ("float32", "float64")):
        if (robot, arch) == ("hyq", 80):  # ptxas takes minutes
            continue
        found: Counts = {}
        for name in names:
            with tempfile.TemporaryDirectory() as folder:
                found |= counts(model, Path(folder), real, arch, (name,))
        own[f"{robot} {real} sm_{arch}"] = found
        FILE.write_text(text_of(records), encoding="utf-8")


if __name__ == "__main__":
    main()
