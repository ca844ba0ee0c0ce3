"""CUDA packages compiled by g++ for this machine: the header in shim/ stands for CUDA's language and run time."""

from __future__ import annotations

import ctypes
import re
import subprocess
from collections.abc import Sequence
from pathlib import Path

import numpy as np

SHIM = Path(__file__).parent / "shim"
FLAGS = ("-std=c++14", "-Wall", "-Wextra", "-Werror", "-Wno-unknown-pragmas", "-Wno-unused-function")
FLAGS += ("-fno-strict-aliasing", "-pthread", f"-I{SHIM}", f"-include{SHIM / 'cuda_runtime_api.h'}")


def robot_in(folder: Path) -> str:
    (header,) = folder.glob("include/*/*.cuh")
    return header.stem


def compiled(folder: Path, sources: Sequence[Path], output: str, *flags: str) -> Path:
    """A program or library of a package's sources; warnings are errors."""
    command = ["g++", *FLAGS, *flags, f"-I{folder / 'include'}", "-xc++", *map(str, sources)]
    done = subprocess.run([*command, "-o", folder / output], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[:4000]
    return folder / output


def self_test(folder: Path) -> subprocess.CompletedProcess[str]:
    """The package's own test, run."""
    sources = [folder / "src" / f"{robot_in(folder)}.cu", folder / "test" / "self_test.cu"]
    program = compiled(folder, sources, "self_test", "-O0")
    return subprocess.run([program], capture_output=True, text=True, check=False)


def passed(done: subprocess.CompletedProcess[str]) -> int:
    """Number of functions of which each output agreed in both layouts."""
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr
    lines = done.stdout.splitlines()
    assert not any("FAILED" in line or "not checked" in line for line in lines)
    (checks, functions) = re.search(r": (\d+) checks of (\d+) functions, 0 failed", lines[-1]).groups()  # type: ignore[union-attr]
    assert int(checks) == len(lines) - 1 >= 2 * int(functions)
    return int(functions)


class Library:
    """The host library of a package: launches on arrays of this machine."""

    def __init__(self, folder: Path, real: type) -> None:
        self.robot, self.real = robot_in(folder), real
        source = folder / "src" / f"{self.robot}.cu"
        self.dll = ctypes.CDLL(str(compiled(folder, [source], "library.so", "-O0", "-shared", "-fPIC")))

    def __call__(
        self,
        function: str,
        layout: str,
        given: Sequence[np.ndarray],
        *sizes: int,
        theta: np.ndarray | None = None,
        status: np.ndarray | None = None,
    ) -> list[np.ndarray]:
        """Outputs of these sizes, a row per state, for inputs of a row per state."""
        count = len(given[0])
        found = [np.full((count, size), -1.0, self.real) for size in sizes]
        arrays = [np.array(each, self.real) for each in (*given, *found)]
        if layout == "states":
            arrays = [np.ascontiguousarray(each.T) for each in arrays]
        if theta is not None:
            arrays.insert(len(given), np.array(theta, self.real))
        places = [each.ctypes.data_as(ctypes.c_void_p) for each in arrays]
        places += [] if status is None else [status.ctypes.data_as(ctypes.c_void_p)]
        error = self.dll[f"{self.robot}_{function}_{layout}_launch"](*places, ctypes.c_longlong(count), None)
        assert error == 0
        outputs = arrays[len(arrays) - len(sizes) :]
        return [each.T if layout == "states" else each for each in outputs]
